/* Random references and forces, wild ones among them: every answer is finite, within the limits and within the rate. */
#include <math.h>
#include <stdint.h>
#include <stdio.h>

#include "tff_capstan.h"
#include "tff_inverse.h"
#include "tff_plant.h"
#include "tff_table.h"

static uint64_t seed = 88172645463325252u;

static double uniform(void)
{
    seed ^= seed << 13;
    seed ^= seed >> 7;
    seed ^= seed << 17;
    return (double)(seed >> 11) / 9007199254740992.0;
}

static tff_real wild(tff_real around)
{
    const int kind = (int)(uniform() * 40.0);
    switch (kind) {
    case 0: return (tff_real)NAN;
    case 1: return (tff_real)INFINITY;
    case 2: return (tff_real)-INFINITY;
    case 3: return (tff_real)-1e-30;
    case 4: return (tff_real)1e30;
    case 5: return (tff_real)0;
    case 6: return (tff_real)(uniform() * 200.0);
    case 7: return TFF_REFERENCE_MAX_N;
    case 8: return TFF_REFERENCE_MIN_N;
    case 9: return TFF_TABLE_MAX_N;
    case 10: return TFF_TABLE_MIN_N;
    default: return around + (tff_real)(uniform() - 0.5);
    }
}

static int bad(double now, double before)
{
    const double slack = 1e-4;
    return !(now >= (double)TFF_FORCE_MIN_N - slack && now <= (double)TFF_FORCE_MAX_N + slack &&
             fabs(now - before) <= (double)TFF_CHANGE_MAX_N + slack);
}

int main(void)
{
    int round, k, failures = 0;
    for (round = 0; round < 60; round++) {
        tff_inverse inverse;
        tff_capstan capstan;
        tff_table table;
        tff_plant plant;
        tff_real last = wild(30);
        tff_inverse_init(&inverse, last);
        tff_capstan_init(&capstan, last);
        tff_table_init(&table, last);
        tff_plant_init(&plant, last);
        for (k = 0; k < 400; k++) {
            const tff_real reference = wild((last > 1 && last < 45) ? last : (tff_real)30);
            const double a = (double)inverse.output.force, b = (double)capstan.output.force, c = (double)table.output.force;
            const tff_real force = tff_inverse_step(&inverse, reference);
            failures += bad((double)force, a);
            failures += bad((double)tff_capstan_step(&capstan, reference), b);
            failures += bad((double)tff_table_step(&table, reference), c);
            failures += !isfinite((double)tff_plant_step(&plant, wild(force)));
            last = reference;
        }
    }
    printf("%d failures\n", failures);
    return failures != 0;
}
