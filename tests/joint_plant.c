/* A joint between tendons, explicit and by itself: small masses on each tendon, positions and not elongations, local
 * tensions on the joint by virtual work. Nothing here comes from the package. */
#include <math.h>

typedef struct {
    int masses;
    double k1, k2, tau, c;          /* whole tendon */
    double mass, sigma, viscous, p; /* whole tendon; load-independent tension */
    double radius;                  /* drum, with the sign of its winding */
    double arm, arm_by_q, from;     /* far end: arm (q - from) + arm_by_q (q - from)^2/2 */
    double tension;                 /* at the start */
    const double *angle, *angle_by_q;   /* masses */
    const double *mu_pull, *mu_release; /* masses */
    const double *share, *share_by_q, *gain; /* links: share of the length, its change, what the path gains per rad */
    const double *piece;            /* masses: share of the length */
    double *u, *v, *f, *z, *b, *old;    /* sliding positions, speeds; links' force, z; bristles; last angles */
    double *to, *fro;                   /* tanh(mu phi/2) each way, for the last angles */
    double *stiff, *shift, *drift, *s0, *inverse; /* links: whole over length, gained, its rate; masses: sigma, 1/mass */
    int moves;
} tendon;

typedef struct {
    double inertia, damping, spring, rest, gravity, zero, dry, dry_sigma, low, high, stop;
} joint;

/* Forces of the links. Arrays are arguments, since compilers heed `restrict` there alone. */
static void stretch_links(
    int n, double h, const tendon *t, const double *restrict u, const double *restrict v, const double *restrict stiff,
    const double *restrict shift, const double *restrict drift, double *restrict f, double *restrict z)
{
    const double k1 = t->k1, k2 = t->k2, c = t->c, slow = h / t->tau;
    int i;
    for (i = 0; i <= n; i++) {
        const double e = (u[i] - u[i + 1]) + shift[i];
        const double force = (k1 * e + k2 * (e - z[i]) + c * ((v[i] - v[i + 1]) + drift[i])) * stiff[i];
        z[i] += slow * (e - z[i]);
        f[i] = force > 0 ? force : 0;
    }
}

static void pull(tendon *t, int n, double h)
{
    stretch_links(n, h, t, t->u, t->v, t->stiff, t->shift, t->drift, t->f, t->z);
}

/* Wrap angles; contact that is lost takes its bristle along. */
static void bend(tendon *t, double q)
{
    double theta = 0;
    int i;
    for (i = 0; i < t->masses; i++) {
        theta += t->angle[i];
    }
    for (i = 0; i < t->masses; i++) {
        double phi = t->angle[i] + t->angle_by_q[i] * q;
        phi = phi > 0 ? phi : 0;
        if (phi < t->old[i]) {
            t->b[i] *= phi / t->old[i];
        }
        if (phi != t->old[i]) {
            t->to[i] = tanh(t->mu_pull[i] * phi / 2);
            t->fro[i] = tanh(t->mu_release[i] * phi / 2);
            t->s0[i] = t->sigma * phi / theta;
            t->old[i] = phi;
        }
    }
}

/* Bristles, speeds and positions of the masses. */
static void move_masses(
    int n, double h, const tendon *t, const double *restrict f, const double *restrict to, const double *restrict fro,
    const double *restrict s0, const double *restrict inverse, const double *restrict piece, double *restrict u,
    double *restrict v, double *restrict b)
{
    const double p = 2 * t->p, viscous = t->viscous;
    int i;
    for (i = 0; i < n; i++) {
        const double most_pulled = to[i], most_released = fro[i]; /* both are read, so that nothing branches */
        const double most = (v[i] > 0 ? most_pulled : most_released) * (f[i] + f[i + 1] + p);
        const double drag = h * s0[i] * fabs(v[i]);
        const double bristle = most * (b[i] + h * s0[i] * v[i]) / (most + drag + 1e-30);
        const double speed = v[i] + h * (f[i] - f[i + 1] - bristle - viscous * piece[i] * v[i]) * inverse[i];
        b[i] = bristle;
        v[i] = speed;
        u[i] += h * speed;
    }
}

static void slide(tendon *t, int n, double h) /* the masses are u[1] .. u[n] */
{
    move_masses(n, h, t, t->f, t->to, t->fro, t->s0, t->inverse, t->piece, t->u + 1, t->v + 1, t->b);
}

/* Where a drum without inertia stands, behind a gear of a stiffness: its torque and what the tendons take are equal. */
static double drum_behind(
    const tendon *t, int first, int last, double gear, double at, double before, double held, const double *stretch, double h)
{
    double torque = gear * at + held, slope = gear;
    int k;
    for (k = first; k < last; k++) {
        const double r = t[k].radius, s = t[k].stiff[0];
        const double e = stretch[k] - t[k].u[1] + t[k].shift[0];
        const double rest = (t[k].k1 + t[k].k2) * e - t[k].k2 * t[k].z[0] + t[k].c * (t[k].drift[0] - t[k].v[1] - r * before / h);
        torque -= r * s * rest;
        slope += r * r * s * (t[k].k1 + t[k].k2 + t[k].c / h);
    }
    return torque / slope;
}

/* gear: stiffness between motors and drums [N m/rad of the drum], 0 for none; loop: one drum. motor: (rows + 1) * count angles of the drums, contact: rows + 1; out: rows * (2 + 3 count) of q, w, tension at the
 * joint, at the drum, least of each tendon. led: the joint's motion or null. state: the joint's angle, speed and dry
 * friction, and whether this goes on from an earlier call with the same tendons. */
void plant(
    const joint *j, tendon *tendons, int count, double gear, int loop, double row_s, long rows, int inner,
    const double *motor, const double *contact, const double *led, double start, double *state, double *out)
{
    const double h = row_s / inner;
    double q = state[3] > 0 ? state[0] : start, w = state[1], dry = state[2];
    double *const drum = state + 4;
    double stretch[2] = { 0, 0 }; /* of the whole tendon at the start: where the drum then stands */
    long row;
    int k, i, step;
    for (k = 0; state[3] == 0 && k < count; k++) {
        tendon *t = &tendons[k];
        double at = 0;
        for (i = t->masses; i >= 0; i--) { /* u counts from where all would stand without stretch at the start */
            const double e = t->tension / t->k1 * t->share[i];
            at += e;
            t->u[i] = at;
            t->v[i] = 0;
            t->z[i] = e;
        }
        {
            double theta = 0;
            t->moves = 0;
            for (i = 0; i < t->masses; i++) {
                theta += t->angle[i];
                t->moves |= t->angle_by_q[i] != 0;
            }
            for (i = 0; i <= t->masses; i++) {
                t->moves |= t->gain[i] != 0;
                t->stiff[i] = 1 / (t->share[i] + t->share_by_q[i] * start);
                t->shift[i] = t->drift[i] = 0;
            }
            for (i = 0; i < t->masses; i++) {
                t->s0[i] = theta > 0 ? t->sigma * (t->angle[i] + t->angle_by_q[i] * q) / theta : 0;
                t->inverse[i] = 1 / (t->mass * t->piece[i]);
            }
        }
        for (i = 0; i < t->masses; i++) {
            t->b[i] = 0;
            t->old[i] = t->angle[i] + t->angle_by_q[i] * q;
            t->to[i] = tanh(t->mu_pull[i] * t->old[i] / 2);
            t->fro[i] = tanh(t->mu_release[i] * t->old[i] / 2);
        }
    }
    for (k = 0; k < count; k++) {
        for (i = 0; i <= tendons[k].masses; i++) {
            stretch[k] += tendons[k].tension / tendons[k].k1 * tendons[k].share[i];
        }
    }
    /* u[0] is the drum's end, u[1 ..] the masses */
    for (row = 0; row < rows; row++) {
        double lowest[2] = { 1e9, 1e9 };
        for (step = 0; step < inner; step++) {
            const double s = (step + 1.0) / inner;
            const double touch = contact[row] + s * (contact[row + 1] - contact[row]);
            double torque = 0;
            for (k = 0; k < count; k++) {
                tendon *t = &tendons[k];
                const int n = t->masses;
                const double m0 = motor[row * count + k], m1 = motor[(row + 1) * count + k];
                const double from = q - t->from, base = start - t->from;
                const double far = t->arm * (from - base) + t->arm_by_q * (from * from - base * base) / 2;
                const double far_v = (t->arm + t->arm_by_q * from) * w;
                t->u[0] = stretch[k] + t->radius * (m0 + s * (m1 - m0));
                t->v[0] = t->radius * (m1 - m0) / row_s;
                t->u[n + 1] = far;
                t->v[n + 1] = far_v;
                if (gear > 0) {
                    const int first = loop ? 0 : k, last = loop ? count : k + 1;
                    const double before = drum[k];
                    double held = 0;
                    int j2;
                    for (j2 = first; j2 < last; j2++) {
                        held += tendons[j2].radius * tendons[j2].tension;
                    }
                    drum[k] = loop && k > 0 ? drum[0] : drum_behind(tendons, first, last, gear, m0 + s * (m1 - m0), before, held, stretch, h);
                    t->u[0] = stretch[k] + t->radius * drum[k];
                    t->v[0] = t->radius * (drum[k] - before) / h;
                }
                if (t->moves) {
                    for (i = 0; i <= n; i++) {
                        t->shift[i] = t->gain[i] * (q - start);
                        t->drift[i] = t->gain[i] * w;
                        t->stiff[i] = 1 / (t->share[i] + t->share_by_q[i] * q);
                    }
                }
                pull(t, n, h);
                torque += t->f[n] * (t->arm + t->arm_by_q * from);
                for (i = 0; t->moves && i <= n; i++) {
                    torque -= t->f[i] * t->gain[i];
                }
                for (i = 0; step == inner - 1 && i <= n; i++) {
                    lowest[k] = t->f[i] < lowest[k] ? t->f[i] : lowest[k];
                }
            }
            for (k = 0; k < count; k++) {
                tendon *t = &tendons[k];
                if (t->moves) {
                    bend(t, q);
                }
                slide(t, t->masses, h);
            }
            if (led) {
                q = led[row] + s * (led[row + 1] - led[row]);
                w = (led[row + 1] - led[row]) / row_s;
            } else {
                dry = j->dry > 0 ? (dry + h * j->dry_sigma * w) / (1 + h * j->dry_sigma * fabs(w) / j->dry) : 0;
                const double beyond = q > j->high ? q - j->high : q < j->low ? q - j->low : 0;
                const double held = j->spring * (q - j->rest) + j->gravity * sin(q - j->zero) + j->stop * beyond;
                w += h * (torque - touch - dry - j->damping * w - held) / j->inertia;
                q += h * w;
            }
            if (step == inner - 1) {
                double *o = &out[row * (2 + 3 * count)];
                o[0] = q;
                o[1] = torque;
                for (k = 0; k < count; k++) {
                    o[2 + k] = tendons[k].f[tendons[k].masses];
                    o[2 + count + k] = tendons[k].f[0];
                    o[2 + 2 * count + k] = lowest[k];
                }
            }
        }
    }
    state[0] = q;
    state[1] = w;
    state[2] = dry;
    state[3] = 1;
}
