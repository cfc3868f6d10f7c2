/* One module over a course: its bits as a hash, with markers round each call for the counter. MODULE is its name. */
#include <stdint.h>
#include <string.h>

#include "bench.h"
#include "module.h"
#include "reference.h"

#ifdef TFF_JOINTS
#include "joints.h"
#define JOINTS_OF(k) , joints[k]
#else
#define JOINTS_OF(k)
#endif
#define JOINED(name, end) tff_##name##end
#define NAMED(name, end) JOINED(name, end)

static NAMED(MODULE, ) module;
static volatile tff_real answer; /* volatile: the compiler moves no other work between the markers */

int main(void)
{
    uint64_t hash = 0u;
    int k;

    NAMED(MODULE, _init)(&module, reference[0]);
    for (k = 0; k < ROWS; k++) {
        uint64_t bits = 0u;
        tff_real kept;

        mark_begin();
        mark_end();
        mark_begin();
        answer = NAMED(MODULE, _step)(&module, reference[k] JOINTS_OF(k));
        mark_end();
        kept = answer;
        memcpy(&bits, &kept, sizeof kept);
        hash = (hash ^ bits) * UINT64_C(0x100000001b3);
        hash ^= hash >> 29;
    }
    target_write("hash ");
    write_hex(hash);
    target_write("\n");
    return 0;
}
