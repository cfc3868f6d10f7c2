/* tff_limits.h: the actuator's limits, and the last good output when there is none.
 *
 * Scenario "robot finger: polymer tendon on six 30 degree arcs", hash f3d8b61dd5010fb8, level presliding.
 * Written by tendonff VERSION export-c --precision double --prefix tff.
 */
#ifndef TFF_LIMITS_H
#define TFF_LIMITS_H

#include "tff_types.h"

#ifdef __cplusplus
extern "C" {
#endif

/* 1 where low <= value <= high, 0 elsewhere and for NaN. */
static inline int32_t tff_is_within(tff_real value, tff_real low, tff_real high)
{
    return ((value >= low) && (value <= high)) ? 1 : 0;
}

/* Output of a compensator; owned by the caller as part of the compensator's record. */
typedef struct {
    tff_real force; /* last good output [N] */
    uint32_t status;     /* bits of the last step */
    uint32_t seen;       /* bits since init */
} tff_output;

/* Start from a force [N]. */
void tff_output_init(tff_output *self, tff_real force);

/* Pass a wanted force [N] through the force and rate limits; what is not finite holds the last good output. */
tff_real tff_output_set(tff_output *self, tff_real wanted);

/* Hold the last good output and say why. */
tff_real tff_output_hold(tff_output *self, uint32_t why);


#ifdef __cplusplus
}
#endif

#endif
