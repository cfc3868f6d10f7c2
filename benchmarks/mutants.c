/* Answers of every module that there is to random courses and calls: drift, jumps, holds and bad inputs, steps with and
 * without a time, missed calls, starts in motion and other parameters. LOW, HIGH, START [N] are given, JOINTS is the number
 * of joints, and WITH_... names the modules. */
#include <math.h>
#include <stdio.h>
#include "tff_plant.h"
#ifdef WITH_INVERSE
#include "tff_inverse.h"
#endif
#ifdef WITH_CAPSTAN
#include "tff_capstan.h"
#endif
#ifdef WITH_TABLE
#include "tff_table.h"
#endif
#ifdef WITH_STREAM
#include "tff_stream.h"
#endif
#ifdef WITH_PROFILE
#include "tff_profile.h"
#endif
#ifdef WITH_OBSERVER
#include "tff_observer.h"
#endif
#ifdef WITH_ADAPTIVE
#include "tff_adaptive.h"
#endif
#ifdef WITH_BOUNDS
#include "tff_bounds.h"
#endif
#if JOINTS
#define ANGLES , angle
#else
#define ANGLES
#endif
#define ROWS 40000
static unsigned long seed = 1u;
static double uniform(void) { seed = (seed * 1103515245u + 12345u) & 0x7fffffffu; return (double)seed / 2147483648.0; }

typedef struct {
    int call;   /* 0 step, 1 step_dt, 2 missed, 3 start in motion, 4 other parameters */
    double dt, reference, measured, position, factor;
    tff_real angle[JOINTS + 1];
} row;
static row rows[ROWS];
static tff_real forces[ROWS];

static void draw(int mixed)
{
    const double low = LOW, high = HIGH;
    double r = START, target = r, rate = 0.0, phase = 0.0;
    int k, j;
    for (k = 0; k < ROWS; k++) {
        row *const at = &rows[k];
        const double what = uniform();
        at->call = (!mixed) ? 0 : (what < 0.5) ? 0 : (what < 0.985) ? 1 : (what < 0.99) ? 2 : (what < 0.995) ? 3 : 4;
        at->dt = (double)TFF_STEP_S * ((uniform() < 0.01) ? 100.0 : 0.2 + 2.0 * uniform());
        if (uniform() < 0.01) {
            target = low + (high - low) * uniform();
            rate = (high - low) * pow(10.0, -4.0 + 3.0 * uniform());
        }
        r += fmax(-rate, fmin(rate, target - r));
        if (uniform() < 0.001) { r = low + (high - low) * uniform(); }
        at->reference = r;
        if (uniform() < 0.003) { at->reference = (uniform() < 0.5) ? NAN : 1e6 * (uniform() - 0.5); }
        phase += 0.003;
        for (j = 0; j <= JOINTS; j++) { at->angle[j] = (tff_real)(0.2 * sin(phase * (1.0 + j))); }
        if (uniform() < 0.002) { at->angle[0] = (tff_real)((uniform() < 0.5) ? NAN : 0.5); }
        at->measured = 1.02 * (double)fmin(fmax(r, low), high) + 0.01 * uniform();
        if (uniform() < 0.003) { at->measured = (uniform() < 0.5) ? NAN : 1e6 * (uniform() - 0.5); }
        if (((k % 5000) > 2000) && ((k % 5000) < 2300)) { at->measured = rows[k - 1].measured; } /* stuck */
        if (((k % 5000) > 3000) && ((k % 5000) < 3200)) { at->measured *= 3.0; } /* what nothing explains */
        at->position = (uniform() < 0.5) ? NAN : 1e-3 * uniform();
        at->factor = 0.8 + 0.4 * uniform();
    }
}

static tff_parameters with(double factor)
{
    tff_parameters own;
    tff_parameters_init(&own);
    (void)tff_parameters_set_mu(&own, (tff_real)factor * own.mu_pull, (tff_real)(2.0 - factor) * own.mu_release);
    (void)tff_parameters_set_adhesion(&own, own.adhesion + (tff_real)0.5);
    (void)tff_parameters_set_limits(&own, own.force_min + (tff_real)1, (tff_real)0.9 * own.force_max, (tff_real)0.8 * own.force_rate_max);
    return own;
}

#define FOLLOW(kind, more, start_more) \
    { \
        static tff_##kind self; \
        int k; \
        tff_##kind##_init(&self, (tff_real)START); \
        for (k = 0; k < ROWS; k++) { \
            const row *const at = &rows[k]; \
            const tff_real *const angle = at->angle; \
            tff_real f = self.output.force; \
            tff_parameters own = with(at->factor); \
            (void)angle; \
            switch (at->call) { \
            case 0: f = tff_##kind##_step(&self, (tff_real)at->reference more); break; \
            case 1: f = tff_##kind##_step_dt(&self, (tff_real)at->dt, (tff_real)at->reference more); break; \
            case 2: tff_##kind##_missed(&self, 20); tff_##kind##_missed(&self, (at->factor > 1) ? 9 : -9); break; \
            case 3: tff_##kind##_init_at(&self, (tff_real)START, (tff_real)(at->factor * START) start_more); break; \
            default: printf("%d ", (int)tff_##kind##_use(&self, &own)); break; \
            } \
            forces[k] = f; \
            printf("%.17g %u %u\n", (double)f, (unsigned)self.output.status, (unsigned)self.output.seen); \
        } \
    }

static void edges(void)
{
    static const double share[5] = { 0.995, 0.99999, 1.0, 1.00001, 1.005 };
    const double value[9] = { 0.0, 0.005, (double)TFF_FORCE_MIN_N, (double)TFF_FORCE_MAX_N, (double)(TFF_CHANGE_MAX_N / TFF_STEP_S), (double)TFF_REFERENCE_MIN_N, (double)TFF_REFERENCE_MAX_N, 2.0, 1000.0 };
    tff_parameters own;
    int k, j;
    for (k = 0; k < 45; k++) {
        const tff_real to = (tff_real)(value[k / 5] * share[k % 5]);
        for (j = 0; j < 8; j++) {
            tff_parameters_init(&own);
            tff_real *const fields[8] = { &own.mu_pull, &own.mu_release, &own.adhesion, &own.force_min, &own.force_max, &own.force_rate_max, &own.reference_min, &own.reference_max };
            *fields[j] = to;
            printf("%d ", (int)tff_parameters_are_good(&own));
            *fields[j] = -to;
            printf("%d\n", (int)tff_parameters_are_good(&own));
        }
    }
}

static void course(int mixed)
{
    draw(mixed);
#ifdef WITH_CAPSTAN
    FOLLOW(capstan, ANGLES, )
#endif
#ifdef WITH_TABLE
    FOLLOW(table, ANGLES, )
#endif
#ifdef WITH_STREAM
    FOLLOW(stream, ANGLES, )
#endif
#ifdef WITH_ADAPTIVE
#define MEASURED , (tff_real)at->measured
    FOLLOW(adaptive, MEASURED ANGLES, ANGLES)
#endif
#ifdef WITH_INVERSE
    FOLLOW(inverse, ANGLES, )
#endif
    {
        static tff_plant self;
        int k;
        tff_plant_init(&self, (tff_real)START);
        for (k = 0; k < ROWS; k++) {
            const tff_real *const angle = rows[k].angle;
            (void)angle;
            printf("%.17g ", (double)tff_plant_step(&self, (uniform() < 0.01) ? (tff_real)(HIGH * 2.0 * uniform()) : forces[k] ANGLES));
            printf("%u %u\n", (unsigned)self.status, (unsigned)self.seen);
        }
    }
#ifdef WITH_PROFILE
    {
        static tff_profile self;
        int k;
        tff_profile_init(&self);
        for (k = 0; k < ROWS; k++) {
            printf("%.17g ", (double)tff_profile_step(&self));
            printf("%u\n", (unsigned)self.output.seen);
        }
    }
#endif
#ifdef WITH_OBSERVER
    {
        static tff_observer self;
        int k;
        tff_observer_init(&self, (tff_real)START);
        for (k = 0; k < ROWS; k++) {
            const row *const at = &rows[k];
            const tff_real *const angle = at->angle;
            const tff_real input = (isnan(at->measured)) ? (tff_real)NAN : (uniform() < 0.005) ? (tff_real)(HIGH * 2.0 * uniform()) : forces[k];
            (void)angle;
            if (at->call == 0) {
                (void)tff_observer_step(&self, input, (tff_real)at->position ANGLES);
            } else if (at->call == 1) {
                (void)tff_observer_step_dt(&self, (tff_real)at->dt, input, (tff_real)at->position ANGLES);
            } else if (at->call == 2) {
                tff_observer_missed(&self, 20);
            } else {
                tff_observer_init_at(&self, (tff_real)START, (tff_real)(at->factor * START));
            }
            printf("%.17g %.17g %.17g ", (double)self.output.tension, (double)self.output.low, (double)self.output.high);
            printf("%u %u\n", (unsigned)self.output.status, (unsigned)self.output.seen);
        }
    }
#endif
#ifdef WITH_BOUNDS
    {
        static tff_bounds self;
        int k;
        tff_bounds_init(&self, (tff_real)START);
        for (k = 0; k < ROWS; k++) {
            tff_bounds_step(&self, (isnan(rows[k].measured)) ? (tff_real)NAN : forces[k]);
            printf("%.17g %.17g %u\n", (double)self.low, (double)self.high, (unsigned)self.status);
        }
    }
#endif
}
int main(void)
{
    edges();
    course(0);
    course(1);
    return 0;
}
