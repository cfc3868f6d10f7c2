/* The way back to a reference that was lost, after calls that were missed, and from a start in motion with a noisy sensor;
 * prints what the test checks, one line a module. */
#include <math.h>
#include <stdio.h>

#include "tff_capstan.h"
#include "tff_inverse.h"
#include "tff_stream.h"
#include "tff_table.h"

static tff_real reference(int k)
{
    return (tff_real)(30.0 + (15.0 * sin(6.2832 * 0.5e-3 * (double)k)));
}

/* Largest change of the force in a sample over the next ones. */
#define LARGEST(kind, self, first) \
    for (most = 0.0, k = (first); k < (first) + 300; k++) { \
        before = (double)(self).output.force; \
        most = fmax(most, fabs((double)tff_##kind##_step(&(self), reference(k)) - before)); \
    } \
    printf("%.6f ", most)

#define TRY(kind) \
    { \
        tff_##kind self, whole, at; \
        double most, before, rms = 0.0, scattered = 0.0; \
        int k; \
        tff_##kind##_init(&self, 30); \
        for (k = 1; k < 100; k++) { \
            (void)tff_##kind##_step(&self, reference(k)); \
        } \
        whole = self; \
        for (; k < 450; k++) { \
            (void)tff_##kind##_step(&self, (tff_real)NAN); \
        } \
        LARGEST(kind, self, 400); \
        self = whole; \
        tff_##kind##_missed(&self, 50); \
        LARGEST(kind, self, 200); \
        self = whole; \
        for (k = 100; k < 400; k++) { /* one in twenty is lost */ \
            at.output.force = tff_##kind##_step(&whole, reference(k)); \
            before = (double)tff_##kind##_step(&self, ((k % 20) == 7) ? (tff_real)NAN : reference(k)) - (double)at.output.force; \
            scattered += before * before; \
            rms += 1.0; \
        } \
        printf("%.6f\n", sqrt(scattered / rms)); \
    }

int main(void)
{
    tff_inverse inverse;
    double most, before;
    int k;

    TRY(inverse)
    TRY(stream)
    TRY(capstan)
    TRY(table)
    tff_inverse_init_at(&inverse, reference(400) + (tff_real)0.3, (tff_real)1.05 * reference(400));
    LARGEST(inverse, inverse, 401);
    printf("\n");
    return 0;
}
