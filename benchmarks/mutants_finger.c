/* Answers of an exported finger to random courses and calls: drift, jumps, loads, bad inputs, steps with and without a time,
 * pauses, and starts elsewhere. COUNT joints have the ranges LEAST and MOST and start at START; LOAD are their loads. */
#include <math.h>
#include <stdio.h>
#include "tff_finger.h"
#ifndef ROWS
#define ROWS 8000
#endif
static unsigned long seed = 1u;
static double uniform(void) { seed = (seed * 1103515245u + 12345u) & 0x7fffffffu; return (double)seed / 2147483648.0; }
static double edge(void)
{
    static const double edges[8] = { 0.995e6, 1.005e6, -0.995e6, -1.005e6, 0.995e30, 1.005e30, 1e3, INFINITY };
    return edges[(int)(8.0 * uniform())];
}
static tff_finger self;
static const double least[COUNT] = LEAST, most[COUNT] = MOST, start[COUNT] = START, load[COUNT] = LOAD;

static void show(void)
{
    int j;
    for (j = 0; j < TFF_FINGER_MOTORS; j++) { printf("%.17g %.17g %.17g ", (double)self.command_rad[j], (double)self.motor_rad[j], (double)self.motor_torque_N_m[j]); }
    for (j = 0; j < TFF_FINGER_TENDONS; j++) { printf("%.17g %.17g ", (double)self.tension_N[j], (double)self.drum_N[j]); }
    for (j = 0; j < TFF_FINGER_BODIES; j++) { printf("%.17g ", (double)self.joint_rad[j]); }
    printf("%.17g %.17g %u %u\n", (double)self.least_N, (double)self.slack_m, (unsigned)self.status, (unsigned)self.seen);
}

int main(void)
{
    double angle[COUNT], target[COUNT], rate[COUNT], torque[COUNT], towards[COUNT];
    tff_real wanted[COUNT], given[COUNT];
    int k, j;
    for (k = 0; k < ROWS; k++) {
        const double what = uniform();
        const double dt = (double)TFF_STEP_S * ((uniform() < 0.005) ? 100.0 : (uniform() < 0.01) ? 1.0 + 1.2e-6 * (uniform() - 0.5) : 0.2 + 2.0 * uniform());
        if ((k % 400) == 0) {
            for (j = 0; j < COUNT; j++) {
                angle[j] = ((k % 1200) == 0) ? start[j] : least[j] + (most[j] - least[j]) * uniform();
                torque[j] = ((k % 800) == 0) ? 0.0 : 0.2 * load[j] * (uniform() - 0.5);
                target[j] = angle[j];
                towards[j] = torque[j];
                rate[j] = 0.0;
                wanted[j] = (tff_real)angle[j];
                given[j] = (tff_real)torque[j];
            }
            if (uniform() < 0.1) { wanted[0] = (tff_real)edge(); }
            printf("%d ", (k % 800) == 0 ? (int)tff_finger_init(&self, 0, wanted) : (int)tff_finger_init_at(&self, 0, wanted, given));
            show();
        }
        for (j = 0; j < COUNT; j++) {
            if (uniform() < 0.02) {
                target[j] = least[j] + (most[j] - least[j]) * uniform();
                rate[j] = (most[j] - least[j]) * pow(10.0, -4.0 + 2.5 * uniform());
                towards[j] = load[j] * ((k % 1600 < 800) ? 0.3 : 1.5) * (2.0 * uniform() - 1.0);
            }
            angle[j] += fmax(-rate[j], fmin(rate[j], target[j] - angle[j]));
            torque[j] += 0.05 * (towards[j] - torque[j]);
            wanted[j] = (tff_real)angle[j];
            given[j] = (tff_real)torque[j];
        }
        if (uniform() < 0.005) { wanted[(int)(COUNT * uniform())] = (tff_real)((uniform() < 0.3) ? NAN : edge()); }
        if (uniform() < 0.005) { given[(int)(COUNT * uniform())] = (tff_real)((uniform() < 0.3) ? NAN : edge()); }
        if (what < 0.6) {
            (void)tff_finger_step(&self, wanted, given);
        } else {
            (void)tff_finger_step_dt(&self, (tff_real)((what > 0.997) ? ((what > 0.9985) ? -1.0 : NAN) : dt), wanted, given);
        }
        show();
    }
    return 0;
}
