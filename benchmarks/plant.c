/* A tendon on a curved path, written apart from the package: linearly implicit Euler with a small step, one tridiagonal
   solve a step and no Newton iteration. Unknown are the new velocities of actuator, n masses and load.

   Bristle: df/dt = sigma (v - abs(v) (f/F) abs(f/F)^(power - 1)); power = 1 is Dahl's law. */
#include <math.h>
#include <stdlib.h>

typedef struct {
    double mass, viscous, k1, k2, tau, damping, sigma;           /* of the whole tendon */
    double mu_pull, mu_release, excess, omega, adhesion, power;  /* excess: mu_static/mu_dynamic - 1 */
    double actuator_mass, actuator_damping, load_mass, load_stiffness, load_damping;
    double k3, tau3; /* second relaxing element; 0: none */
    double falling, tension, growing; /* mu times (mean tension/tension)^-falling, and (1 -+ growing) at near and far end */
} plant;

/* angle[i]: wrap angle of mass i; share[j]: share of the length of link j, n + 1 of them.
   out: rows of (first link, last link, actuator's position, load's position). */
int run(const plant *p, int n, const double *angle, const double *share, double rest, const double *force, int samples,
        double sample_s, int steps, double *out) {
    const int all = n + 2;
    const double h = sample_s / steps, g = 1 / (1 + h / p->tau), g3 = 1 / (1 + h / p->tau3);
    double *w = calloc((size_t)(15 * all), sizeof(double)), total = 0, anchor;
    if (!w) return 1;
    double *q = w, *v = q + all, *z = v + all, *fs = z + all, *a = fs + all, *b = a + all, *diag = b + all;
    double *rhs = diag + all, *f = rhs + all, *k1 = f + all, *k2 = k1 + all, *c = k2 + all, *grip = c + all;
    double *k3 = grip + all, *z3 = k3 + all;
    for (int i = 0; i < n; i++) total += angle[i];
    for (int j = n; j >= 0; j--) {
        k1[j] = p->k1 / share[j], k2[j] = p->k2 / share[j], c[j] = p->damping / share[j];
        k3[j] = p->k3 / share[j];
        z[j] = z3[j] = rest / k1[j], q[j] = q[j + 1] + z[j], f[j] = rest;
    }
    anchor = q[n + 1] - rest / p->load_stiffness;
    for (int row = 0; row < samples; row++) {
        for (int s = 1; s <= steps && row > 0; s++) {
            const double u = force[row - 1] + (force[row] - force[row - 1]) * s / steps;
            for (int j = 0; j <= n; j++) {
                const double e = q[j] - q[j + 1];
                a[j] = k1[j] * e + k2[j] * g * (e - z[j]) + k3[j] * g3 * (e - z3[j]);
                b[j] = h * (k1[j] + k2[j] * g + k3[j] * g3) + c[j];
                if (a[j] + b[j] * (v[j] - v[j + 1]) <= 0) a[j] = b[j] = 0; /* slack */
            }
            for (int i = 1; i <= n; i++) {
                const double loaded = fmax((f[i - 1] + f[i]) / 2, 1e-6) / p->tension;
                const double place = 1 + p->growing * ((2 * i - 1.0) / n - 1);
                const double speed = fabs(v[i]), mu = (v[i] >= 0 ? p->mu_pull : p->mu_release)
                    * (1 + p->excess * exp(-speed / p->omega)) * place * (p->falling == 0 ? 1 : pow(loaded, -p->falling));
                const double limit = fmax(f[i - 1] + f[i] + 2 * p->adhesion, 1e-6) * tanh(mu * angle[i - 1] / 2);
                const double fill = p->power == 1 ? 1 : pow(fabs(fs[i]) / limit + 1e-12, p->power - 1);
                const double stiff = p->sigma * angle[i - 1] / total, fade = 1 + h * stiff * speed * fill / limit;
                fs[i] /= fade;
                grip[i] = h * stiff / fade; /* new bristle force: fs + grip v */
            }
            for (int i = 0; i < all; i++) {
                const double m = i == 0 ? p->actuator_mass : i <= n ? p->mass / n : p->load_mass;
                const double drag = i == 0 ? p->actuator_damping
                    : i <= n ? p->viscous / n + grip[i] : p->load_damping + h * p->load_stiffness;
                const double given = i == 0 ? u : i <= n ? -fs[i] : -p->load_stiffness * (q[i] - anchor);
                diag[i] = m / h + drag + (i > 0 ? b[i - 1] : 0) + (i <= n ? b[i] : 0);
                rhs[i] = m / h * v[i] + given + (i > 0 ? a[i - 1] : 0) - (i <= n ? a[i] : 0);
            }
            for (int i = 1; i < all; i++) {
                const double ratio = b[i - 1] / diag[i - 1];
                diag[i] -= ratio * b[i - 1];
                rhs[i] += ratio * rhs[i - 1];
            }
            for (int i = all - 1; i >= 0; i--) {
                v[i] = (rhs[i] + (i <= n ? b[i] * v[i + 1] : 0)) / diag[i];
                q[i] += h * v[i];
            }
            for (int i = 1; i <= n; i++) fs[i] += grip[i] * v[i];
            for (int j = 0; j <= n; j++) {
                f[j] = a[j] + b[j] * (v[j] - v[j + 1]);
                z[j] = (z[j] + h / p->tau * (q[j] - q[j + 1])) * g;
                z3[j] = (z3[j] + h / p->tau3 * (q[j] - q[j + 1])) * g3;
            }
        }
        double *o = out + 4 * row;
        o[0] = f[0], o[1] = f[n], o[2] = q[0], o[3] = q[n + 1];
        if (!(fabs(o[1]) < 1e9)) {
            free(w);
            return 2;
        }
    }
    free(w);
    return 0;
}
