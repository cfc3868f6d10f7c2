/* tff_capstan.c: see tff_capstan.h.
 *
 * Scenario "robot finger: polymer tendon on six 30 degree arcs", hash f3d8b61dd5010fb8, level presliding.
 * Written by tendonff VERSION export-c --precision double --prefix tff.
 */
#include "tff_capstan.h"

#define TFF_PULL_RATIO 1.8744560875853382    /* e^{mu theta}, pulling */
#define TFF_RELEASE_RATIO 0.53348809109110329 /* e^{-mu theta}, releasing */
#define TFF_ADHESION_N 0.0

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
}

tff_real tff_capstan_step(tff_capstan *self, tff_real reference)
{
    tff_real force;

    if (tff_is_within(reference, TFF_REFERENCE_MIN_N, TFF_REFERENCE_MAX_N) == 0) {
        force = tff_output_hold(&self->output, TFF_INPUT_HELD);
    } else {
        const tff_real lifted = reference + TFF_ADHESION_N;
        if (reference > self->last) {
            self->wanted = (lifted * TFF_PULL_RATIO) - TFF_ADHESION_N;
        } else if (reference < self->last) {
            self->wanted = (lifted * TFF_RELEASE_RATIO) - TFF_ADHESION_N;
        } else {
            /* the reference stands still: so does the force */
        }
        self->last = reference;
        force = tff_output_set(&self->output, self->wanted);
    }
    return force;
}
