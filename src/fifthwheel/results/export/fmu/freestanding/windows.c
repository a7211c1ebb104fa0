/* Memory and entry point of a library for Windows that needs only kernel32.dll. */

#include <stddef.h>
#include <stdlib.h>

#define ZEROED 8U

void *__stdcall GetProcessHeap(void);
void *__stdcall HeapAlloc(void *heap, unsigned long flags, size_t size);
int __stdcall HeapFree(void *heap, unsigned long flags, void *memory);

void *calloc(size_t count, size_t size)
{
    return HeapAlloc(GetProcessHeap(), ZEROED, count * size);
}

void free(void *memory)
{
    if (memory != NULL) {
        (void)HeapFree(GetProcessHeap(), 0UL, memory);
    }
}

int __stdcall DllMainCRTStartup(void *library, unsigned long reason, void *reserved)
{
    (void)library;
    (void)reason;
    (void)reserved;
    return 1;
}
