/* Bumps of a restart in motion and after a reference that was lost; prints what the test checks. */
#include <math.h>
#include <stdio.h>

#include "tff_inverse.h"
#include "tff_plant.h"

static tff_real reference(int k)
{
    return (tff_real)(30.0 + (15.0 * sin(6.2832 * 0.5e-3 * (double)k)));
}

int main(void)
{
    tff_inverse whole, plain, at;
    tff_plant plant;
    double most = 0.0, before;
    tff_real force = 0, tension = 0;
    int k;

    tff_inverse_init(&whole, 30);
    tff_plant_init(&plant, 30);
    for (k = 0; k < 1200; k++) {
        force = tff_inverse_step(&whole, reference(k));
        tension = tff_plant_step(&plant, force);
    }
    tff_inverse_init(&plain, tension);
    tff_inverse_init_at(&at, tension, force);
    printf("%.6f ", fabs((double)(tff_inverse_step(&plain, reference(k)) - force)));
    printf("%.6f ", fabs((double)(tff_inverse_step(&at, reference(k)) - force)));
    (void)tff_inverse_step(&whole, reference(k));
    for (k = 1201; k < 1500; k++) {
        most = fmax(most, fabs((double)(tff_inverse_step(&at, reference(k)) - tff_inverse_step(&whole, reference(k)))));
    }
    printf("%.6f ", most);
    for (k = 1000; k < 1050; k++) { /* the reference moves on by some newtons */
        (void)tff_inverse_step(&whole, (tff_real)NAN);
    }
    most = 0.0;
    for (k = 1150; k < 1400; k++) {
        before = (double)whole.output.force;
        most = fmax(most, fabs((double)tff_inverse_step(&whole, reference(k)) - before));
    }
    printf("%.6f %.6f ", most, fabs((double)(reference(1150) - reference(1499))));
    printf("%.9f\n", fabs((double)(whole.entry.last - reference(1399))));
    return 0;
}
