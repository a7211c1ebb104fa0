/* Vectors and start of a Cortex-M with a floating-point unit, as QEMU's MPS2 boards emulate it. */

#include <stdint.h>

#define STACK_TOP 0x20400000u
#define CPACR (*(volatile uint32_t *)0xE000ED88u)

extern void _mainCRTStartup(void);
void reset(void);
void fault(void);

__attribute__((section(".vectors"), used)) void (*const vectors[])(void) = {
    (void (*)(void))STACK_TOP, reset, fault, fault, fault, fault, fault};

void fault(void)
{
    for (;;) {
    }
}

void reset(void)
{
    CPACR |= 0xFu << 20; /* the floating-point unit */
    __asm volatile("dsb\n isb");
    _mainCRTStartup();
}

void _init(void) {}
void _fini(void) {}
