/* Answers of every module to a random course: drift, jumps, holds and bad inputs, then the same in motion from the start
 * and with other parameters. LOW, HIGH, START [N] are given. */
#include <math.h>
#include <stdio.h>
#include "tff_inverse.h"
#include "tff_capstan.h"
#include "tff_table.h"
#include "tff_plant.h"
#include "tff_profile.h"
#include "tff_stream.h"
static unsigned long seed = 1u;
static double uniform(void) { seed = (seed * 1103515245u + 12345u) & 0x7fffffffu; return (double)seed / 2147483648.0; }
static void course(int moved)
{
    static tff_inverse a; static tff_capstan b; static tff_table c; static tff_plant d; static tff_profile e; static tff_stream g;
    tff_parameters own;
    const double low = LOW, high = HIGH;
    double r = START, target = r, rate = 0.0;
    int k;
    tff_inverse_init(&a, (tff_real)r); tff_capstan_init(&b, (tff_real)r); tff_table_init(&c, (tff_real)r);
    tff_plant_init(&d, (tff_real)r); tff_profile_init(&e);
    tff_stream_init(&g, (tff_real)r);
    tff_parameters_init(&own);
    if (moved) {
        tff_inverse_init_at(&a, (tff_real)r, (tff_real)(1.1 * r)); tff_stream_init_at(&g, (tff_real)r, (tff_real)(0.9 * r));
        tff_capstan_init_at(&b, (tff_real)r, (tff_real)(1.1 * r)); tff_table_init_at(&c, (tff_real)r, (tff_real)(0.9 * r));
        printf("%d %d ", (int)tff_parameters_set_mu(&own, (tff_real)1.1 * own.mu_pull, (tff_real)0.9 * own.mu_release),
               (int)tff_parameters_set_adhesion(&own, own.adhesion + (tff_real)0.5));
        printf("%d ", (int)tff_parameters_set_limits(&own, own.force_min + (tff_real)1, (tff_real)0.9 * own.force_max, (tff_real)0.8 * own.force_rate_max));
        printf("%d %d ", (int)tff_inverse_use(&a, &own), (int)tff_capstan_use(&b, &own));
        printf("%d %d\n", (int)tff_table_use(&c, &own), (int)tff_stream_use(&g, &own));
        r += 0.05 * (high - low); /* at once */
    }
    for (k = 0; k < 6000; k++) {
        double given;
        tff_real f;
        if (uniform() < 0.01) {
            target = low + (high - low) * uniform();
            rate = (high - low) * pow(10.0, -4.0 + 3.0 * uniform());
        }
        r += fmax(-rate, fmin(rate, target - r));
        if (uniform() < 0.001) { r = low + (high - low) * uniform(); }
        given = r;
        if (uniform() < 0.003) { given = (uniform() < 0.5) ? NAN : 1e6 * (uniform() - 0.5); }
        f = tff_inverse_step(&a, (tff_real)given);
        printf("%.9g %u %.9g %u ", (double)f, (unsigned)a.output.seen, (double)tff_capstan_step(&b, (tff_real)given), (unsigned)b.output.seen);
        printf("%.9g %u ", (double)tff_table_step(&c, (tff_real)given), (unsigned)c.output.seen);
        printf("%.9g %u ", (double)tff_plant_step(&d, f), (unsigned)d.seen);
        printf("%.9g %u ", (double)tff_stream_step(&g, (tff_real)given), (unsigned)g.output.seen);
        printf("%.9g %u\n", (double)tff_profile_step(&e), (unsigned)e.output.seen);
    }
}
int main(void)
{
    course(0);
    course(1);
    return 0;
}
