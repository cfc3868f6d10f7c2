/* tff_chain.h: a time step of the tendon chain, for the modules that run it forward.
 *
 * Scenario "robot finger: polymer tendon on six 30 degree arcs", hash 6b567c7d1473e421, level presliding.
 * Written by tendonff VERSION export-c --precision double --prefix tff.
 * The licence of tendonff does not cover what it writes: this file is yours.
 * presliding chain with 6 masses, 7 links and the end masses. Implicit steps (second-order backward
 * differences), solved by a tridiagonal Newton iteration with a line search, bounded by 60 evaluations a call.
 */
#ifndef TFF_CHAIN_H
#define TFF_CHAIN_H

#include "tff_state.h"

#ifdef __cplusplus
extern "C" {
#endif

#define TFF_CHAIN_COUNT TFF_STATE_COUNT
#define TFF_CHAIN_REALS TFF_STATE_REALS

/* What acts on the ends. */
typedef struct {
    tff_real near_force_N;
    tff_real far_rest_m;
    int32_t led; /* 1: the force is the tension that a cell at the near end measures; else the actuator's */
} tff_chain_input;

/* Advance by a sample; `fresh`: there is no earlier state. Returns 1, then x_old is what x was and `tension` the one at the
 * far end [N], or 0 where there is no solution, then x is as before. `evaluations` of the balances are added up. */
int32_t tff_chain_advance(const tff_chain_input *input, int32_t fresh, tff_real *x, tff_real *x_old, tff_real *tension, int32_t *evaluations);

#ifdef __cplusplus
}
#endif

#endif
