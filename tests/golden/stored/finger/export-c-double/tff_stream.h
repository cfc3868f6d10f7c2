/* tff_stream.h: force for a reference that arrives live, sample by sample.
 *
 * Scenario "robot finger: polymer tendon on six 30 degree arcs", hash 6b567c7d1473e421, level presliding.
 * Written by tendonff VERSION export-c --precision double --prefix tff.
 * The licence of tendonff does not cover what it writes: this file is yours.
 * The reference is clamped to a range (the scenario's and a margin, or what `use` says), held where it is not a number, led back smoothly when it arrives again, freed of
 * the last bit by a deadband, smoothed by a symmetric filter with the same lag for all frequencies, and handed to the
 * exact inverse, whose force stays within the limits of force and rate.
 */
#ifndef TFF_STREAM_H
#define TFF_STREAM_H

#include "tff_inverse.h"

#ifdef __cplusplus
extern "C" {
#endif

/* What arrives is this far behind what was passed [s]. Negative: the caller passes the reference that much ahead. */
#define TFF_STREAM_LAG_S 0.012

#define TFF_STREAM_TAPS 25
#define TFF_STREAM_LINE 25

/* Half of the width of the deadband [N]. */
#define TFF_STREAM_BAND_N 0.0

/* State; owned by the caller. */
typedef struct {
    tff_output output;
    tff_inverse inverse;
    tff_real line[TFF_STREAM_LINE]; /* what has arrived, as a ring [N] */
    tff_entry entry; /* last reference, and the way back to one that was lost */
    tff_real low;    /* references are clamped to [N] */
    tff_real high;
    tff_real centre; /* of the deadband [N] */
    int32_t newest;       /* place in the ring */
    tff_real passed;  /* reference of the last call [N] */
} tff_stream;

/* At rest under a uniform tension [N]. */
void tff_stream_init(tff_stream *self, tff_real initial_tension);

/* In motion: under this output tension [N] while the actuator applies this force [N]. */
void tff_stream_init_at(tff_stream *self, tff_real tension, tff_real force);

/* So many calls were missed: the next one leads back to the reference instead of jumping. */
void tff_stream_missed(tff_stream *self, int32_t samples);

/* Other parameters from the next sample on, as tff_inverse_use. */
int32_t tff_stream_use(tff_stream *self, const tff_parameters *given);

/* Force [N], within the actuator's limits, for the reference tension [N] that has just arrived. One outside the range is
 * clamped, one that is not a number holds the last one; both set INPUT_HELD. */
tff_real tff_stream_step(tff_stream *self, tff_real reference);

/* The same for any time since the last call [s]: the samples that fit into it, with the reference on a straight line between
 * the last one and this; what is left counts with the next call, so that what is returned is less than a sample old. After a
 * pause, longer than TFF_STEP_MAX_S, it leads back to the reference as after missed calls. */
tff_real tff_stream_step_dt(tff_stream *self, tff_real dt_s, tff_real reference);

#ifdef __cplusplus
}
#endif

#endif
