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

/* Time step of the tendon chain: two end masses, N masses on the path, N + 1 links.
 *
 * Positive is towards the actuator (pulling); tensions are positive. SI units throughout.
 * State x: v, e, z, f_s, q_a, q_l.
 */

typedef struct {
    int converged;            /* 0: the step failed */
    double residual_N;
    long iterations;          /* linear solves, accumulated */
    long evaluations;         /* of the balances, accumulated */
    long most;                /* of these, after which a step fails */
} tff_chain_report;

/* Work area of one step, on the stack. */
typedef struct {
    double base[((4 * TFF_CHAIN_COUNT) + 6)];
    double start[TFF_CHAIN_COUNT + 1];
    double force[TFF_CHAIN_COUNT + 1];
    double slope[TFF_CHAIN_COUNT + 1];
    double new_f_s[TFF_CHAIN_COUNT];
    double v[TFF_CHAIN_COUNT + 2];
    double trial[TFF_CHAIN_COUNT + 2];
    double residual[TFF_CHAIN_COUNT + 2];
    double lower[TFF_CHAIN_COUNT + 2];
    double diag[TFF_CHAIN_COUNT + 2];
    double upper[TFF_CHAIN_COUNT + 2];
    double move[TFF_CHAIN_COUNT + 2];
    double middle; /* reciprocal pivot where both ends meet */
} tff_chain_work;


/* Advance by a sample. Returns 1, then `tension` is the one at the far end [N], or 0 where there is no
 * solution, then the state is as before. `evaluations` of the balances are added up. */
int32_t tff_chain_advance(tff_state *self, const tff_chain_input *input, tff_real *tension, int32_t *evaluations);

#ifdef __cplusplus
}
#endif

#endif
