/* tff_limits.h: the actuator's limits, and the last good output when there is none.
 *
 * Scenario "robot finger: polymer tendon on six 30 degree arcs", hash 6b567c7d1473e421, level presliding.
 * Written by tendonff VERSION export-c --precision double --prefix tff.
 * The licence of tendonff does not cover what it writes: this file is yours.
 */
#ifndef TFF_LIMITS_H
#define TFF_LIMITS_H

#include "tff_parameters.h"

#ifdef __cplusplus
extern "C" {
#endif

/* 1 where low <= value <= high, 0 elsewhere and for NaN. */
static inline int32_t tff_is_within(tff_real value, tff_real low, tff_real high)
{
    return ((value >= low) && (value <= high)) ? 1 : 0;
}

/* Memory of a play (backlash) operator that is pushed along between two values. */
static inline tff_real tff_play(tff_real memory, tff_real least, tff_real most)
{
    const tff_real raised = (memory > least) ? memory : least;

    return (raised < most) ? raised : most;
}

/* Status of a value that is not taken: RANGE for a number, INPUT_HELD for what is none. */
static inline uint32_t tff_held(tff_real value)
{
    return (tff_is_within(value, -1e+30, 1e+30) != 0) ? TFF_RANGE : TFF_INPUT_HELD;
}

/* Output of a compensator; owned by the caller as part of the compensator's record. */
typedef struct {
    tff_real force; /* last good output [N] */
    uint32_t status;     /* bits of the last step */
    uint32_t seen;       /* bits since init */
    tff_real low;    /* limits in force [N], never wider than the scenario's */
    tff_real high;
    tff_real change; /* largest change per sample [N] */
} tff_output;

/* Start from a force [N]. */
void tff_output_init(tff_output *self, tff_real force);

/* Other limits from the next sample on; the last output is led inside them at the rate that they state. Returns 0 where
 * the record is not good: then nothing changes. */
int32_t tff_output_use(tff_output *self, const tff_parameters *given);

/* Samples that a time since the last call [s] makes, to which what waited is added: 0 for one that is no number, negative,
 * or too short for a step of its own, which waits for the next one. */
tff_real tff_samples(tff_real *waiting, tff_real dt_s);

/* Whole samples of a pause, for `missed`; 0 for what is none. */
int32_t tff_paused(tff_real samples);

/* Pass a wanted force [N] through the force and rate limits; what is not finite holds the last good output. */
tff_real tff_output_set(tff_output *self, tff_real wanted);

/* Hold the last good output and say why. */
tff_real tff_output_hold(tff_output *self, uint32_t why);

/* A reference that may be lost for a while, or arrive at any time; owned by the caller as part of a record. */
typedef struct {
    tff_real last;   /* what was followed last [N] */
    tff_real held;   /* where the way back started [N] */
    tff_real span;   /* samples of the way back */
    tff_real left;   /* those that are left */
    tff_real waiting; /* time too short for a step of its own [s] */
    int32_t lost;         /* samples for which nothing good has arrived */
} tff_entry;

/* Samples of the way back to a reference that arrives again: so many for each that was lost, and at most. */
#define TFF_RE_ENTRY_SHARE 2
#define TFF_RE_ENTRY 100

/* Start from a reference [N]. */
void tff_entry_init(tff_entry *self, tff_real reference);

/* Nothing good has arrived for so many samples. */
void tff_entry_lose(tff_entry *self, int32_t samples);

/* What is to be followed [N]: the reference, or on the way back to it a course without a jump in velocity and
 * acceleration from where it was lost. */
tff_real tff_entry_take(tff_entry *self, tff_real reference);

/* A tension [N] in a range; another one, flagged, for what is none. */
tff_real tff_tension_of(tff_real given, tff_real low, tff_real high, tff_real otherwise, uint32_t *status);

/* Start of a module: a tension [N] beyond a range is replaced by its nearer end, and flagged. */
tff_real tff_begin(tff_output *output, tff_entry *entry, tff_real initial_tension, tff_real low, tff_real high);

/* Start in motion: the last force [N], which is led to what is wanted unless it is that of the rest [N]. Returns 0, flagged,
 * for one that no actuator gives. */
int32_t tff_begin_at(tff_output *output, tff_entry *entry, tff_real rest, tff_real force);

/* A reference [N] that is not taken: the last good output. */
tff_real tff_lose(tff_output *output, tff_entry *entry, tff_real reference);

/* A step of any length, or a pause. */
typedef struct {
    tff_real samples; /* length of the step; 0: there is none, and the output holds */
    tff_real change;  /* that the rate allows in one sample [N] */
    int32_t missed;         /* samples of a pause before it */
} tff_pause;

/* A time since the last call [s] as one step, after missed calls where it was a pause; the rate allows as much more. */
tff_pause tff_pause_of(tff_output *output, tff_entry *entry, tff_real dt_s);

/* After that step: rate and way back are what they were. Returns the output. */
tff_real tff_resume(tff_output *output, tff_entry *entry, const tff_pause *pause, tff_real answer);

/* A time since the last call [s] as whole samples, one after the other. */
typedef struct {
    tff_real dt_s;
    tff_real rest;  /* share of the way that is left from here to what is passed now */
    int32_t samples;      /* to come; -1: the time is no number */
    int32_t missed;       /* samples of a pause before them */
    tff_real left;  /* time that waits for the next call [s] */
} tff_span;

/* What is left waits in the entry. */
tff_span tff_span_of(tff_entry *entry, tff_real dt_s);

/* On to the next sample: 0 where none is to come. */
int32_t tff_span_next(tff_span *self);

/* What to follow with that share left. */
tff_real tff_on_the_way(tff_real reference, tff_real before, tff_real rest);

#ifdef __cplusplus
}
#endif

#endif
