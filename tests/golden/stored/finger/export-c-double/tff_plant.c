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
    tff_state_rest(self->x, self->x_old, tension);
    self->tension = tension;
    self->force = tension;
    self->fresh = 2;
    self->evaluations = 0;
}

/* A step of the chain. */
static void tff_plant_advance(tff_plant *self, tff_real force)
{
    const tff_chain_input now = { force, 0.0, 0 };

    if (tff_chain_advance(&now, (self->fresh != 0) ? 1 : 0, self->x, self->x_old, &self->tension, &self->evaluations) != 0) {
        self->fresh = 0;
        self->force = force;
        if (self->tension <= 0.0) {
            self->status = TFF_WOULD_PUSH;
        }
    } else { /* stopped where it was before this step: from rest the next one has a solution */
        int32_t j;
        for (j = 0; j < TFF_PLANT_REALS; j++) {
            self->x[j] = (j <= (TFF_PLANT_COUNT + 1)) ? 0.0 : self->x_old[j];
        }
        self->fresh = 1;
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
        if ((self->fresh == 2) && (tff_is_within(force, self->force, self->force) != 0)) {
            self->fresh = 1; /* the sample at t = 0: at rest */
        } else {
            tff_plant_advance(self, force);
        }
    }
    self->seen |= self->status;
    return self->tension;
}

tff_real tff_plant_actuator_position(const tff_plant *self)
{
    return self->x[TFF_PLANT_REALS - 2];
}

tff_real tff_plant_load_position(const tff_plant *self)
{
    return self->x[TFF_PLANT_REALS - 1];
}
