/* What relight.c needs on the emulated boards (see link.ld): vectors, memory as C expects it, a way to speak and to
 * end by semihosting, the stack's high-water mark, and a count of instructions. With `-icount shift=10` an instruction takes 1.024 us of virtual
 * time, which a timer of the board measures. */

#include <stddef.h>
#include <stdint.h>

extern uint32_t data_start[], data_end[], data_load[], bss_start[], bss_end[], stack_top[];

int main(void);

static uint32_t semihost(uint32_t operation, const void *argument) {
    register uint32_t r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = argument;
    __asm__ volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

static void finish(uint32_t status) {
    const uint32_t block[2] = {0x20026, status};
    semihost(0x20, block);
    for (;;) {
    }
}

void say(const char *name, uint32_t value) {
    char digits[13] = "           \n";
    char *next = digits + 11;
    do {
        *--next = (char)('0' + value % 10);
        value /= 10;
    } while (value > 0);
    semihost(0x04, name);
    semihost(0x04, next - 1);
}

#define REGISTER(address) (*(volatile uint32_t *)(uintptr_t)(address))

#ifdef SMALL
/* nRF51 timer 0: 16 MHz, up. */
static void start_timer(void) {
    REGISTER(0x40008510) = 0;
    REGISTER(0x40008508) = 3;
    REGISTER(0x40008504) = 0;
    REGISTER(0x4000800c) = 1;
    REGISTER(0x40008000) = 1;
}

uint32_t instructions(void) {
    REGISTER(0x40008040) = 1;
    return (uint32_t)((uint64_t)REGISTER(0x40008540) * 625 / 10240);
}
#else
/* CMSDK timer 0: 25 MHz, down. */
static void start_timer(void) {
    REGISTER(0x40000000) = 0;
    REGISTER(0x40000008) = UINT32_MAX;
    REGISTER(0x40000004) = UINT32_MAX;
    REGISTER(0x40000000) = 1;
}

uint32_t instructions(void) {
    return (uint32_t)((uint64_t)(UINT32_MAX - REGISTER(0x40000004)) * 10 / 256);
}
#endif

/* What an unused word of the stack holds. */
#define PAINT 0x5ac396e1u

static void paint_stack(void) {
    /* Well below the frames that are in use. */
    const uintptr_t end = (uintptr_t)stack_top - 256;
    for (uintptr_t word = (uintptr_t)bss_end; word < end; word += sizeof(uint32_t))
        REGISTER(word) = PAINT;
}

/* Bytes of the stack that were in use at some time. */
uint32_t largest_stack(void) {
    const volatile uint32_t *word = bss_end;
    while (word < stack_top && *word == PAINT)
        ++word;
    return (uint32_t)((uintptr_t)stack_top - (uintptr_t)word);
}

static void reset(void) {
#ifdef __ARM_FP
    REGISTER(0xe000ed88) |= 0xfu << 20; /* the floating-point unit, before the first float */
    __asm__ volatile("dsb\n\tisb");
#endif
    const uint32_t *from = data_load;
    for (uint32_t *to = data_start; to < data_end; ++to)
        *to = *from++;
    for (uint32_t *to = bss_start; to < bss_end; ++to)
        *to = 0;
    paint_stack();
    start_timer();
    finish((uint32_t)main());
}

static void fault(void) { finish(102); }

__attribute__((section(".vectors"), used)) static void (*const vectors[16])(void) = {
    (void (*)(void))stack_top, reset, fault, fault, fault, fault, fault, fault, fault, fault, fault, fault,
    fault, fault, fault, fault};
