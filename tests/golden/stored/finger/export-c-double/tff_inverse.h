/* tff_inverse.h: the force whose response on the chain is a given output tension.
 *
 * Scenario "robot finger: polymer tendon on six 30 degree arcs", hash f3d8b61dd5010fb8, level presliding.
 * Written by tendonff VERSION export-c --precision double --prefix tff.
 * Exact inverse of the presliding chain with 6 masses: closed form, causal, no iteration, the same work in
 * every call but the first. Scheme: second-order backward differences, implicit Euler in the first step.
 */
#ifndef TFF_INVERSE_H
#define TFF_INVERSE_H

#include "tff_limits.h"

#ifdef __cplusplus
extern "C" {
#endif

#define TFF_INVERSE_COUNT 6
#define TFF_INVERSE_REALS 30

/* State; owned by the caller. */
typedef struct {
    tff_output output;
    tff_real x[TFF_INVERSE_REALS];     /* velocity, elongation, relaxed elongation, bristle force, ends */
    tff_real x_old[TFF_INVERSE_REALS]; /* one sample earlier */
    tff_real start;     /* tension at rest before the first sample [N] */
    tff_real least;     /* smallest tension on the path [N] */
    int32_t fresh;           /* 2: no call yet; 1: no sample has moved it; 0: in motion */
} tff_inverse;

/* At rest under a uniform tension [N]. One outside the accepted range is replaced by its nearest end and flagged. */
void tff_inverse_init(tff_inverse *self, tff_real initial_tension);

/* Force [N], within the actuator's limits, for the reference tension [N] at the end of this sample. The first call may
 * repeat the initial tension (the sample at t = 0) or give the first sample after it. */
tff_real tff_inverse_step(tff_inverse *self, tff_real reference);

#ifdef __cplusplus
}
#endif

#endif
