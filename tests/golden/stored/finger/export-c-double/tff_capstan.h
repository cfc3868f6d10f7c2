/* tff_capstan.h: static inverse of the capstan law on the branch of the reference's last change.
 *
 * Scenario "robot finger: polymer tendon on six 30 degree arcs", hash 6b567c7d1473e421, level presliding.
 * Written by tendonff VERSION export-c --precision double --prefix tff.
 * The licence of tendonff does not cover what it writes: this file is yours.
 * (force + p) = (reference + p) e^{+mu theta} while the reference rises, e^{-mu theta} while it falls, p the load-independent friction.
 */
#ifndef TFF_CAPSTAN_H
#define TFF_CAPSTAN_H

#include "tff_limits.h"

#ifdef __cplusplus
extern "C" {
#endif

/* State; owned by the caller. */
typedef struct {
    tff_output output;
    tff_real last;   /* reference of the last sample [N] */
    tff_real wanted; /* force before the limits [N] */
    tff_real pull;     /* e^{mu theta}, pulling */
    tff_real release;  /* e^{-mu theta}, releasing */
    tff_real adhesion; /* p [N] */
    tff_entry entry;   /* last force asked for, and the way back to the law's after the reference was lost */
} tff_capstan;

/* At rest under a uniform tension [N]. */
void tff_capstan_init(tff_capstan *self, tff_real initial_tension);

/* In motion: output tension and force of the actuator as they are now [N]. The force goes on from there. */
void tff_capstan_init_at(tff_capstan *self, tff_real tension, tff_real force);

/* So many calls were missed: the force is led to that of the law instead of jumping. */
void tff_capstan_missed(tff_capstan *self, int32_t samples);

/* Other parameters from the next sample on; 0 where they are not good and nothing changes. A change of friction is a jump
 * of the force while the reference moves, as fast as force_rate_max lets it. */
int32_t tff_capstan_use(tff_capstan *self, const tff_parameters *given);

/* Force [N], within the actuator's limits, for the next reference tension [N]. */
tff_real tff_capstan_step(tff_capstan *self, tff_real reference);

/* The same for any time since the last call [s]: a step of its own up to TFF_STEP_MAX_S. After a pause, which is longer,
 * it leads back to the reference as after missed calls; a time that is no number holds the last good output. */
tff_real tff_capstan_step_dt(tff_capstan *self, tff_real dt_s, tff_real reference);

#ifdef __cplusplus
}
#endif

#endif
