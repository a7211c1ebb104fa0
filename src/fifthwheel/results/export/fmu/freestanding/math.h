/* What an FMU needs of the C library. Its functions come from the run-time library of the compiler. */
#ifndef MATH_H
#define MATH_H
#define NAN __builtin_nanf("")
#define INFINITY __builtin_inff()
double sqrt(double value);
double fabs(double value);
double ceil(double value);
double exp(double value);
double sin(double value);
double cos(double value);
double atan(double value); /* atan.c */
#endif
