/* The observer under violent tensions and positions that say nothing: calls that fail, and their longest row. */
#include <math.h>
#include <stdio.h>

#include "tff_observer.h"

static unsigned long seed = 1u;

static double uniform(void)
{
    seed = ((seed * 1103515245u) + 12345u) & 0x7fffffffu;
    return (double)seed / 2147483648.0;
}

int main(void)
{
    tff_observer observer;
    double tension = 30.0, target = 30.0, rate = 1.0;
    int k, failed = 0, row = 0, longest = 0;

    tff_observer_init(&observer, 30);
    for (k = 0; k < 10000; k++) {
        if (uniform() < 0.01) {
            target = 100.0 * uniform();
            rate = pow(10.0, -3.0 + (4.0 * uniform()));
        }
        tension += fmax(-rate, fmin(rate, target - tension));
        (void)tff_observer_step(&observer, (tff_real)((uniform() < 0.01) ? 200.0 * uniform() : tension), (tff_real)((uniform() < 0.5) ? NAN : 1e-3 * uniform()));
        row = ((observer.output.status & TFF_FAILED) != 0u) ? (row + 1) : 0;
        failed += (row > 0) ? 1 : 0;
        longest = (row > longest) ? row : longest;
    }
    printf("%d %d\n", failed, longest);
    return 0;
}
