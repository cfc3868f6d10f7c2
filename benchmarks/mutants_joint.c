/* Answers of the exported joints to random courses and calls: drift, jumps, bad inputs, steps with and without a time,
 * pauses, starts at other motor angles, and of an observer that is given the motor, with faults of its encoder. ANGLES are
 * the accepted ones, ADAPTIVE is defined where the joint tunes itself. */
#include <math.h>
#include <stdio.h>
#ifdef ADAPTIVE
#include "tff_joint_adaptive.h"
#else
#include "tff_joint.h"
#endif
#define ROWS 40000
static unsigned long seed = 1u;
static double uniform(void) { seed = (seed * 1103515245u + 12345u) & 0x7fffffffu; return (double)seed / 2147483648.0; }
static double edge(void)
{
    static const double edges[8] = { 0.995e6, 1.005e6, -0.995e6, -1.005e6, 0.995e30, 1.005e30, 1e3, INFINITY };
    return edges[(int)(8.0 * uniform())];
}
static tff_joint joint, observer;
#ifdef ADAPTIVE
static tff_joint_adaptive tuned;
static double slid, before = START, read, stuck = START;
#endif

int main(void)
{
    double angle = START, target = START, rate = 0.0, lost = 0.0;
    tff_real there[2] = { 0, 0 }, read_rad[2] = { 0, 0 };
    int k;
    (void)tff_joint_init(&joint, 0, START, 0);
    (void)tff_joint_init(&observer, 0, START, 0);
#ifdef ADAPTIVE
    (void)tff_joint_adaptive_init(&tuned, 0, START, 0);
#endif
    for (k = 0; k < ROWS; k++) {
        const double what = uniform();
        const double dt = (double)TFF_STEP_S * ((uniform() < 0.005) ? 100.0 : (uniform() < 0.01) ? 1.0 + 1.2e-6 * (uniform() - 0.5) : 0.2 + 2.0 * uniform());
        const double contact = (what > 0.985) ? ((what > 0.998) ? edge() : 0.02 * (uniform() - 0.5)) : 0.0;
        double wanted, motor;
        if (uniform() < 0.01) {
            target = LOW + (HIGH - LOW) * uniform();
            rate = (HIGH - LOW) * pow(10.0, -3.5 + 1.5 * uniform());
        }
        angle += (fabs(target - angle) < rate) ? (target - angle) : ((target > angle) ? rate : -rate);
        wanted = (uniform() < 0.004) ? NAN : ((uniform() < 0.002) ? edge() : angle);
        if (what < 0.003) {
            there[0] = (tff_real)(uniform() - 0.5);
            there[1] = (tff_real)(uniform() - 0.5);
            angle = LOW + (HIGH - LOW) * (0.2 + 0.6 * uniform());
            target = angle;
            printf("%d ", (int)tff_joint_init_at(&joint, 0, (tff_real)((uniform() < 0.1) ? edge() : angle), there, (tff_real)((uniform() < 0.1) ? edge() : 0.0)));
            read_rad[0] = 0;
            read_rad[1] = 0;
            printf("%u ", tff_joint_observe_motors(&joint, TFF_STEP_S, read_rad, 0));
            there[1] = (tff_real)((uniform() < 0.5) ? NAN : edge());
            printf("%d ", (int)tff_joint_init_at(&joint, 0, (tff_real)angle, there, 0));
            printf("%d ", (int)tff_joint_init_at(&observer, 0, (tff_real)angle, there, 0));
        }
        if (what < 0.6) {
            (void)tff_joint_step(&joint, (tff_real)wanted, (tff_real)contact);
        } else {
            (void)tff_joint_step_dt(&joint, (tff_real)((what > 0.998) ? NAN : dt), (tff_real)wanted, (tff_real)contact);
        }
        lost = (lost > 0.0) ? lost - 1.0 : ((uniform() < 0.002) ? ((uniform() < 0.5) ? 2.0 : 300.0) : 0.0);
        motor = (double)joint.motor_rad[0] + ((lost > 0.0) ? 6.283185307179586 : 0.0);
        read_rad[0] = (tff_real)((uniform() < 0.003) ? NAN : motor);
        read_rad[1] = (tff_real)((uniform() < 0.003) ? NAN : (double)joint.motor_rad[1]);
        (void)tff_joint_observe_motors(&observer, (tff_real)((what < 0.6) ? (double)TFF_STEP_S : dt), read_rad, (tff_real)contact);
        printf("%.17g %.17g %.17g %.17g %.17g %.17g %.17g %.17g %.17g %u %u %.17g %u %u", (double)joint.command_rad[0], (double)joint.command_rad[1],
            (double)joint.motor_rad[0], (double)joint.motor_rad[1], (double)joint.motor_torque_N_m[0], (double)joint.tension_N[0], (double)joint.tension_N[1],
            (double)joint.least_N, (double)joint.slack_m, joint.status, joint.seen, (double)observer.angle_rad, observer.status, observer.seen);
#ifdef ADAPTIVE
        if ((k % 2500) == 2499) { /* anew, sometimes with a factor */
            printf("%d ", (int)tff_joint_adaptive_init(&tuned, 0, (tff_real)angle, 0));
            if (uniform() < 0.5) { tff_joint_adaptive_assume(&tuned, (tff_real)((uniform() < 0.1) ? NAN : 0.3 + 2.0 * uniform())); }
        }
        slid = fmax(-1.0, fmin(1.0, slid + (angle - before) / 0.005));
        before = angle;
        read = angle * ((k % 3000 < 2500) ? 1.0 : 0.98) + slid * 0.002 * ((double)((k / 1000) % 5) - 2.0) + 1e-4 * uniform();
        read = ((k % 2000) > 1900) ? stuck : read;
        stuck = read;
        if (what < 0.6) {
            (void)tff_joint_adaptive_step(&tuned, (tff_real)wanted, (tff_real)contact, (tff_real)read);
        } else {
            (void)tff_joint_adaptive_step_dt(&tuned, (tff_real)dt, (tff_real)wanted, (tff_real)contact, (tff_real)((what > 0.98) ? NAN : read));
        }
        printf(" %.17g %.17g %u %u", (double)tuned.command_rad, (double)tuned.factor, tuned.status, tuned.seen);
#endif
        printf("\n");
    }
    return 0;
}
