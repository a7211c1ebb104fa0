/* Names of exported functions: those of the standard. FMI2_FUNCTION_PREFIX or FMI3_FUNCTION_PREFIX, defined for the
   compiler, goes before each name, so that several models can be linked statically. */

#ifndef FMU_EXPORT_H
#define FMU_EXPORT_H

#if defined(_WIN32)
#define FMU_EXPORT __declspec(dllexport)
#elif defined(__GNUC__)
#define FMU_EXPORT __attribute__((visibility("default")))
#else
#define FMU_EXPORT
#endif

#define FMU_JOIN_EXPANDED(prefix, name) prefix##name
#define FMU_JOIN(prefix, name) FMU_JOIN_EXPANDED(prefix, name)

#endif
