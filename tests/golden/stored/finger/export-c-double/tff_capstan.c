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
    tff_real tension = initial_tension;
    uint32_t status = TFF_OK;

    if (tff_is_within(tension, TFF_REFERENCE_MIN_N, TFF_REFERENCE_MAX_N) == 0) {
        tension = (tension > TFF_REFERENCE_MAX_N) ? TFF_REFERENCE_MAX_N : TFF_REFERENCE_MIN_N;
        status = TFF_INPUT_HELD;
    }
    tff_output_init(&self->output, tension);
    self->output.status = status;
    self->output.seen = status;
    self->last = tension;
    self->wanted = tension;
    tff_entry_init(&self->entry, tension);
    self->waiting = 0.0;
    self->pull = 1.8744560875853382;
    self->release = 0.53348809109110329;
    self->adhesion = 0.0;
}

void tff_capstan_init_at(tff_capstan *self, tff_real tension, tff_real force)
{
    tff_capstan_init(self, tension);
    if (tff_is_within(force, TFF_FORCE_MIN_N, TFF_FORCE_MAX_N) == 0) {
        self->output.status |= TFF_INPUT_HELD;
        self->output.seen |= TFF_INPUT_HELD;
    } else {
        self->entry.last = force;
        self->wanted = force;
        self->output.force = force;
        if (tff_is_within(force, self->last, self->last) == 0) {
            tff_capstan_missed(self, TFF_RE_ENTRY); /* what is measured is not what is wanted: led there */
        }
    }
}

void tff_capstan_missed(tff_capstan *self, int32_t samples)
{
    tff_entry_lose(&self->entry, samples);
}

int32_t tff_capstan_use(tff_capstan *self, const tff_parameters *given)
{
    const int32_t good = tff_parameters_are_good(given);

    if (good != 0) {
        self->pull = exp(given->mu_pull * 3.1415926535897931);
        self->release = exp(-given->mu_release * 3.1415926535897931);
        self->adhesion = given->adhesion;
        tff_output_use(&self->output, given);
    }
    return good;
}

/* A step, as long as the rate limit was set for. */
static tff_real tff_capstan_after(tff_capstan *self, tff_real reference)
{
    tff_real force;

    if (tff_is_within(reference, TFF_REFERENCE_MIN_N, TFF_REFERENCE_MAX_N) == 0) {
        tff_entry_lose(&self->entry, 1);
        force = tff_output_hold(&self->output, tff_held(reference));
    } else {
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
        force = tff_output_set(&self->output, tff_entry_take(&self->entry, self->wanted));
    }
    return force;
}

tff_real tff_capstan_step(tff_capstan *self, tff_real reference)
{
    return (self->waiting > 0.0) ? tff_capstan_step_dt(self, TFF_STEP_S, reference) : tff_capstan_after(self, reference);
}

tff_real tff_capstan_step_dt(tff_capstan *self, tff_real dt_s, tff_real reference)
{
    const tff_real samples = tff_samples(&self->waiting, dt_s);
    const int32_t missed = tff_paused(samples);
    tff_real force;

    if (samples > 0.0) {
        const tff_real length = (missed > 0) ? 1.0 : samples;
        const tff_real change = tff_stretch(&self->output, length);

        tff_capstan_missed(self, missed);
        force = tff_capstan_after(self, reference);
        tff_resume(&self->output, &self->entry, change, length);
    } else {
        force = tff_output_hold(&self->output, (tff_is_within(dt_s, 0.0, TFF_STEP_MIN_S) != 0) ? TFF_OK : TFF_INPUT_HELD);
    }
    return force;
}
