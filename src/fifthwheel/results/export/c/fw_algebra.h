/* Linear equations, and the covariance of the state under random steering. Included after the numbers of the
   vehicle. */

#ifndef FW_ALGEBRA_H
#define FW_ALGEBRA_H

#define FW_N FW_MODEL_STATES    /* states of the vehicle, without the bank of the road */
#define FW_L (FW_MODEL_STATES + 1) /* with the low-pass of the steer angle */
#define FW_SMITH_POLE FW_REAL(10.0) /* rad/s; any positive number gives the same solution */
#define FW_SMITH_DOUBLINGS 24
#define FW_SMITH_LARGEST FW_REAL(1e9)

/* Solves a x = b for `columns` right sides by Gaussian elimination; b becomes x. Returns 0 if a is singular. */
static int fw_solve(int size, fw_real *a, int columns, fw_real *b)
{
    for (int i = 0; i < size; i++) {
        int pivot = i;
        for (int row = i + 1; row < size; row++) {
            if (FW_ABS(a[(row * size) + i]) > FW_ABS(a[(pivot * size) + i])) {
                pivot = row;
            }
        }
        if (!(FW_ABS(a[(pivot * size) + i]) > FW_REAL(0.0))) {
            return 0;
        }
        for (int j = 0; (pivot != i) && (j < size); j++) {
            const fw_real swap = a[(i * size) + j];
            a[(i * size) + j] = a[(pivot * size) + j];
            a[(pivot * size) + j] = swap;
        }
        for (int j = 0; (pivot != i) && (j < columns); j++) {
            const fw_real swap = b[(i * columns) + j];
            b[(i * columns) + j] = b[(pivot * columns) + j];
            b[(pivot * columns) + j] = swap;
        }
        for (int row = i + 1; row < size; row++) {
            const fw_real factor = a[(row * size) + i] / a[(i * size) + i];
            for (int j = i; j < size; j++) {
                a[(row * size) + j] -= factor * a[(i * size) + j];
            }
            for (int j = 0; j < columns; j++) {
                b[(row * columns) + j] -= factor * b[(i * columns) + j];
            }
        }
    }
    for (int i = size - 1; i >= 0; i--) {
        for (int j = 0; j < columns; j++) {
            for (int k = i + 1; k < size; k++) {
                b[(i * columns) + j] -= a[(i * size) + k] * b[(k * columns) + j];
            }
            b[(i * columns) + j] /= a[(i * size) + i];
        }
    }
    return 1;
}

/* Scalar product of a row (FW_L) and of numbers that are `stride` apart. */
static fw_real fw_dot(const fw_real *row, const fw_real *other, int stride)
{
    fw_real sum = FW_REAL(0.0);
    for (int k = 0; k < FW_L; k++) {
        sum += row[k] * other[k * stride];
    }
    return sum;
}

/* Stationary covariance p (FW_L x FW_L) of low-pass and vehicle for a steer angle of variance 1: A p + p A' + Q = 0.
   Smith's method: with C = (A - s I)^-1 (A + s I) it is the sum of C^k D C'^k, doubled in each round. The first of
   `columns` columns of b is that of the steer angle. Returns 0 if the vehicle is unstable: then p is not valid. */
static int fw_random_steer(const fw_real *a, const fw_real *b, int columns, fw_real *p)
{
    fw_real left[FW_L * FW_L];
    fw_real c[FW_L * FW_L];
    fw_real e[FW_L];
    fw_real work[FW_L * FW_L];
    for (int i = 0; i < FW_L; i++) {
        for (int j = 0; j < FW_L; j++) {
            fw_real value = FW_REAL(0.0);
            if ((i < FW_N) && (j < FW_N)) {
                value = a[(i * FW_N) + j];
            } else if (i < FW_N) {
                value = b[i * columns];
            } else if (j == FW_N) {
                value = -FW_STEER_RATE;
            } else {
                /* the low-pass does not depend on the vehicle */
            }
            left[(i * FW_L) + j] = value - ((i == j) ? FW_SMITH_POLE : FW_REAL(0.0));
            c[(i * FW_L) + j] = value + ((i == j) ? FW_SMITH_POLE : FW_REAL(0.0));
            work[(i * FW_L) + j] = left[(i * FW_L) + j];
        }
        e[i] = (i == FW_N) ? FW_REAL(1.0) : FW_REAL(0.0);
    }
    if ((fw_solve(FW_L, left, FW_L, c) == 0) || (fw_solve(FW_L, work, 1, e) == 0)) {
        return 0;
    }
    for (int i = 0; i < FW_L; i++) {
        for (int j = 0; j < FW_L; j++) {
            p[(i * FW_L) + j] = FW_REAL(4.0) * FW_STEER_RATE * FW_SMITH_POLE * e[i] * e[j];
        }
    }
    for (int round = 0; round < FW_SMITH_DOUBLINGS; round++) {
        fw_real largest = FW_REAL(0.0);
        for (int i = 0; i < FW_L; i++) { /* left = c p, work = c c */
            for (int j = 0; j < FW_L; j++) {
                left[(i * FW_L) + j] = fw_dot(&c[i * FW_L], &p[j], FW_L);
                work[(i * FW_L) + j] = fw_dot(&c[i * FW_L], &c[j], FW_L);
            }
        }
        for (int i = 0; i < FW_L; i++) { /* p += left c' */
            for (int j = 0; j < FW_L; j++) {
                p[(i * FW_L) + j] += fw_dot(&left[i * FW_L], &c[j * FW_L], 1);
            }
        }
        for (int i = 0; i < (FW_L * FW_L); i++) {
            c[i] = work[i];
            if (!(FW_ABS(c[i]) < FW_SMITH_LARGEST)) {
                return 0; /* the powers of C grow; also if not a number */
            }
            largest = (FW_ABS(c[i]) > largest) ? FW_ABS(c[i]) : largest;
        }
        if (largest < FW_REAL(1e-12)) {
            return 1;
        }
    }
    return 0;
}

#endif
