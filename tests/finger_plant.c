/* Several joints on tendons that cross them, explicit and by itself: small masses, positions and not elongations, local
 * tensions on each joint by virtual work. Nothing here comes from the package. */
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC optimize("O3") /* the tests compile everything else quickly rather than well */
#endif
#include <math.h>

typedef struct {
    int masses;
    double k1, k2, tau, c, mass, sigma, viscous, p; /* whole tendon */
    double tension;                 /* at the start */
    double growth, grown;           /* of the stiffness, as a share of k1, from this tension to twice that */
    const double *angle, *mu;       /* masses: wrap angle at zero, coefficient */
    const double *angle_by;         /* joints x masses */
    const double *share, *piece;    /* links, masses: shares of the length */
    const double *gain;             /* joints x links: what the path gains [m/rad] */
    const double *share_by;         /* joints x links: the same over the whole length [1/rad] */
    const double *arm;              /* joints: moment arm of the far end */
    double *u, *v, *f, *z, *b, *phi; /* masses from 1; links; bristles; last wrap angles */
} tendon;

typedef struct {
    double inertia, damping, spring, rest, dry, dry_sigma;
} joint;

/* Tension over elongation of a tendon whose stiffness is k1 at the tension `grown`, a straight line over the tension up to
 * twice that, and the same beyond; and its elongation at the start. */
static double of_stretch(const tendon *t, double e)
{
    const double low = t->k1 * (1 - t->growth), rate = t->k1 * t->growth / t->grown;
    double knee;
    if (t->growth <= 0) {
        return t->k1 * e;
    }
    knee = log(1 + 2 * t->grown * rate / low) / rate;
    return e < knee ? low / rate * (exp(rate * e) - 1) : 2 * t->grown + (low + 2 * t->grown * rate) * (e - knee);
}

static double stretch_of_start(const tendon *t)
{
    const double low = t->k1 * (1 - t->growth), rate = t->k1 * t->growth / t->grown;
    return t->growth <= 0 ? t->tension / t->k1 : log(1 + t->tension * rate / low) / rate; /* below the knee */
}

/* radius: motors x tendons; motor: (rows + 1) x motors, angles of those that are led, torques of the others, whose inertia
 * is motor_inertia; state: joints x 3 and motors x 2. out: rows x (joints + 2 tendons + motors). */
void finger(
    int joints, const joint *j, int count, tendon *tendons, int motors, const double *radius, const double *motor_inertia,
    const int *led, const double *stiff, double row_s, long rows, int inner, const double *motor, const double *start, double *state, double *out)
{
    const double h = row_s / inner;
    double *q = state, *w = state + joints, *dry = state + 2 * joints, *turn = state + 3 * joints, *spin = turn + motors;
    double base[32], torque[32], held[32];
    long row;
    int a, k, i, step, m;
    for (a = 0; a < joints; a++) {
        q[a] = start[a];
        w[a] = dry[a] = 0;
    }
    for (m = 0; m < motors; m++) {
        turn[m] = spin[m] = 0;
    }
    for (k = 0; k < count; k++) {
        tendon *t = &tendons[k];
        double at = 0;
        for (i = t->masses; i >= 0; i--) {
            double share = t->share[i];
            for (a = 0; a < joints; a++) {
                share += t->share_by[a * (t->masses + 1) + i] * start[a];
            }
            at += stretch_of_start(t) * share;
            t->u[i] = at;
            t->v[i] = 0;
            t->z[i] = stretch_of_start(t) * share;
        }
        base[k] = at;
        for (i = 0; i < t->masses; i++) {
            t->b[i] = 0;
            t->phi[i] = -1;
        }
    }
    for (row = 0; row < rows; row++) {
        for (step = 0; step < inner; step++) {
            const double s = (step + 1.0) / inner;
            for (a = 0; a < joints; a++) {
                torque[a] = 0;
            }
            for (m = 0; m < motors; m++) {
                const double from = motor[row * motors + m], to = motor[(row + 1) * motors + m];
                held[m] = 0;
                if (led[m]) {
                    turn[m] = from + s * (to - from);
                    spin[m] = (to - from) / row_s;
                }
            }
            for (k = 0; k < count; k++) {
                tendon *t = &tendons[k];
                const int n = t->masses;
                double theta = 0;
                t->u[0] = base[k];
                t->v[0] = 0;
                for (m = 0; m < motors; m++) {
                    t->u[0] += radius[m * count + k] * turn[m];
                    t->v[0] += radius[m * count + k] * spin[m];
                }
                t->u[n + 1] = 0;
                t->v[n + 1] = 0;
                for (a = 0; a < joints; a++) {
                    t->u[n + 1] += t->arm[a] * (q[a] - start[a]);
                    t->v[n + 1] += t->arm[a] * w[a];
                }
                for (i = 0; i <= n; i++) {
                    double share = t->share[i], shift = 0, drift = 0, e, force;
                    for (a = 0; a < joints; a++) {
                        share += t->share_by[a * (n + 1) + i] * q[a];
                        shift += t->gain[a * (n + 1) + i] * (q[a] - start[a]);
                        drift += t->gain[a * (n + 1) + i] * w[a];
                    }
                    e = t->u[i] - t->u[i + 1] + shift;
                    force = of_stretch(t, e / share) + (t->k2 * (e - t->z[i]) + t->c * (t->v[i] - t->v[i + 1] + drift)) / share;
                    t->z[i] += h / t->tau * (e - t->z[i]);
                    t->f[i] = force > 0 ? force : 0;
                    for (a = 0; a < joints; a++) {
                        torque[a] -= t->f[i] * t->gain[a * (n + 1) + i];
                    }
                }
                for (a = 0; a < joints; a++) {
                    torque[a] += t->arm[a] * t->f[n];
                }
                for (m = 0; m < motors; m++) {
                    held[m] += radius[m * count + k] * t->f[0];
                }
                for (i = 0; i < n; i++) {
                    theta += t->angle[i];
                }
                for (i = 0; i < n; i++) {
                    double phi = t->angle[i], most, sigma;
                    for (a = 0; a < joints; a++) {
                        phi += t->angle_by[a * n + i] * q[a];
                    }
                    phi = phi > 0 ? phi : 0;
                    if (t->phi[i] > 0 && phi < t->phi[i]) {
                        t->b[i] *= phi / t->phi[i];
                    }
                    t->phi[i] = phi;
                    most = tanh(t->mu[i] * phi / 2) * (t->f[i] + t->f[i + 1] + 2 * t->p);
                    sigma = t->sigma * phi / theta;
                    t->b[i] = most * (t->b[i] + h * sigma * t->v[i + 1]) / (most + h * sigma * fabs(t->v[i + 1]) + 1e-30);
                    t->v[i + 1] += h * (t->f[i] - t->f[i + 1] - t->b[i] - t->viscous * t->piece[i] * t->v[i + 1]) / (t->mass * t->piece[i]);
                    t->u[i + 1] += h * t->v[i + 1];
                }
            }
            for (a = 0; a < joints; a++) {
                dry[a] = j[a].dry > 0 ? (dry[a] + h * j[a].dry_sigma * w[a]) / (1 + h * j[a].dry_sigma * fabs(w[a]) / j[a].dry) : 0;
                w[a] += h * (torque[a] - dry[a] - j[a].damping * w[a] - j[a].spring * (q[a] - j[a].rest)) / j[a].inertia;
                q[a] += h * w[a];
            }
            for (m = 0; m < motors; m++) {
                if (!led[m]) {
                    const double from = motor[row * motors + m], to = motor[(row + 1) * motors + m];
                    spin[m] += h * (from + s * (to - from) - stiff[m] * turn[m] - held[m]) / motor_inertia[m];
                    turn[m] += h * spin[m];
                }
            }
        }
        for (a = 0; a < joints; a++) {
            out[a] = q[a];
        }
        for (k = 0; k < count; k++) {
            out[joints + k] = tendons[k].f[tendons[k].masses];
            out[joints + count + k] = tendons[k].f[0];
        }
        for (m = 0; m < motors; m++) {
            out[joints + 2 * count + m] = turn[m];
        }
        out += joints + 2 * count + motors;
    }
}
