/* tff_inverse.h: the force whose response on the chain is a given output tension.
 *
 * Scenario "robot finger: polymer tendon on six 30 degree arcs", hash 6b567c7d1473e421, level presliding.
 * Written by tendonff VERSION export-c --precision double --prefix tff.
 * The licence of tendonff does not cover what it writes: this file is yours.
 * Exact inverse of the presliding chain with 6 masses: closed form, causal, no iteration, the same work in
 * every call but the first. Scheme: second-order backward differences, implicit Euler in the first step.
 */
#ifndef TFF_INVERSE_H
#define TFF_INVERSE_H

#include "tff_state.h"

#ifdef __cplusplus
extern "C" {
#endif

#define TFF_INVERSE_COUNT TFF_STATE_COUNT
#define TFF_INVERSE_REALS TFF_STATE_REALS

/* What a mass's law takes from tff_parameters: equivalent coefficients [-] and load-independent friction [N]. */
typedef struct {
    tff_real piece_adhesion_N;
    tff_real friction_mu_dynamic_pull;
    tff_real friction_mu_dynamic_release;
} tff_inverse_numbers;

/* State; owned by the caller. */
typedef struct {
    tff_output output;
    tff_state chain;
    tff_real start;     /* tension at rest before the first sample [N] */
    tff_real least;     /* smallest tension on the path [N] */
    tff_entry entry;    /* last reference, and the way back to one that was lost */
    tff_inverse_numbers own;
    tff_real mu;        /* mu_dynamic when pulling [-] */
    tff_real adhesion;  /* [N] */
    tff_real samples;   /* length of the last step, in samples */
} tff_inverse;

/* At rest under a uniform tension [N]. One outside the accepted range is replaced by its nearest end and flagged. */
void tff_inverse_init(tff_inverse *self, tff_real initial_tension);

/* In motion: under this output tension [N] while the actuator applies this force [N], as after a restart or another
 * controller. The difference is taken for friction as far as friction can hold it, and the force is led to the reference
 * as after a reference that was lost; where force and tension are the same, it is a start at rest. */
void tff_inverse_init_at(tff_inverse *self, tff_real tension, tff_real force);

/* So many calls were missed while the actuator held its force: the next one leads back to the reference instead of jumping. */
void tff_inverse_missed(tff_inverse *self, int32_t samples);

/* Force [N], within the actuator's limits, for the reference tension [N] at the end of this sample. The first call may
 * repeat the initial tension (the sample at t = 0) or give the first sample after it. */
tff_real tff_inverse_step(tff_inverse *self, tff_real reference);

/* The same for any time since the last call [s]: a step of its own up to TFF_STEP_MAX_S. After a pause, which is longer,
 * it leads back to the reference as after missed calls; a time that is no number holds the last good output. */
tff_real tff_inverse_step_dt(tff_inverse *self, tff_real dt_s, tff_real reference);

/* Other parameters from the next sample on; 0 where they are not good and nothing changes. The states stay: a change of
 * friction moves the force as fast as the tendon slides. Init goes back to the scenario's. */
int32_t tff_inverse_use(tff_inverse *self, const tff_parameters *given);

/* The same with another mu_dynamic [-] alone: all coefficients of friction go by the same factor. Values that mean
 * nothing change nothing. Keep what tff_inverse_mu says to start from it again. */
void tff_inverse_set_mu(tff_inverse *self, tff_real mu_dynamic);
tff_real tff_inverse_mu(const tff_inverse *self);

#ifdef __cplusplus
}
#endif

#endif
