/* Literals and functions of the C library in the precision of fw_real, and copies of numbers. */

#ifndef FW_MATH_H
#define FW_MATH_H

#include <math.h>

#ifdef FW_FLOAT
#define FW_REAL_MAX 3.40282347e38f
#define FW_REAL(value) value##f
#define FW_SQRT(value) sqrtf(value)
#define FW_EXP(value) expf(value)
#define FW_LOG(value) logf(value)
#define FW_ABS(value) fabsf(value)
#define FW_SIN(value) sinf(value)
#define FW_COS(value) cosf(value)
#define FW_ATAN(value) atanf(value)
#define FW_TANH(value) tanhf(value)
#else
#define FW_REAL_MAX 1.7976931348623157e308
#define FW_REAL(value) value
#define FW_SQRT(value) sqrt(value)
#define FW_EXP(value) exp(value)
#define FW_LOG(value) log(value)
#define FW_ABS(value) fabs(value)
#define FW_SIN(value) sin(value)
#define FW_COS(value) cos(value)
#define FW_ATAN(value) atan(value)
#define FW_TANH(value) tanh(value)
#endif

static inline void fw_copy(fw_real *to, const fw_real *from, int count)
{
    for (int i = 0; i < count; i++) {
        to[i] = from[i];
    }
}

static inline void fw_fill(fw_real *numbers, fw_real value, int count)
{
    for (int i = 0; i < count; i++) {
        numbers[i] = value;
    }
}

#endif
