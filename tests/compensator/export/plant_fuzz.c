/* The plant under violent random forces: most evaluations of a call, calls that fail, longest row of failures. */
#include <math.h>
#include <stdio.h>

#include "tff_plant.h"

static unsigned long seed = 1u;

static double uniform(void)
{
    seed = ((seed * 1103515245u) + 12345u) & 0x7fffffffu;
    return (double)seed / 2147483648.0;
}

int main(void)
{
    tff_plant plant;
    double force = 30.0, target = 30.0, rate = 1.0;
    int k, most = 0, failed = 0, row = 0, longest = 0;

    tff_plant_init(&plant, 30);
    for (k = 0; k < 40000; k++) {
        if (uniform() < 0.01) {
            target = 100.0 * uniform();
            rate = pow(10.0, -3.0 + (4.0 * uniform()));
        }
        force += fmax(-rate, fmin(rate, target - force));
        (void)tff_plant_step(&plant, (tff_real)force);
        most = (plant.evaluations > most) ? plant.evaluations : most;
        row = ((plant.status & TFF_FAILED) != 0u) ? (row + 1) : 0;
        failed += (row > 0) ? 1 : 0;
        longest = (row > longest) ? row : longest;
    }
    printf("%d %d %d\n", most, failed, longest);
    return 0;
}
