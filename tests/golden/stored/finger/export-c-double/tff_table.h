/* tff_table.h: force from the compensation table tff_table_data.h.
 *
 * Scenario "robot finger: polymer tendon on six 30 degree arcs", hash 6b567c7d1473e421, level presliding.
 * Written by tendonff VERSION export-c --precision double --prefix tff.
 * The licence of tendonff does not cover what it writes: this file is yours.
 * The branch and the tension travelled since the last reversal come from the reference alone, never from a measured
 * velocity. Bilinear in the reference and in (tension since the reversal)/(reference + p). A reversal out of an
 * unfinished transition goes on where the new branch has the present force.
 */
#ifndef TFF_TABLE_H
#define TFF_TABLE_H

#include "tff_limits.h"

#ifdef __cplusplus
extern "C" {
#endif

/* References that the table covers [N]. */
#define TFF_TABLE_MIN_N 12.375091876668819
#define TFF_TABLE_MAX_N 48.648805148730055

/* State; owned by the caller. */
typedef struct {
    tff_output output;
    tff_real last;   /* reference of the last sample [N] */
    tff_real wanted; /* force before the limits [N] */
    tff_real turn;   /* where the reference turned, or would have to have turned [N] */
    tff_real ratio;  /* (force + p)/(reference + p) before the limits [-] */
    tff_entry entry; /* last reference, and the way back to one that was lost */
    int32_t branch;       /* 1 pull, -1 release, 0 not moved yet */
} tff_table;

/* At rest under a uniform tension [N]. */
void tff_table_init(tff_table *self, tff_real initial_tension);

/* In motion: output tension and force of the actuator as they are now [N]. The force goes on from there. */
void tff_table_init_at(tff_table *self, tff_real tension, tff_real force);

/* So many calls were missed: the next one leads back to the reference instead of jumping. */
void tff_table_missed(tff_table *self, int32_t samples);

/* Other limits from the next sample on; 0 where the parameters are not good and nothing changes. Both kinds of friction are
 * in the table: those of the record are not looked at. */
int32_t tff_table_use(tff_table *self, const tff_parameters *given);

/* Force [N], within the actuator's limits, for the next reference tension [N]. */
tff_real tff_table_step(tff_table *self, tff_real reference);

/* The same for any time since the last call [s]: a step of its own up to TFF_STEP_MAX_S. After a pause, which is longer,
 * it leads back to the reference as after missed calls; a time that is no number holds the last good output. */
tff_real tff_table_step_dt(tff_table *self, tff_real dt_s, tff_real reference);

#ifdef __cplusplus
}
#endif

#endif
