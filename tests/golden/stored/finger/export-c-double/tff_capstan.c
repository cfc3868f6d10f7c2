/* tff_capstan.c: see tff_capstan.h.
 *
 * Scenario "robot finger: polymer tendon on six 30 degree arcs", hash 6b567c7d1473e421, level presliding.
 * Written by tendonff VERSION export-c --precision double --prefix tff.
 * The licence of tendonff does not cover what it writes: this file is yours.
 */
#include "tff_capstan.h"

#include <math.h>

void tff_capstan_init(tff_capstan *self, tff_real initial_tension)
{
    const tff_real tension = tff_begin(&self->output, &self->entry, initial_tension, TFF_REFERENCE_MIN_N, TFF_REFERENCE_MAX_N);

    self->last = tension;
    self->wanted = tension;
    self->pull = 1.8744560875853382;
    self->release = 0.53348809109110329;
    self->adhesion = 0.0;
}

void tff_capstan_init_at(tff_capstan *self, tff_real tension, tff_real force)
{
    tff_capstan_init(self, tension);
    if (tff_begin_at(&self->output, &self->entry, self->last, force) != 0) {
        self->entry.last = force;
        self->wanted = force;
    }
}

void tff_capstan_missed(tff_capstan *self, int32_t samples)
{
    tff_entry_lose(&self->entry, samples);
}

int32_t tff_capstan_use(tff_capstan *self, const tff_parameters *given)
{
    const int32_t good = tff_output_use(&self->output, given);

    if (good != 0) {
        self->pull = exp(given->mu_pull * 3.1415926535897931);
        self->release = exp(-given->mu_release * 3.1415926535897931);
        self->adhesion = given->adhesion;
    }
    return good;
}

/* Force for a reference that is accepted. */
static tff_real tff_capstan_take(tff_capstan *self, tff_real reference)
{
    const tff_real lifted = reference + self->adhesion;
    if (reference > self->last) {
        self->wanted = (lifted * self->pull) - self->adhesion;
    } else if (reference < self->last) {
        self->wanted = (lifted * self->release) - self->adhesion;
    } else {
        /* the reference is at rest: so is the force */
    }
    self->last = reference;
    /* The force is led back, not the reference: a way back of the reference may turn round, where the law jumps. */
    return tff_output_set(&self->output, tff_entry_take(&self->entry, self->wanted));
}

/* A step, as long as the rate limit was set for. */
static tff_real tff_capstan_after(tff_capstan *self, tff_real reference)
{
    return (tff_is_within(reference, TFF_REFERENCE_MIN_N, TFF_REFERENCE_MAX_N) != 0) ? tff_capstan_take(self, reference) : tff_lose(&self->output, &self->entry, reference);
}

tff_real tff_capstan_step(tff_capstan *self, tff_real reference)
{
    return (self->entry.waiting > 0.0) ? tff_capstan_step_dt(self, TFF_STEP_S, reference) : tff_capstan_after(self, reference);
}

tff_real tff_capstan_step_dt(tff_capstan *self, tff_real dt_s, tff_real reference)
{
    const tff_pause pause = tff_pause_of(&self->output, &self->entry, dt_s);

    return (pause.samples > 0.0) ? tff_resume(&self->output, &self->entry, &pause, tff_capstan_after(self, reference)) : self->output.force;
}
