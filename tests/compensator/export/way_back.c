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

/* Largest change of the force in a sample over the next ones, and by how much it is above that of a module that lost
 * nothing: the capstan law jumps where the reference turns, interrupted or not. */
#define LARGEST(kind, self, first) \
    tff_##kind##_init(&never, reference((first) - 20)); \
    for (k = (first) - 20; k < (first); k++) { \
        (void)tff_##kind##_step(&never, reference(k)); \
    } \
    for (most = 0.0, more = 0.0, k = (first); k < (first) + 300; k++) { \
        const double usual = (double)never.output.force; \
        const double own = fabs((double)tff_##kind##_step(&never, reference(k)) - usual); \
        before = (double)(self).output.force; \
        before = fabs((double)tff_##kind##_step(&(self), reference(k)) - before); \
        most = fmax(most, before); \
        more = fmax(more, before - own); \
    } \
    printf("%.6f %.6f ", most, more)

#define TRY(kind) \
    { \
        tff_##kind self, whole, never, at; \
        double most, more, before, rms = 0.0, scattered = 0.0; \
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
        printf("%.6f ", sqrt(scattered / rms)); \
        /* after an e-stop, from the force that acts, with 0.3 N of the sensor's noise in the tension */ \
        tff_##kind##_init_at(&at, reference(400) + (tff_real)0.3, (tff_real)1.2 * reference(400)); \
        printf("%.6f ", fabs((double)at.output.force - 1.2 * (double)reference(400))); \
        LARGEST(kind, at, 401); \
        printf("\n"); \
    }

int main(void)
{
    TRY(inverse)
    TRY(stream)
    TRY(capstan)
    TRY(table)
    return 0;
}
