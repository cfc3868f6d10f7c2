/* The inverse on a path that joints move: its bits as a hash, with markers round each call for the counter. */
#include <stdint.h>
#include <string.h>

#include "tff_inverse.h"

#include "bench.h"
#include "reference.h"

#include "joints.h"

static tff_inverse inverse;
static volatile tff_real answer; /* volatile: the compiler moves no other work between the markers */

int main(void)
{
    char text[] = "hash ................\n";
    uint64_t hash = 0u;
    int k;

    tff_inverse_init(&inverse, reference[0]);
    for (k = 0; k < ROWS; k++) {
        uint64_t bits = 0u;
        tff_real kept;

        mark_begin();
        mark_end();
        mark_begin();
#ifdef TFF_JOINTS
        answer = tff_inverse_step(&inverse, reference[k], joints[k]);
#else
        answer = tff_inverse_step(&inverse, reference[k]);
#endif
        mark_end();
        kept = answer;
        memcpy(&bits, &kept, sizeof kept);
        hash = (hash ^ bits) * UINT64_C(0x100000001b3);
        hash ^= hash >> 29;
    }
    for (k = 0; k < 16; k++) {
        text[5 + k] = "0123456789abcdef"[(hash >> (60 - (4 * k))) & 15u];
    }
    target_write(text);
    return 0;
}
