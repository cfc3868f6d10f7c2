/* tff_inverse.c: see tff_inverse.h.
 *
 * Scenario "robot finger: polymer tendon on six 30 degree arcs", hash 6b567c7d1473e421, level presliding.
 * Written by tendonff VERSION export-c --precision double --prefix tff.
 * The licence of tendonff does not cover what it writes: this file is yours.
 */
#include "tff_inverse.h"
#include "tff_inversion.h"

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

    tff_state_init(&self->chain, tension);
    self->start = tension;
    self->least = tension;
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
        tff_state_carry(self->chain.x, self->chain.x_old, self->start, force);
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
    } else if (tff_state_begins(&self->chain, reference, self->start) != 0) {
        (void)tff_output_set(&self->output, self->output.force);
    } else {
        const tff_real followed = tff_entry_take(&self->entry, reference);
        const tff_weights *rows = tff_rows;
        tff_weights own[2];
        int fresh = 1;
        tff_real exact;

        if (self->chain.fresh == 0) {
            fresh = 0;
        }
        if ((tff_is_within(samples, 1.0, 1.0) == 0) || ((fresh == 0) && (tff_is_within(self->samples, 1.0, 1.0) == 0))) {
            tff_inverse_reweigh(rows, samples * TFF_STEP_S, (fresh != 0) ? 0.0 : (self->samples * TFF_STEP_S), own);
            rows = own;
            fresh = 1; /* the first of these rows */
        }
        exact = tff_inverse_invert_step(
            rows, followed, fresh, self->own.piece_adhesion_N, self->own.friction_mu_dynamic_pull, self->own.friction_mu_dynamic_release, self->chain.x, self->chain.x_old, &self->least);
        self->chain.fresh = 0;
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
