/* Memory: from the C library of the process that loads an FMU; on Windows from windows.c. */
#ifndef STDLIB_H
#define STDLIB_H
#include <stddef.h>
void *calloc(size_t count, size_t size);
void free(void *memory);
#endif
