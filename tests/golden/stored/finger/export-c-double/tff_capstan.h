/* tff_capstan.h: static inverse of the capstan law on the branch of the reference's last change.
 *
 * Scenario "robot finger: polymer tendon on six 30 degree arcs", hash f3d8b61dd5010fb8, level presliding.
 * Written by tendonff VERSION export-c --precision double --prefix tff.
 * (force + p) = (reference + p) e^{+mu theta} while the reference rises, e^{-mu theta} while it falls, p the adhesion.
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
} tff_capstan;

/* At rest under a uniform tension [N]. */
void tff_capstan_init(tff_capstan *self, tff_real initial_tension);

/* Force [N], within the actuator's limits, for the next reference tension [N]. */
tff_real tff_capstan_step(tff_capstan *self, tff_real reference);

#ifdef __cplusplus
}
#endif

#endif
