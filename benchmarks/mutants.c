/* Answers of every module to a random course: drift, jumps, holds and bad inputs. LOW, HIGH, START [N] are given. */
#include <math.h>
#include <stdio.h>
#include "tff_inverse.h"
#include "tff_capstan.h"
#include "tff_table.h"
#include "tff_plant.h"
#include "tff_profile.h"
static unsigned long seed = 1u;
static double uniform(void) { seed = (seed * 1103515245u + 12345u) & 0x7fffffffu; return (double)seed / 2147483648.0; }
int main(void)
{
    static tff_inverse a; static tff_capstan b; static tff_table c; static tff_plant d; static tff_profile e;
    const double low = LOW, high = HIGH;
    double r = START, target = r, rate = 0.0;
    int k;
    tff_inverse_init(&a, (tff_real)r); tff_capstan_init(&b, (tff_real)r); tff_table_init(&c, (tff_real)r);
    tff_plant_init(&d, (tff_real)r); tff_profile_init(&e);
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
        printf("%.9g %u\n", (double)tff_profile_step(&e), (unsigned)e.output.seen);
    }
    return 0;
}
