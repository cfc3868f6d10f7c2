/* tff_chain.c: see tff_chain.h.
 *
 * Scenario "robot finger: polymer tendon on six 30 degree arcs", hash 6b567c7d1473e421, level presliding.
 * Written by tendonff VERSION export-c --precision double --prefix tff.
 * The licence of tendonff does not cover what it writes: this file is yours.
 * The element laws are printed from the symbolic models with the parameters of this transmission folded in.
 */
#include "tff_chain.h"

/* Tension of a link [N] and its slope over the rate of elongation [N s/m]; a tendon cannot push. */
static void tff_chain_link_force(
    const tff_weights *w, double rate, double start, double *force, double *slope)
{
    const double t0 = w->link_rate_1 * rate;
    const double t1 = start + t0;
    const double t2 = (0.0 < t1) ? t1 : 0.0;
    *force = t2;
    const double t3 = (0.0 < t1) ? w->link_rate_1 : 0.0;
    *slope = t3;
}

/* Balance of a mass on the path [N], its slopes, and the states of its friction, eqs. (4), (5). */
static void tff_chain_path_mass(
    const tff_weights *w, double v, double f_near, double f_far, double v_base, double f_s_base, double *residual, double *by_v, double *by_near, double *by_far, double *f_s)
{
    const double t0 = v - v_base;
    const double t1 = w->path_mass_inverse_1 * t0;
    const double t2 = f_near - f_far;
    const double t3 = 8333.3333333333321 * v;
    const double t4 = w->link_start_3 * t3;
    const double t5 = f_s_base + t4;
    const double t6 = f_near + f_far;
    const double t7 = (1.0000000000000001e-09 < t6) ? t6 : 1.0000000000000001e-09;
    const double t8 = t5 * t7;
    const double t9 = fabs(v);
    const double t10 = t9 / 0.052312080781770152;
    const double t11 = 8333.3333333333321 * t10;
    const double t12 = w->link_start_3 * t11;
    const double t13 = t7 + t12;
    const double t14 = t8 / t13;
    const double t15 = 0.16666666666666666 * v;
    const double t16 = t14 + t15;
    const double t17 = t2 - t16;
    const double t18 = t1 - t17;
    *residual = t18;
    const double t19 = t7 * w->path_mass_2;
    const double t20 = t19 / t13;
    const double t21 = t14 / t13;
    const double t22 = (v > 0.0) ? 1.0 : ((v < 0.0) ? -1.0 : 0.0);
    const double t23 = t22 / 0.052312080781770152;
    const double t24 = 8333.3333333333321 * t23;
    const double t25 = w->link_start_3 * t24;
    const double t26 = t21 * t25;
    const double t27 = t20 - t26;
    const double t28 = t27 + 0.16666666666666666;
    const double t29 = w->path_mass_inverse_1 + t28;
    *by_v = t29;
    const double t30 = t5 / t13;
    const double t31 = t30 - t21;
    const double t32 = -t31;
    const double t33 = (1.0000000000000001e-09 < t6) ? t32 : 0.0;
    const double t34 = 1.0 + t33;
    const double t35 = -t34;
    *by_near = t35;
    const double t36 = (-1.0) + t33;
    const double t37 = -t36;
    *by_far = t37;
    *f_s = t14;
}

/* Balance of an end mass [N] and its slopes over velocity and tension; pull: -1 near, +1 far end. */
static void tff_chain_end_mass_near(
    const tff_weights *w, double v, double f, double v_base, double f_c, double *residual, double *by_v, double *by_f)
{
    const double t0 = v - v_base;
    const double t1 = w->near_force_1 * t0;
    const double t2 = f - f_c;
    const double t3 = -t2;
    const double t4 = 5.0 * v;
    const double t5 = t3 - t4;
    const double t6 = t1 - t5;
    *residual = t6;
    *by_v = w->end_mass_near_1;
    *by_f = 1.0;
}

/* Balance of an end mass [N] and its slopes over velocity and tension; pull: -1 near, +1 far end. */
static void tff_chain_end_mass_far(
    const tff_weights *w, double v, double f, double v_base, double q_base, double x_c, double *residual, double *by_v, double *by_f)
{
    const double t0 = v - v_base;
    const double t1 = w->far_velocity_1 * t0;
    const double t2 = 8.0 * v;
    const double t3 = f - t2;
    const double t4 = w->link_start_3 * v;
    const double t5 = q_base + t4;
    const double t6 = t5 - x_c;
    const double t7 = 3000.0 * t6;
    const double t8 = t3 - t7;
    const double t9 = t1 - t8;
    *residual = t9;
    *by_v = w->far_velocity_2;
    *by_f = (-1.0);
}

/* Balance of an end mass [N] and its slopes over velocity and tension; pull: -1 near, +1 far end. */
static void tff_chain_end_mass_cell(
    const tff_weights *w, double v, double f, double v_base, double f_c, double *residual, double *by_v, double *by_f)
{
    const double t0 = v - v_base;
    const double t1 = w->end_mass_cell_1 * t0;
    const double t2 = f - f_c;
    const double t3 = -t2;
    const double t4 = t1 - t3;
    *residual = t4;
    *by_v = w->end_mass_cell_1;
    *by_f = 1.0;
}

/* ---- time step: generated from the element laws above ---- */

#define TFF_CHAIN_MAX_ITERATIONS 20
#define TFF_CHAIN_MAX_HALVINGS 10
#define TFF_CHAIN_MAX_EVALUATIONS 60 /* of the balances in one call, whatever happens */

/* Link forces at zero rate of elongation. */
static void tff_chain_link_starts(const tff_weights *given, int n, const double *base, double *start)
{
    int i;
    const tff_weights *const c = given;
    (void)c;
    for (i = 1; i < n; i++) {
        tff_link_start(c, base[(n + 2) + i], base[((2 * n) + 3) + i], &start[i]);
    }
    for (i = 0; i <= n; i += n) {
        tff_link_start((&c[1]), base[(n + 2) + i], base[((2 * n) + 3) + i], &start[i]);
    }
}

/* Elongations and the links' own states at the end of a step whose velocities are known. */
static void tff_chain_link_ends(
    const tff_weights *given, int n, const double *v, const double *base, double *e,
    double *z)
{
    int i;
    const tff_weights *const c = given;
    (void)c;
    for (i = 1; i < n; i++) {
        tff_link_states(c, v[i] - v[i + 1], base[(n + 2) + i], base[((2 * n) + 3) + i], &e[i], &z[i]);
    }
    for (i = 0; i <= n; i += n) {
        tff_link_states((&c[1]), v[i] - v[i + 1], base[(n + 2) + i], base[((2 * n) + 3) + i], &e[i], &z[i]);
    }
}

/* Balances, slopes and the frictions' own states of the masses on the path. */
static void tff_chain_path_slopes(
    const tff_weights *given, int n, const double *v, const double *base,
    const double *force, const double *slope, double *residual, double *lower,
    double *diag, double *upper, double *new_f_s)
{
    int i;
    const tff_weights *const c = given;
    (void)c;
    for (i = 1; i <= n; i++) {
        double by_v;
        double by_near;
        double by_far;
        tff_chain_path_mass(c, v[i], force[i - 1], force[i], base[i], base[((3 * n) + 4) + (i - 1)], &residual[i], &by_v, &by_near, &by_far, &new_f_s[i - 1]);
        lower[i] = by_near * slope[i - 1];
        diag[i] = (by_v - (by_near * slope[i - 1])) + (by_far * slope[i]);
        upper[i] = -by_far * slope[i];
    }
}

/* Tensions of the links and their slopes, for velocities v. */
static void tff_chain_tensions(const tff_weights *given, int n, const double *v, tff_chain_work *w)
{
    int i;
    const tff_weights *const c = given;
    (void)c;
    for (i = 1; i < n; i++) {
        tff_chain_link_force(c, v[i] - v[i + 1], w->start[i], &w->force[i], &w->slope[i]);
    }
    for (i = 0; i <= n; i += n) {
        tff_chain_link_force((&c[1]), v[i] - v[i + 1], w->start[i], &w->force[i], &w->slope[i]);
    }
}

/* Balances of the end masses; `by` receives their slopes over velocity and tension, near and far. */
static void tff_chain_end_balances(
    const tff_weights *c, const tff_chain_input *u, int n, const double *v, tff_chain_work *w, double *by)
{
    (void)c;
    if (u->led != 0) {
        tff_chain_end_mass_cell(c, v[0], w->force[0], w->base[0], u->near_force_N, &w->residual[0], &by[0], &by[1]);
    } else {
        tff_chain_end_mass_near(c, v[0], w->force[0], w->base[0], u->near_force_N, &w->residual[0], &by[0], &by[1]);
    }
    tff_chain_end_mass_far(c, v[n + 1], w->force[n], w->base[n + 1], w->base[((4 * n) + 5)], u->far_rest_m, &w->residual[n + 1], &by[2], &by[3]);
}

/* Balances, tensions and the frictions' own states for velocities v, with the tridiagonal matrix of slopes; returns the
 * largest balance. */
static double tff_chain_evaluate(const tff_weights *c, const tff_chain_input *u, int n, const double *v, tff_chain_work *w)
{
    double by[4];

    tff_chain_tensions(c, n, v, w);
    tff_chain_end_balances(c, u, n, v, w, by);
    tff_chain_path_slopes(c, n, v, w->base, w->force, w->slope, w->residual, w->lower, w->diag, w->upper, w->new_f_s);
    w->diag[0] = by[0] + (by[1] * w->slope[0]);
    w->upper[0] = -by[1] * w->slope[0];
    w->lower[n + 1] = by[3] * w->slope[n];
    w->diag[n + 1] = by[2] - (by[3] * w->slope[n]);
    return tff_largest(n + 2, w->residual);
}

/* The same for the step from w->base and the velocities in w->v. */
static double tff_chain_largest_balance(const tff_weights *c, const tff_chain_input *u, int n, tff_chain_work *w)
{
    tff_chain_link_starts(c, n, w->base, w->start);
    return tff_chain_evaluate(c, u, n, w->v, w);
}

/* Largest balance that counts as solved: the rounding of link forces and of momenta adds to the tolerance. */
static double tff_chain_tolerance(const tff_weights *c, int n, const tff_chain_work *w)
{
    const double near = fabs(w->base[0]) * 0.14999999999999999;
    const double far = fabs(w->base[n + 1]) * 0.02;
    double momentum = 0.0;
    double largest = fabs(w->start[0]);
    int i;
    for (i = 1; i <= n; i++) {
        const double speed = fabs(w->base[i]);
        const double start = fabs(w->start[i]);
        momentum = (speed > momentum) ? speed : momentum;
        largest = (start > largest) ? start : largest;
    }
    momentum *= 0.00033333333333333332;
    momentum = (near > momentum) ? near : momentum;
    momentum = ((far > momentum) ? far : momentum) / c->H;
    largest = (momentum > largest) ? momentum : largest;
    return 4.9999999999999997e-12 + (largest * 5.0000000000000002e-14);
}

/* Newton's method with a line search, from the velocities in w->v that were evaluated with the balance `norm`; returns
 * the balance that it reached, and `moves` counts its moves. */
static double tff_chain_newton(
    const tff_weights *c, const tff_chain_input *u, int n, double norm, double tolerance, tff_chain_work *w, tff_chain_report *report, int *moves)
{
    double now = norm;
    int i;
    int k;
    int halving;

    for (k = 0; (k < TFF_CHAIN_MAX_ITERATIONS) && !(now <= tolerance) && (report->evaluations < report->most); k++) {
        double t = 1.0;
        double next = now;
        tff_factorise(n + 2, w->lower, w->diag, w->upper, &w->middle);
        tff_newton_move(n + 2, w->residual, w->lower, w->diag, w->upper, w->middle, w->move);
        report->iterations++;
        for (halving = 0; (halving < TFF_CHAIN_MAX_HALVINGS) && (report->evaluations < report->most); halving++) {
            for (i = 0; i <= (n + 1); i++) {
                w->trial[i] = w->v[i] + (t * w->move[i]);
            }
            next = tff_chain_evaluate(c, u, n, w->trial, w);
            report->evaluations++;
            if (next < now) {
                break;
            }
            t *= 0.5;
        }
        if (!(next < now)) {
            break; /* no descent: the caller tries from elsewhere, or gives up */
        }
        now = next;
        for (i = 0; i <= (n + 1); i++) {
            w->v[i] = w->trial[i];
        }
    }
    *moves = k;
    return now;
}

/* One implicit step from w->base; w->v holds the guess and receives the velocities. */
static void tff_chain_solve(const tff_weights *c, const tff_chain_input *u, int n, tff_chain_work *w, tff_chain_report *report)
{
    double norm;
    double tolerance;
    int moves;

    norm = tff_chain_largest_balance(c, u, n, w);
    tolerance = tff_chain_tolerance(c, n, w);
    report->evaluations++;
    norm = tff_chain_newton(c, u, n, norm, tolerance, w, report, &moves);
    report->converged = 0;
    if (norm <= tolerance) {
        report->converged = 1;
    }
    report->residual_N = norm;
}

/* Write the end of a solved step into x. */
static void tff_chain_finish(const tff_weights *c, int n, const tff_chain_work *w, double *x)
{
    int i;
    tff_chain_link_ends(c, n, w->v, w->base, &x[(n + 2)], &x[((2 * n) + 3)]);
    for (i = 0; i < n; i++) {
        x[((3 * n) + 4) + i] = w->new_f_s[i];
    }
    x[((4 * n) + 4)] = w->base[((4 * n) + 4)] + (c->H * w->v[0]);
    x[((4 * n) + 5)] = w->base[((4 * n) + 5)] + (c->H * w->v[n + 1]);
    for (i = 0; i <= (n + 1); i++) {
        x[i] = w->v[i];
    }
}

/* Advance x by one step in one piece; where that fails, x is as before. x_old holds the state one step earlier and becomes
 * the state before this step. Second-order backward differences (BDF2, the second row of weights); implicit Euler where
 * there is no earlier state (fresh, the first row). */
static void tff_chain_step(
    const tff_weights *rows, const tff_chain_input *u, int fresh,
    double *x, double *x_old, tff_chain_work *w, tff_chain_report *report)
{
    const tff_weights *c = &rows[2 * ((fresh != 0) ? 0 : 1)];
    const int n = TFF_CHAIN_COUNT;
    const int size = ((4 * n) + 6);
    int guess;
    int j;

    for (j = 0; j <= (n + 1); j++) {
        w->v[j] = x[j] + ((fresh != 0) ? 0.0 : (x[j] - x_old[j]));
    }
    for (j = 0; j < size; j++) {
        w->base[j] = x[j] + (c->carry * (x[j] - x_old[j]));
        x_old[j] = x[j];
    }
    report->converged = 0;
    for (guess = 0; (guess < 2) && (report->converged == 0) && (report->evaluations < report->most); guess++) { /* extrapolated, then at rest */
        for (j = 0; (guess > 0) && (j <= (n + 1)); j++) {
            w->v[j] = 0.0;
        }
        tff_chain_solve(c, u, n, w, report);
    }
    if (report->converged != 0) {
        tff_chain_finish(c, n, w, x);
    }
}

int32_t tff_chain_advance(tff_state *self, const tff_chain_input *input, tff_real *tension, int32_t *evaluations)
{
    tff_chain_work work;
    tff_chain_report report = { 0, 0.0, 0, 0, TFF_CHAIN_MAX_EVALUATIONS };
    int32_t solved = 0;

    tff_chain_step(tff_rows, input, (self->fresh != 0) ? 1 : 0, self->x, self->x_old, &work, &report);
    *evaluations += (int32_t)report.evaluations;
    if (report.converged != 0) {
        *tension = work.force[TFF_CHAIN_COUNT];
        self->fresh = 0;
        solved = 1;
    }
    return solved;
}
