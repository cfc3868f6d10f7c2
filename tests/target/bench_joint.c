/* One joint over a course: commands of some samples, with markers round each call for the counter. */
#include <stdint.h>
#include <string.h>

#include "bench.h"
#include "tff_joint.h"
#include "reference.h"

static tff_joint module;

int main(void)
{
    uint64_t hash = 0u;
    int k;

    if (tff_joint_init(&module, 0, reference[0], 0) != 1) {
        return 1;
    }
    for (k = 0; k < ROWS; k++) {
        uint64_t bits = 0u;
        int j;

        mark_begin();
        mark_end();
        mark_begin();
        (void)tff_joint_step(&module, reference[k], 0);
        mark_end();
        memcpy(&bits, &module.command_rad[0], sizeof module.command_rad[0]);
        hash = (hash ^ bits) * UINT64_C(0x100000001b3);
        for (j = 0; (j < 4) && ((k % 50) == 0); j++) { /* a row of four words is what the reader takes */
            write_hex(bits);
        }
        if ((k % 50) == 0) {
            target_write("\n");
        }
    }
    target_write("hash ");
    write_hex(hash);
    target_write("\n");
    return 0;
}
