/* tff_profile.h: plays the optimal force profile of the design, sample by sample.
 *
 * Scenario "robot finger: polymer tendon on six 30 degree arcs", hash 6b567c7d1473e421, level presliding.
 * Written by tendonff VERSION export-c --precision double --prefix tff.
 * The licence of tendonff does not cover what it writes: this file is yours.
 */
#ifndef TFF_PROFILE_H
#define TFF_PROFILE_H

#include "tff_limits.h"

#ifdef __cplusplus
extern "C" {
#endif

#define TFF_PROFILE_LENGTH 4001

/* State; owned by the caller. */
typedef struct {
    tff_output output;
    uint32_t index; /* of the sample that the next step plays */
} tff_profile;

/* Before the sample at t = 0. */
void tff_profile_init(tff_profile *self);

/* Force [N] of the next sample, from t = 0 on; after the last one it stays, with the status ENDED. */
tff_real tff_profile_step(tff_profile *self);

/* Force [N] of a sample; beyond the end that of the last one. */
tff_real tff_profile_at(uint32_t index);

#ifdef __cplusplus
}
#endif

#endif
