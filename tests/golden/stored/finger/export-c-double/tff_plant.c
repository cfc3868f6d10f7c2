/* tff_plant.c: see tff_plant.h.
 *
 * Scenario "robot finger: polymer tendon on six 30 degree arcs", hash 6b567c7d1473e421, level presliding.
 * Written by tendonff VERSION export-c --precision double --prefix tff.
 * The licence of tendonff does not cover what it writes: this file is yours.
 */
#include "tff_plant.h"

#define TFF_PLANT_INPUT_MAX_N 1000000.0

void tff_plant_init(tff_plant *self, tff_real initial_tension)
{
    const tff_real tension = tff_tension_of(initial_tension, 0.0, TFF_PLANT_INPUT_MAX_N, TFF_REFERENCE_MIN_N, &self->status);

    self->seen = self->status;
    tff_state_init(&self->chain, tension);
    self->tension = tension;
    self->evaluations = 0;
}

/* A step of the chain. */
static void tff_plant_advance(tff_plant *self, tff_real force)
{
    const tff_chain_input now = { force, 0.0, 0 };

    if (tff_chain_advance(&self->chain, &now, &self->tension, &self->evaluations) != 0) {
        if (self->tension <= 0.0) {
            self->status = TFF_WOULD_PUSH;
        }
    } else {
        tff_state_stop(&self->chain);
        self->status = TFF_FAILED;
    }
}

tff_real tff_plant_step(tff_plant *self, tff_real force)
{
    self->status = TFF_OK;
    self->evaluations = 0;
    if (tff_is_within(force, -TFF_PLANT_INPUT_MAX_N, TFF_PLANT_INPUT_MAX_N) == 0) {
        self->status = TFF_INPUT_HELD;
    } else {
        if (tff_state_begins(&self->chain, force, self->tension) == 0) {
            tff_plant_advance(self, force);
        }
    }
    self->seen |= self->status;
    return self->tension;
}

tff_real tff_plant_actuator_position(const tff_plant *self)
{
    return self->chain.x[TFF_PLANT_REALS - 2];
}

tff_real tff_plant_load_position(const tff_plant *self)
{
    return self->chain.x[TFF_PLANT_REALS - 1];
}
