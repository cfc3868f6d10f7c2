/* What every bench shares: where text goes, and the markers that the instruction counter looks for. */
#ifndef BENCH_H
#define BENCH_H

#ifdef HOST
#include <stdio.h>
static void target_write(const char *text)
{
    fputs(text, stderr);
}
#else
void target_write(const char *text);
#endif

__attribute__((noinline)) void mark_begin(void)
{
    __asm__ volatile("");
}

__attribute__((noinline)) void mark_end(void)
{
    __asm__ volatile("");
}

#endif
