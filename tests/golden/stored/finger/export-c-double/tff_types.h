/* tff_types.h: what the files of this folder share.
 *
 * Scenario "robot finger: polymer tendon on six 30 degree arcs", hash 6b567c7d1473e421, level presliding.
 * Written by tendonff VERSION export-c --precision double --prefix tff.
 * The licence of tendonff does not cover what it writes: this file is yours.
 * Units are SI: N, m, s. One call of a step function is one sample of 0.001 s, or the time that the caller states.
 */
#ifndef TFF_TYPES_H
#define TFF_TYPES_H

#include <stdint.h>

#ifdef __FAST_MATH__
#error "compile without -ffast-math: the guards against NaN need it to be recognised"
#endif
#if defined(__FINITE_MATH_ONLY__) && (__FINITE_MATH_ONLY__ > 0)
#error "compile without -ffinite-math-only: it removes the guards against NaN"
#endif

typedef double tff_real;

/* Sample time [s], and the reference tensions that are accepted [N]; others hold the last good output. */
#define TFF_STEP_S 0.001
#define TFF_REFERENCE_MIN_N 0.14023897025398877
#define TFF_REFERENCE_MAX_N 106.69761821822065

/* Times between two calls that are one step [s]: a shorter one is counted with the next, a longer one is a pause. */
#define TFF_STEP_MIN_S 0.00050000000000000001
#define TFF_STEP_MAX_S 0.029999999999999999

/* The actuator's limits [N], and the largest change per sample [N]. */
#define TFF_FORCE_MIN_N 0.0
#define TFF_FORCE_MAX_N 200.0
#define TFF_CHANGE_MAX_N 100.0

/* Status bits of the last step; `seen` in each record gathers them since init. */
#define TFF_OK 0u
#define TFF_INPUT_HELD 1u    /* no finite number: last good output held, state untouched; or a joint angle that jumped */
#define TFF_FORCE_LIMITED 2u /* force_min or force_max binds */
#define TFF_RATE_LIMITED 4u  /* the force rate limit binds */
#define TFF_WOULD_PUSH 8u    /* the reference falls faster than the tendon can follow, or a link is slack */
#define TFF_FAILED 16u       /* no finite or no converged result: last good output held */
#define TFF_ENDED 32u        /* the end of the profile was reached */
#define TFF_RANGE 1024u      /* a number outside the accepted range (another unit?): held like INPUT_HELD */
#define TFF_HELD (TFF_INPUT_HELD | TFF_RANGE)

#endif
