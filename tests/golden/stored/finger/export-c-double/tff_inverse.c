/* tff_inverse.c: see tff_inverse.h.
 *
 * Scenario "robot finger: polymer tendon on six 30 degree arcs", hash 6b567c7d1473e421, level presliding.
 * Written by tendonff VERSION export-c --precision double --prefix tff.
 * The licence of tendonff does not cover what it writes: this file is yours.
 * The element laws are printed from the symbolic models with the parameters of this transmission folded in.
 */
#include "tff_inverse.h"

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
    const int n = TFF_INVERSE_COUNT;
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

/* What depends on the weight H [s] of the scheme. */
static void tff_inverse_weigh(
    double H, double ratio, double *link_start_1, double *link_start_2, double *link_start_3, double *link_start_4, double *link_rate_1, double *far_velocity_1, double *far_velocity_2, double *near_force_1, double *path_mass_inverse_1)
{
    const double t0 = 20000.0 * ratio;
    *link_start_1 = t0;
    const double t1 = 6000.0 * ratio;
    *link_start_2 = t1;
    *link_start_3 = H;
    const double t2 = H / 0.40000000000000002;
    const double t3 = 1.0 + t2;
    *link_start_4 = t3;
    const double t4 = t0 * H;
    const double t5 = H * t2;
    const double t6 = t5 / t3;
    const double t7 = H - t6;
    const double t8 = t1 * t7;
    const double t9 = t4 + t8;
    const double t10 = 2.0 * ratio;
    const double t11 = t9 + t10;
    *link_rate_1 = t11;
    const double t12 = 0.02 / H;
    *far_velocity_1 = t12;
    const double t13 = 3000.0 * H;
    const double t14 = 8.0 + t13;
    const double t15 = t12 + t14;
    *far_velocity_2 = t15;
    const double t16 = 0.14999999999999999 / H;
    *near_force_1 = t16;
    const double t17 = 0.00033333333333333332 / H;
    *path_mass_inverse_1 = t17;
}

/* Rows for a step of another length [s] after one of `before` (0: none is known): backward differences of second order over
 * two steps that differ; implicit Euler after one that is far shorter. */
static void tff_inverse_reweigh(const tff_weights *given, double step_s, double before_s, tff_weights *rows)
{
    double ratio = 0.0;
    double whole;
    if ((before_s * 4.0) >= step_s) {
        ratio = step_s / before_s;
    }
    whole = 1.0 + (ratio + ratio);
    rows[0] = given[0];
    rows[0].carry = (ratio * ratio) / whole;
    rows[0].H = (step_s * (1.0 + ratio)) / whole;
    tff_inverse_weigh(rows[0].H, 6.0, &rows[0].link_start_1, &rows[0].link_start_2, &rows[0].link_start_3, &rows[0].link_start_4, &rows[0].link_rate_1, &rows[0].far_velocity_1, &rows[0].far_velocity_2, &rows[0].near_force_1, &rows[0].path_mass_inverse_1);
    rows[1] = given[1];
    rows[1].carry = (ratio * ratio) / whole;
    rows[1].H = (step_s * (1.0 + ratio)) / whole;
    tff_inverse_weigh(rows[1].H, 12.0, &rows[1].link_start_1, &rows[1].link_start_2, &rows[1].link_start_3, &rows[1].link_start_4, &rows[1].link_rate_1, &rows[1].far_velocity_1, &rows[1].far_velocity_2, &rows[1].near_force_1, &rows[1].path_mass_inverse_1);
}

/* Numbers of one mass over what can be set, eqs. (8), (9). */
static void tff_inverse_settable_numbers(
    double mu_pull, double mu_release, double adhesion, double *piece_adhesion_N, double *friction_mu_dynamic_pull, double *friction_mu_dynamic_release)
{
    *piece_adhesion_N = adhesion;
    const double t0 = 0.52359877559829882 * mu_pull;
    const double t1 = t0 / 2.0;
    const double t2 = tanh(t1);
    const double t3 = (9.9999999999999998e-13 < t2) ? t2 : 9.9999999999999998e-13;
    *friction_mu_dynamic_pull = t3;
    const double t4 = 0.52359877559829882 * mu_release;
    const double t5 = t4 / 2.0;
    const double t6 = tanh(t5);
    const double t7 = (9.9999999999999998e-13 < t6) ? t6 : 9.9999999999999998e-13;
    *friction_mu_dynamic_release = t7;
}

void tff_inverse_init(tff_inverse *self, tff_real initial_tension)
{
    const tff_real tension = tff_begin(&self->output, &self->entry, initial_tension, TFF_REFERENCE_MIN_N, TFF_REFERENCE_MAX_N);

    tff_state_rest(self->x, self->x_old, tension);
    self->start = tension;
    self->least = tension;
    self->fresh = 2;
    self->samples = 0.0;
    self->own.piece_adhesion_N = 0.0;
    self->own.friction_mu_dynamic_pull = 0.052312080781770152;
    self->own.friction_mu_dynamic_release = 0.052312080781770152;
    self->mu = 0.20000000000000001;
    self->adhesion = 0.0;
}

int32_t tff_inverse_use(tff_inverse *self, const tff_parameters *given)
{
    const int32_t good = tff_output_use(&self->output, given);

    if (good != 0) {
        tff_inverse_numbers *const own = &self->own;

        tff_inverse_settable_numbers(given->mu_pull, given->mu_release, given->adhesion, &own->piece_adhesion_N, &own->friction_mu_dynamic_pull, &own->friction_mu_dynamic_release);
        self->mu = given->mu_pull;
        self->adhesion = given->adhesion;
    }
    return good;
}

void tff_inverse_set_mu(tff_inverse *self, tff_real mu_dynamic)
{
    tff_parameters wanted;

    tff_parameters_init(&wanted);
    if ((tff_parameters_set_mu(&wanted, mu_dynamic, mu_dynamic) != 0)
        && (tff_parameters_set_adhesion(&wanted, self->adhesion) != 0)) {
        const tff_output kept = self->output; /* limits stay */

        (void)tff_inverse_use(self, &wanted);
        self->output = kept;
    }
}

tff_real tff_inverse_mu(const tff_inverse *self)
{
    return self->mu;
}

void tff_inverse_init_at(tff_inverse *self, tff_real tension, tff_real force)
{
    tff_inverse_init(self, tension);
    if (tff_begin_at(&self->output, &self->entry, self->start, force) != 0) {
        tff_state_carry(self->x, self->x_old, self->start, force);
    }
}

void tff_inverse_missed(tff_inverse *self, int32_t samples)
{
    tff_entry_lose(&self->entry, samples);
}

/* A step of so many samples. */
static tff_real tff_inverse_after(tff_inverse *self, tff_real samples, tff_real reference)
{
    if (tff_is_within(reference, TFF_REFERENCE_MIN_N, TFF_REFERENCE_MAX_N) == 0) {
        (void)tff_lose(&self->output, &self->entry, reference);
    } else if ((self->fresh == 2) && (tff_is_within(reference, self->start, self->start) != 0)) {
        self->fresh = 1; /* the sample at t = 0: at rest */
        (void)tff_output_set(&self->output, self->output.force);
    } else {
        const tff_real followed = tff_entry_take(&self->entry, reference);
        const tff_weights *rows = tff_rows;
        tff_weights own[2];
        int fresh = 1;
        tff_real exact;

        if (self->fresh == 0) {
            fresh = 0;
        }
        if ((tff_is_within(samples, 1.0, 1.0) == 0) || ((fresh == 0) && (tff_is_within(self->samples, 1.0, 1.0) == 0))) {
            tff_inverse_reweigh(rows, samples * TFF_STEP_S, (fresh != 0) ? 0.0 : (self->samples * TFF_STEP_S), own);
            rows = own;
            fresh = 1; /* the first of these rows */
        }
        exact = tff_inverse_invert_step(
            rows, followed, fresh, self->own.piece_adhesion_N, self->own.friction_mu_dynamic_pull, self->own.friction_mu_dynamic_release, self->x, self->x_old, &self->least);
        self->fresh = 0;
        self->samples = samples;
        (void)tff_output_set(&self->output, exact);
        if (self->least <= 0.0) {
            self->output.status |= TFF_WOULD_PUSH;
            self->output.seen |= TFF_WOULD_PUSH;
        }
    }
    return self->output.force;
}

tff_real tff_inverse_step(tff_inverse *self, tff_real reference)
{
    return (self->entry.waiting > 0.0) ? tff_inverse_step_dt(self, TFF_STEP_S, reference) : tff_inverse_after(self, 1.0, reference);
}

tff_real tff_inverse_step_dt(tff_inverse *self, tff_real dt_s, tff_real reference)
{
    const tff_pause pause = tff_pause_of(&self->output, &self->entry, dt_s);

    return (pause.samples > 0.0) ? tff_resume(&self->output, &self->entry, &pause, tff_inverse_after(self, pause.samples, reference)) : self->output.force;
}
