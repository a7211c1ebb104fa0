/* The arc tangent, which the run-time library of the compiler does not have. */

#include <math.h>

#define QUARTER 0.78539816339744830962 /* pi / 4 */
#define TERMS 24

/* atan x = x - x^3 / 3 + x^5 / 5 - ..., for |x| up to tan(pi / 8) = 0.414 */
static double series(double x)
{
    double total = 0.0;
    int k;
    for (k = TERMS; k >= 0; k--) {
        total = (1.0 / (double)((2 * k) + 1)) - (x * x * total);
    }
    return x * total;
}

double atan(double value)
{
    const double x = fabs(value);
    double angle;
    if (x > 2.41421356237309504880) { /* tan(3 pi / 8) */
        angle = (2.0 * QUARTER) - series(1.0 / x);
    } else if (x > 0.41421356237309504880) {
        angle = QUARTER + series((x - 1.0) / (x + 1.0));
    } else {
        angle = series(x);
    }
    return (value < 0.0) ? -angle : angle;
}
