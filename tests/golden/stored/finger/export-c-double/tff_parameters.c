/* tff_parameters.c: see tff_parameters.h.
 *
 * Scenario "robot finger: polymer tendon on six 30 degree arcs", hash 6b567c7d1473e421, level presliding.
 * Written by tendonff VERSION export-c --precision double --prefix tff.
 * The licence of tendonff does not cover what it writes: this file is yours.
 */
#include "tff_parameters.h"

void tff_parameters_init(tff_parameters *self)
{
    self->mu_pull = 0.20000000000000001;
    self->mu_release = 0.20000000000000001;
    self->adhesion = 0.0;
    self->force_min = 0.0;
    self->force_max = 200.0;
    self->force_rate_max = 100000.0;
    self->reference_min = 5.7798712817485942;
    self->reference_max = 55.244025743650283;
}

/* 1 where low <= value <= high, 0 elsewhere and for NaN. */
static int32_t tff_parameters_within(tff_real value, tff_real low, tff_real high)
{
    return ((value >= low) && (value <= high)) ? 1 : 0;
}

int32_t tff_parameters_are_good(const tff_parameters *self)
{
    int32_t good = tff_parameters_within(self->force_min, self->force_min, self->force_max);

    good *= tff_parameters_within(self->reference_min, self->reference_min, self->reference_max);
    good *= tff_parameters_within(self->mu_pull, 0.0, 2.0);
    good *= tff_parameters_within(self->mu_release, 0.0, 2.0);
    good *= tff_parameters_within(self->adhesion, 0.0, 1000.0);
    good *= tff_parameters_within(self->force_min, 0.0, 200.0);
    good *= tff_parameters_within(self->force_max, 0.0, 200.0);
    good *= tff_parameters_within(self->force_rate_max, 0.0, 100000.0);
    good *= tff_parameters_within(self->reference_min, 0.14023897025398877, 106.69761821822065);
    good *= tff_parameters_within(self->reference_max, 0.14023897025398877, 106.69761821822065);
    return good;
}

/* Take a record if it is good. */
static int32_t tff_parameters_take(tff_parameters *self, const tff_parameters *wanted)
{
    const int32_t good = tff_parameters_are_good(wanted);

    if (good != 0) {
        *self = *wanted;
    }
    return good;
}

int32_t tff_parameters_set_mu(tff_parameters *self, tff_real mu_pull, tff_real mu_release)
{
    tff_parameters wanted = *self;

    wanted.mu_pull = mu_pull;
    wanted.mu_release = mu_release;
    return tff_parameters_take(self, &wanted);
}

int32_t tff_parameters_set_adhesion(tff_parameters *self, tff_real adhesion)
{
    tff_parameters wanted = *self;

    wanted.adhesion = adhesion;
    return tff_parameters_take(self, &wanted);
}

int32_t tff_parameters_set_limits(tff_parameters *self, tff_real force_min, tff_real force_max, tff_real force_rate_max)
{
    tff_parameters wanted = *self;

    wanted.force_min = force_min;
    wanted.force_max = force_max;
    wanted.force_rate_max = force_rate_max;
    return tff_parameters_take(self, &wanted);
}

int32_t tff_parameters_set_references(tff_parameters *self, tff_real reference_min, tff_real reference_max)
{
    tff_parameters wanted = *self;

    wanted.reference_min = reference_min;
    wanted.reference_max = reference_max;
    return tff_parameters_take(self, &wanted);
}
