/* tff_observer.h: output tension from what the near end measures.
 *
 * Scenario "robot finger: polymer tendon on six 30 degree arcs", hash 6b567c7d1473e421, level presliding.
 * Written by tendonff VERSION export-c --precision double --prefix tff.
 * The licence of tendonff does not cover what it writes: this file is yours.
 * presliding chain with 6 masses, forward: the measured input tension pulls its near end.
 * From the measured position of the near end it follows a far end that something else moves.
 * By the capstan law the output tension lies between `low` and `high` for all time and for any input, if mu theta of each
 * direction is within 20 % of the scenario's value and the far end moves with the tendon only: this is proven. What the
 * capstan law leaves out takes a margin of 9.6 % of the tension: the largest that simulated plants of 40 masses
 * need along the scenario's reference, with stiffness 20 % lower and higher. After lost samples, and while something else
 * moves the far end, they are what any history admits.
 */
#ifndef TFF_OBSERVER_H
#define TFF_OBSERVER_H

#include "tff_chain.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Input tensions that are accepted [N]: one below zero counts as zero. */
#define TFF_OBSERVER_INPUT_MAX_N 453.56031211648468

/* One more status bit: something else than the tendon has moved the far end. */
#define TFF_OBSERVER_FAR_MOVED 512u

#define TFF_OBSERVER_COUNT TFF_CHAIN_COUNT
#define TFF_OBSERVER_REALS TFF_CHAIN_REALS

/* What is known; owned by the caller as part of the record. */
typedef struct {
    tff_real tension; /* output tension [N], last good one */
    tff_real low;     /* bounds of it [N] */
    tff_real high;
    uint32_t status;       /* bits of the last step */
    uint32_t seen;         /* bits since init */
} tff_observed;

/* State; owned by the caller. */
typedef struct {
    tff_observed output;
    tff_state chain;
    tff_real home;    /* near end of the chain where the measured position is 0 [m] */
    tff_real start;   /* input tension there [N] */
    tff_real far;     /* how far something else has moved the far end's spring [m] */
    tff_entry entry;  /* last input tension, and the way back to one that was lost */
    tff_real force;   /* input tension that the chain is under [N] */
    tff_real low_memory;  /* plays that enclose the output, in tension plus load-independent friction [N] */
    tff_real high_memory;
    int32_t blind;         /* the history is not known */
    int32_t homed;         /* 0: the next position says where the near end is */
    int32_t evaluations;   /* of the balances, in the last step */
} tff_observer;

/* At rest under a uniform tension [N]. */
void tff_observer_init(tff_observer *self, tff_real initial_tension);

/* In motion: under this output tension [N] while the input tension [N] is that, as after a restart. Where the output is
 * not known it is NaN: then `low` and `high` are what any history admits, until the tendon has slid. */
void tff_observer_init_at(tff_observer *self, tff_real output_tension, tff_real input_tension);

/* So many calls were missed: the next one leads to the input instead of jumping, and the bounds forget the history. */
void tff_observer_missed(tff_observer *self, int32_t samples);

/* Output tension [N] at the end of a sample, at which the near end has this tension [N] and position relative to the start
 * at rest [m], NaN where it is not measured; then `low` and `high` in `output`. The first call may repeat the initial
 * tension (the sample at t = 0). */
tff_real tff_observer_step(tff_observer *self, tff_real input_tension, tff_real input_position);

/* The same for any time since the last call [s]: as many steps as fit, the rest waits. A longer one than
 * TFF_STEP_MAX_S is a pause; a time that is no number holds the last good output. */
tff_real tff_observer_step_dt(tff_observer *self, tff_real dt_s, tff_real input_tension, tff_real input_position);

#ifdef __cplusplus
}
#endif

#endif
