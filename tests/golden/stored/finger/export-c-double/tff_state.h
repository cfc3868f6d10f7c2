/* tff_state.h: the state of the tendon chain at rest and as motion left it, and what its schemes share.
 *
 * Scenario "robot finger: polymer tendon on six 30 degree arcs", hash 6b567c7d1473e421, level presliding.
 * Written by tendonff VERSION export-c --precision double --prefix tff.
 * The licence of tendonff does not cover what it writes: this file is yours.
 * presliding chain with 6 masses, 7 links and the end masses. Velocities, elongations, relaxed elongations,
 * states of friction, positions of the ends.
 */
#ifndef TFF_STATE_H
#define TFF_STATE_H

#include "tff_limits.h"

#include <math.h>

#ifdef __cplusplus
extern "C" {
#endif

#define TFF_STATE_COUNT 6
#define TFF_STATE_REALS 30

/* What depends on the weight H [s] of the scheme: two rows for the first step (implicit Euler), two for
 * every later step (second-order backward differences; `carry` is the share of the last change in the base),
 * and two for each halving of a step, where there are any: for inner links, and for those at the ends, which
 * are half as long. Fields are named after the law that needs them. */
typedef struct {
    double H;
    double carry;
    double link_start_1;
    double link_start_2;
    double link_start_3;
    double link_start_4;
    double link_rate_1;
    double far_velocity_1;
    double far_velocity_2;
    double near_force_1;
    double path_mass_inverse_1;
    double end_mass_near_1;
    double end_mass_cell_1;
    double path_mass_2;
} tff_weights;

extern const tff_weights tff_rows[4];

/* A link's force at zero rate of elongation, before slack [N], eqs. (6), (7). */
static inline void tff_link_start(
    const tff_weights *w, double e_base, double z_base, double *start)
{
    const double t0 = w->link_start_1 * e_base;
    const double t1 = e_base / 0.40000000000000002;
    const double t2 = w->link_start_3 * t1;
    const double t3 = z_base + t2;
    const double t4 = t3 / w->link_start_4;
    const double t5 = e_base - t4;
    const double t6 = w->link_start_2 * t5;
    const double t7 = t0 + t6;
    *start = t7;
}

/* Elongation of a link and its own states at the end of the step. */
static inline void tff_link_states(
    const tff_weights *w, double rate, double e_base, double z_base, double *e, double *z)
{
    const double t0 = w->link_start_3 * rate;
    const double t1 = e_base + t0;
    *e = t1;
    const double t2 = t1 / 0.40000000000000002;
    const double t3 = w->link_start_3 * t2;
    const double t4 = z_base + t3;
    const double t5 = t4 / w->link_start_4;
    *z = t5;
}

/* Tridiagonal equations of a time step: the largest balance, the first that is no number where there is one;
 * the matrix factorised in place; and the move that the factors give. */
tff_real tff_largest(int rows, const tff_real *residual);
void tff_factorise(int rows, tff_real *lower, tff_real *diag, tff_real *upper, tff_real *middle);
void tff_newton_move(
    int rows, const tff_real *residual, const tff_real *lower, const tff_real *diag, const tff_real *upper, tff_real middle, tff_real *move);

/* State of a chain; owned by the caller as part of a record. */
typedef struct {
    tff_real x[TFF_STATE_REALS];     /* velocity, elongation, relaxed elongation, bristle force, ends */
    tff_real x_old[TFF_STATE_REALS]; /* one sample earlier */
    int32_t fresh;         /* 2: no call yet; 1: no sample has moved it; 0: in motion */
} tff_state;

/* At rest under a uniform tension [N]. */
void tff_state_init(tff_state *self, tff_real tension);

/* After a step without a solution: stopped where it was before it, from where the next one has one. */
void tff_state_stop(tff_state *self);

/* Returns 1 in the first call where the input is that of the rest: the sample at t = 0, in which nothing moves. */
static inline int32_t tff_state_begins(tff_state *self, tff_real input, tff_real rest)
{
    int32_t begins = 0;

    if ((self->fresh == 2) && (tff_is_within(input, rest, rest) != 0)) {
        self->fresh = 1;
        begins = 1;
    }
    return begins;
}

/* States at rest under a uniform tension [N]. */
void tff_state_rest(tff_real *x, tff_real *x_old, tff_real tension);

/* In motion: friction of each mass, when the end is pulled by a force [N] and the output is under the tension at rest [N]. */
void tff_state_rub(tff_real *x, tff_real *x_old, tff_real rest, tff_real force);

/* The same, and each link stretched by the tension that it has then. */
void tff_state_carry(tff_real *x, tff_real *x_old, tff_real rest, tff_real force);

#ifdef __cplusplus
}
#endif

#endif
