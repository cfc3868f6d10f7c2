/* One finger over a course: commands of some samples, with markers round each call for the counter. */
#include <stdint.h>
#include <string.h>

#include "bench.h"
#include "tff_finger.h"
#include "course.h"

static tff_finger module;

int main(void)
{
    static const tff_real none[TFF_FINGER_BODIES];
    uint64_t hash = 0u;
    int k;

    if (tff_finger_init(&module, 0, course[0]) != 1) {
        return 1;
    }
    for (k = 0; k < ROWS; k++) {
        int j;

        mark_begin();
        mark_end();
        mark_begin();
        (void)tff_finger_step(&module, course[k], none);
        mark_end();
        for (j = 0; j < 4; j++) { /* a row of four words is what the reader takes */
            uint64_t bits = 0u;
            memcpy(&bits, &module.command_rad[j], sizeof module.command_rad[0]);
            hash = (hash ^ bits) * UINT64_C(0x100000001b3);
            if ((k % 20) == 0) {
                write_hex(bits);
            }
        }
        if ((k % 20) == 0) {
            target_write("\n");
        }
    }
    target_write("hash ");
    write_hex(hash);
    target_write("\n");
    return 0;
}
