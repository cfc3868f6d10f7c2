/* Every module over one course of references; the same source on the host and on the emulated controller.
 *
 * Prints a hash of all bits of each module's answers, and every SHOWN-th answer by its bits. `reference.h` is made by
 * the test and holds the course. Markers stand round each call for the instruction counter, an empty pair first.
 */
#include <math.h>
#include <stdint.h>
#include <string.h>

#include "tff_capstan.h"
#include "tff_inverse.h"
#include "tff_observer.h"
#include "tff_plant.h"
#include "tff_table.h"

#include "bench.h"
#include "reference.h"

#define SHOWN 25
#define MODULES 5

static uint64_t bits_of(tff_real value)
{
    uint64_t bits = 0u;
    memcpy(&bits, &value, sizeof value); /* little endian on every target here */
    return bits;
}

static tff_inverse inverse;
static tff_capstan capstan;
static tff_table table;
static tff_plant plant;
static tff_observer observer;

int main(void)
{
    uint64_t hash[MODULES] = { 0 };
    tff_real answer[MODULES];
    int k, m;

    tff_inverse_init(&inverse, reference[0]);
    tff_capstan_init(&capstan, reference[0]);
    tff_table_init(&table, reference[0]);
    tff_plant_init(&plant, reference[0]);
    tff_observer_init(&observer, reference[0]);
    for (k = 0; k < ROWS; k++) {
        mark_begin();
        mark_end();
        mark_begin();
        answer[0] = tff_inverse_step(&inverse, reference[k]);
        mark_end();
        mark_begin();
        answer[1] = tff_capstan_step(&capstan, reference[k]);
        mark_end();
        mark_begin();
        answer[2] = tff_table_step(&table, reference[k]);
        mark_end();
        mark_begin();
        answer[3] = tff_plant_step(&plant, answer[0]);
        mark_end();
        mark_begin();
        answer[4] = tff_observer_step(&observer, answer[0], (tff_real)NAN);
        mark_end();
        for (m = 0; m < MODULES; m++) {
            hash[m] = (hash[m] ^ bits_of(answer[m])) * UINT64_C(0x100000001b3);
            hash[m] ^= hash[m] >> 29;
        }
        if ((k % SHOWN) == 0) {
            for (m = 0; m < MODULES; m++) {
                write_hex(bits_of(answer[m]));
            }
            target_write("\n");
        }
    }
    target_write("hash ");
    for (m = 0; m < MODULES; m++) {
        write_hex(hash[m]);
    }
    target_write("\n");
    return 0;
}
