/* tff_limits.c: see tff_limits.h.
 *
 * Scenario "robot finger: polymer tendon on six 30 degree arcs", hash f3d8b61dd5010fb8, level presliding.
 * Written by tendonff VERSION export-c --precision double --prefix tff.
 */
#include "tff_limits.h"

#define TFF_LARGEST_N 1e+30

void tff_output_init(tff_output *self, tff_real force)
{
    tff_real start = force;

    start = (start < TFF_FORCE_MIN_N) ? TFF_FORCE_MIN_N : start;
    start = (start > TFF_FORCE_MAX_N) ? TFF_FORCE_MAX_N : start;
    self->force = start;
    self->status = TFF_OK;
    self->seen = TFF_OK;
}

tff_real tff_output_hold(tff_output *self, uint32_t why)
{
    self->status = why;
    self->seen |= why;
    return self->force;
}

tff_real tff_output_set(tff_output *self, tff_real wanted)
{
    const tff_real low = self->force - TFF_CHANGE_MAX_N;
    const tff_real high = self->force + TFF_CHANGE_MAX_N;
    tff_real force = self->force;
    uint32_t status = TFF_FAILED;

    if (wanted > TFF_FORCE_MAX_N) {
        if (wanted <= TFF_LARGEST_N) {
            force = TFF_FORCE_MAX_N;
            status = TFF_FORCE_LIMITED;
        }
    } else if (wanted >= TFF_FORCE_MIN_N) {
        force = wanted; /* the usual case */
        status = TFF_OK;
    } else if (wanted >= -TFF_LARGEST_N) {
        force = TFF_FORCE_MIN_N;
        status = TFF_FORCE_LIMITED;
    } else {
        /* not a number, or minus infinity */
    }
    if (force < low) {
        force = low;
        status |= TFF_RATE_LIMITED;
    } else if (force > high) {
        force = high;
        status |= TFF_RATE_LIMITED;
    } else {
        /* within the rate */
    }
    self->force = force;
    self->status = status;
    self->seen |= status;
    return force;
}
