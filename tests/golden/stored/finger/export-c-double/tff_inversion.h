/* tff_inversion.h: one step of the exact inverse, for the sources that run it.
 *
 * Scenario "robot finger: polymer tendon on six 30 degree arcs", hash 6b567c7d1473e421, level presliding.
 * Written by tendonff VERSION export-c --precision double --prefix tff.
 * The licence of tendonff does not cover what it writes: this file is yours.
 * The element laws are printed from the symbolic models with the parameters of this transmission folded in.
 */
#ifndef TFF_INVERSION_H
#define TFF_INVERSION_H

#include "tff_state.h"

/* Rate of elongation [m/s] of a taut link that carries a given force. */
static void tff_inverse_link_rate(
    const tff_weights *w, double force, double start, double *rate)
{
    const double t0 = start - force;
    const double t1 = t0 / w->link_rate_1;
    const double t2 = -t1;
    *rate = t2;
}

/* Velocity of an end mass [m/s] for a given tension. */
static void tff_inverse_far_velocity(
    const tff_weights *w, double f, double v_base, double q_base, double *v)
{
    const double t0 = w->far_velocity_1 * v_base;
    const double t1 = 3000.0 * q_base;
    const double t2 = f - t1;
    const double t3 = t0 + t2;
    const double t4 = t3 / w->far_velocity_2;
    *v = t4;
}

/* Motor force [N] that gives an end mass its velocity. */
static void tff_inverse_near_force(
    const tff_weights *w, double v, double f, double v_base, double *f_c)
{
    const double t0 = v - v_base;
    const double t1 = w->near_force_1 * t0;
    const double t2 = -f;
    const double t3 = 5.0 * v;
    const double t4 = t2 - t3;
    const double t5 = t1 - t4;
    const double t6 = t5 / (-1.0);
    const double t7 = -t6;
    *f_c = t7;
}

/* Near tension of a mass [N], and its states. */
static void tff_inverse_path_mass_inverse(
    const tff_weights *w, double v, double f_far, double v_base, double f_s_base, double piece_adhesion_N, double friction_mu_dynamic_pull, double friction_mu_dynamic_release, double *f_near, double *f_s)
{
    const double t0 = 0.16666666666666666 * v;
    const double t1 = f_far + t0;
    const double t2 = v - v_base;
    const double t3 = w->path_mass_inverse_1 * t2;
    const double t4 = t1 + t3;
    const double t5 = f_far + t4;
    const double t6 = piece_adhesion_N + piece_adhesion_N;
    const double t7 = t5 + t6;
    const double t8 = fabs(v);
    const double t9 = (0.0 <= v) ? friction_mu_dynamic_pull : friction_mu_dynamic_release;
    const double t10 = t8 / t9;
    const double t11 = 8333.3333333333321 * t10;
    const double t12 = w->link_start_3 * t11;
    const double t13 = t7 + t12;
    const double t14 = 8333.3333333333321 * v;
    const double t15 = w->link_start_3 * t14;
    const double t16 = f_s_base + t15;
    const double t17 = t13 - t16;
    const double t18 = t17 / 2.0;
    const double t19 = t7 * t16;
    const double t20 = t18 * t18;
    const double t21 = t20 + t19;
    const double t22 = (0.0 < t21) ? t21 : 0.0;
    const double t23 = sqrt(t22);
    const double t24 = t23 + t18;
    const double t25 = (1.0000000000000001e-09 < t24) ? t24 : 1.0000000000000001e-09;
    const double t26 = t19 / t25;
    const double t27 = t23 - t18;
    const double t28 = (0.0 < t18) ? t26 : t27;
    const double t29 = t4 + t28;
    const double t30 = (0.0 < t29) ? t29 : 0.0;
    *f_near = t30;
    *f_s = t28;
}

/* ---- exact inverse: the force whose response is a given output tension ---- */

/* One step of the scheme, backwards along the chain; x and x_old are the state now and one step earlier, `least`
 * receives the smallest tension on the path. */
static double tff_inverse_invert_step(
    const tff_weights *rows, double reference, int fresh, double piece_adhesion_N, double friction_mu_dynamic_pull, double friction_mu_dynamic_release, double *x, double *x_old, double *least)
{
    const tff_weights *const c = &rows[2 * ((fresh != 0) ? 0 : 1)];
    const int n = TFF_STATE_COUNT;
    const double carry = c->carry;
    double start;
    double rate;
    double v;
    double f = reference;
    double f_c;
    double low = reference;
    int i = n;

    {
        const double v_now = x[n + 1];
        const double v_base = v_now + (carry * (v_now - x_old[n + 1]));
        const double q_now = x[((4 * n) + 5)];
        const double q_base = q_now + (carry * (q_now - x_old[((4 * n) + 5)]));
        tff_inverse_far_velocity(c, f, v_base, q_base, &v);
        x_old[n + 1] = v_now;
        x_old[((4 * n) + 5)] = q_now;
        x[((4 * n) + 5)] = q_base + (c->H * v);
        x[n + 1] = v;
    }
    {
        const double e_now = x[(n + 2) + n];
        const double e_base = e_now + (carry * (e_now - x_old[(n + 2) + n]));
        const double z_now = x[((2 * n) + 3) + n];
        const double z_base = z_now + (carry * (z_now - x_old[((2 * n) + 3) + n]));
        x_old[(n + 2) + n] = e_now;
        x_old[((2 * n) + 3) + n] = z_now;
        tff_link_start((&c[1]), e_base, z_base, &start);
        tff_inverse_link_rate((&c[1]), f, start, &rate);
        tff_link_states((&c[1]), rate, e_base, z_base, &x[(n + 2) + n], &x[((2 * n) + 3) + n]);
        v += rate;
}
    do {
        double near_f;
        const double v_now = x[i];
        const double v_base = v_now + (carry * (v_now - x_old[i]));
        double *const f_s = &x[((3 * n) + 4) + (i - 1)];
        const double f_s_base = *f_s + (carry * (*f_s - x_old[((3 * n) + 4) + (i - 1)]));
        x_old[i] = v_now;
        x_old[((3 * n) + 4) + (i - 1)] = *f_s;
        tff_inverse_path_mass_inverse(c, v, f, v_base, f_s_base, piece_adhesion_N, friction_mu_dynamic_pull, friction_mu_dynamic_release, &near_f, f_s);
        x[i] = v;
        f = near_f;
        low = (f < low) ? f : low;
        i--;
        if (i > 0) {
            const double e_now = x[(n + 2) + i];
            const double e_base = e_now + (carry * (e_now - x_old[(n + 2) + i]));
            const double z_now = x[((2 * n) + 3) + i];
            const double z_base = z_now + (carry * (z_now - x_old[((2 * n) + 3) + i]));
            x_old[(n + 2) + i] = e_now;
            x_old[((2 * n) + 3) + i] = z_now;
            tff_link_start(c, e_base, z_base, &start);
            tff_inverse_link_rate(c, f, start, &rate);
            tff_link_states(c, rate, e_base, z_base, &x[(n + 2) + i], &x[((2 * n) + 3) + i]);
            v += rate;
}
    } while (i > 0);
    {
        const double e_now = x[(n + 2) + i];
        const double e_base = e_now + (carry * (e_now - x_old[(n + 2) + i]));
        const double z_now = x[((2 * n) + 3) + i];
        const double z_base = z_now + (carry * (z_now - x_old[((2 * n) + 3) + i]));
        x_old[(n + 2) + i] = e_now;
        x_old[((2 * n) + 3) + i] = z_now;
        tff_link_start((&c[1]), e_base, z_base, &start);
        tff_inverse_link_rate((&c[1]), f, start, &rate);
        tff_link_states((&c[1]), rate, e_base, z_base, &x[(n + 2) + i], &x[((2 * n) + 3) + i]);
        v += rate;
}
    {
        const double v_now = x[0];
        const double v_base = v_now + (carry * (v_now - x_old[0]));
        const double q_now = x[((4 * n) + 4)];
        const double q_base = q_now + (carry * (q_now - x_old[((4 * n) + 4)]));
        tff_inverse_near_force(c, v, f, v_base, &f_c);
        x_old[0] = v_now;
        x_old[((4 * n) + 4)] = q_now;
        x[((4 * n) + 4)] = q_base + (c->H * v);
        x[0] = v;
    }
    *least = low;
    return f_c;
}

#endif
