/* tff_profile.c: see tff_profile.h.
 *
 * Scenario "robot finger: polymer tendon on six 30 degree arcs", hash 6b567c7d1473e421, level presliding.
 * Written by tendonff VERSION export-c --precision double --prefix tff.
 * The licence of tendonff does not cover what it writes: this file is yours.
 */
#include "tff_profile.h"

tff_real tff_profile_at(uint32_t index)
{
    /* Force at 0, 0.001 s, ... [N]. */
    static const tff_real profile[TFF_PROFILE_LENGTH] = { NUMBERS };

    return profile[(index < (uint32_t)TFF_PROFILE_LENGTH) ? index : ((uint32_t)TFF_PROFILE_LENGTH - 1u)];
}

void tff_profile_init(tff_profile *self)
{
    tff_output_init(&self->output, tff_profile_at(0u));
    self->index = 0u;
}

tff_real tff_profile_step(tff_profile *self)
{
    self->output.force = tff_profile_at(self->index);
    if (self->index < (uint32_t)TFF_PROFILE_LENGTH) {
        self->index++;
        self->output.status = TFF_OK;
    } else {
        self->output.status = TFF_ENDED;
    }
    self->output.seen |= self->output.status;
    return self->output.force;
}
