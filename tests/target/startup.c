/* Start of a bare Cortex-M image under QEMU: memory, FPU, main, and main's value as exit status by semihosting. */
#include <stdint.h>

extern uint32_t data_start, data_end, data_load, bss_start, bss_end, stack_top;
int main(void);

static long semihost(long operation, const void *argument)
{
    register long r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = argument;
    __asm__ volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

void target_write(const char *text)
{
    (void)semihost(0x04, text); /* SYS_WRITE0: QEMU prints on standard error */
}

static void leave(uint32_t status)
{
    const uint32_t block[2] = { 0x20026u, status }; /* application exit */
    (void)semihost(0x20, block);
    for (;;) {
    }
}

static void fault(void)
{
    target_write("fault\n");
    leave(99u);
}

void reset(void)
{
    uint32_t *from = &data_load;
    uint32_t *to;
    for (to = &data_start; to < &data_end; to++) {
        *to = *from++;
    }
    for (to = &bss_start; to < &bss_end; to++) {
        *to = 0u;
    }
    *(volatile uint32_t *)0xE000ED88u |= 0xFu << 20; /* CPACR: FPU on */
    __asm__ volatile("dsb\n isb");
    leave((uint32_t)main());
}

__attribute__((section(".vectors"), used)) static const void *const vectors[16] = {
    &stack_top, (void *)reset, (void *)fault, (void *)fault, (void *)fault, (void *)fault, (void *)fault,
};
