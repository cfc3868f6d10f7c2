/* What every bench shares: where text goes, how numbers are written, and the markers that the instruction counter looks for. */
#ifndef BENCH_H
#define BENCH_H

#include <stdint.h>

#ifdef HOST
#include <stdio.h>
static void target_write(const char *text)
{
    fputs(text, stderr);
}
#else
void target_write(const char *text);
#endif

static inline void write_hex(uint64_t value)
{
    char text[18];
    int i;
    for (i = 0; i < 16; i++) {
        text[i] = "0123456789abcdef"[(value >> (60 - 4 * i)) & 15u];
    }
    text[16] = ' ';
    text[17] = '\0';
    target_write(text);
}

__attribute__((noinline)) void mark_begin(void)
{
    __asm__ volatile("");
}

__attribute__((noinline)) void mark_end(void)
{
    __asm__ volatile("");
}

#endif
