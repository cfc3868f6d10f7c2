/* The tuner in a closed loop that was recorded: the largest difference to what
 * the host's Python said [nN], where the others write a hash, with markers round each call for the counter. */
#include <stdint.h>

#include "tff_adaptive.h"

#include "bench.h"
#include "reference.h"
#include "measured.h"

static tff_adaptive adaptive;
static volatile tff_real answer; /* volatile: the compiler moves no other work between the markers */

int main(void)
{
    double largest = 0.0;
    int k;

    tff_adaptive_init(&adaptive, START_N);
    for (k = 0; k < ROWS; k++) {
        double difference;

        mark_begin();
        mark_end();
        mark_begin();
#ifdef TFF_JOINTS
        answer = tff_adaptive_step(&adaptive, reference[k], measured[k], joints[k]);
#else
        answer = tff_adaptive_step(&adaptive, reference[k], measured[k]);
#endif
        mark_end();
        difference = (double)answer - expected[k];
        difference = (difference < 0.0) ? -difference : difference;
        largest = (difference <= largest) ? largest : difference; /* this way round NaN counts as largest */
    }
    target_write("hash ");
    write_hex((largest < 1e3) ? (uint64_t)(1e9 * largest) : UINT64_MAX);
    target_write("\n");
    return 0;
}
