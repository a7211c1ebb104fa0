/* Literals and functions of the C library in the precision of fw_real. */

#ifndef FW_MATH_H
#define FW_MATH_H

#include <math.h>

#ifdef FW_FLOAT
#define FW_REAL(value) value##f
#define FW_SQRT(value) sqrtf(value)
#define FW_EXP(value) expf(value)
#define FW_LOG(value) logf(value)
#define FW_ABS(value) fabsf(value)
#else
#define FW_REAL(value) value
#define FW_SQRT(value) sqrt(value)
#define FW_EXP(value) exp(value)
#define FW_LOG(value) log(value)
#define FW_ABS(value) fabs(value)
#endif

#endif
