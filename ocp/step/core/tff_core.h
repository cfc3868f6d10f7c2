/* tff_core.h: the exact inverse of bodies and tendons, any number of each.
 *
 * Fixed text: the host compiles it as controllers do. What differs between projects stands before it, printed from the
 * symbolic models (types of a body and of a tendon's numbers, laws, loops over elements), and in constant records.
 *
 * Each tendon is a chain both of whose ends are led: the near one by its drum, the far one and the sections of its path by
 * bodies (joints). Unknown are the tensions at the far ends, and the positions of bodies that nothing leads.
 * State of a body: w [rad/s], q [rad], its dry friction [N m]. Positive is towards the drum, tensions are positive, SI
 * units. No heap, no global state; the work of a step is bounded by TFF_MOST_EVALUATIONS.
 */
#ifndef TFF_CORE_H
#define TFF_CORE_H

#define TFF_MOST_EQUATIONS ((2 * TFF_MOST_TENDONS) + TFF_MOST_BODIES)
#define TFF_MOST_ROWS (TFF_MOST_TENDONS + TFF_MOST_BODIES) /* balances that count */
#define TFF_SHARE_LOST ((tff_real)1e12) /* a tension that no tendon has [N] */
#define TFF_HALF ((tff_real)0.5)
#define TFF_SHARE_ROUNDING (8 * TFF_SHARE_TOLERANCE) /* a move that rounding may make */
#define TFF_SHARE_NEAR (64 * TFF_SHARE_TOLERANCE) /* a move after which the next one's size is known */
#define TFF_SHARE_STIFF ((tff_real)1e-4) /* least slope of a tension's condition over it: none where its price is nil */
#define TFF_MOST_AXES 3

/* Effect of a body on a tendon. */
typedef struct {
    tff_real near_m;         /* travel of the near end per unit of the body */
    const tff_real *per;     /* 3 n + 3: change of a row of the path per unit of the body; null: none */
    const tff_real *knots;   /* pieces: where the cubics of the far end's travel begin, its end behind */
    const tff_real *cubics;  /* 4 each [m]; pieces == 0: it goes by `per` */
    int pieces;
    int mass, masses;        /* of `per`, angles of so many masses from this one on differ from zero, */
    int link, links;         /* and lengths of so many links */
} tff_effect;

/* A smooth function of one to three bodies, a sum of cubic B-splines, and what it changes: wrap angles of masses, or the
 * length and the gained length of links. Beyond its range it goes on straight. */
typedef struct {
    const tff_real *values;  /* coefficients, the last axis fastest; each axis has nodes + 2 */
    const tff_real *share;   /* of its value, for each mass or link that it changes */
    tff_real low[TFF_MOST_AXES], step[TFF_MOST_AXES];
    tff_real per_m;          /* of a length: 1 over the length of the whole tendon; 0: a wrap angle */
    int body[TFF_MOST_AXES];
    int nodes[TFF_MOST_AXES];
    int axes, first, count;  /* masses or links first .. first + count - 1 */
} tff_path_table;

typedef struct {
    const tff_weights *chain;
    const tff_real *home;      /* 3 n + 3, the path with all bodies at zero: wrap angles (n), link lengths (n + 1), gained lengths (n + 1), far end */
    const tff_effect *effects; /* one for each body */
    tff_real start_m;          /* near end's position where all bodies that wind it stand at zero */
    tff_real *x;
    tff_real *x_old;
    tff_real *memory;          /* TFF_STRAND_REALS(n, bodies) */
    const tff_path_table *tables;
    int tabled;                /* their number */
} tff_tendon;

/* A tendon in a step: views of its memory, and what one evaluation finds. */
typedef struct {
    const tff_tendon *given;
    const tff_weights *rows;
    const tff_weights *c;     /* of this step */
    tff_work w;
    tff_place place;
    tff_real *before, *old, *now; /* rows of the path: before the last step, at its end, at the end of this one */
    tff_real *by_f;               /* n + 1: slope of each tension over that at the far end */
    tff_real *weight;             /* bodies x (n + 1): what a body takes off each link's length per unit */
    tff_real *torque, *torque_by; /* bodies */
    tff_real *arm;                /* bodies: torque of a tension that is the same along the path */
    tff_real drum_N, travel_m, travel_by;
} tff_strand;

#define TFF_PLACE_REALS(n) ((3 * (n)) + 3)
#define TFF_STRAND_REALS(n, bodies) (TFF_WORK_REALS(n) + (3 * TFF_PLACE_REALS(n)) + ((n) + 1) + ((bodies) * ((n) + 4)))

static tff_real *tff_taken(tff_real **next, int size)
{
    tff_real *const taken = *next;
    *next += size;
    return taken;
}

/* Views of a tendon's memory; returns what lies behind them. */
static tff_real *tff_strand_of(const tff_tendon *given, int bodies, const tff_weights *rows, tff_strand *s)
{
    const int n = given->chain->count;
    tff_real *next = given->memory;
    s->given = given;
    s->rows = rows;
    s->c = rows;
    s->w = tff_work_of(tff_taken(&next, TFF_WORK_REALS(n)), n);
    s->before = tff_taken(&next, TFF_PLACE_REALS(n));
    s->old = tff_taken(&next, TFF_PLACE_REALS(n));
    s->now = tff_taken(&next, TFF_PLACE_REALS(n));
    s->by_f = tff_taken(&next, n + 1);
    s->weight = tff_taken(&next, bodies * (n + 1));
    s->torque = tff_taken(&next, bodies);
    s->torque_by = tff_taken(&next, bodies);
    s->arm = tff_taken(&next, bodies);
    s->place.before = s->before;
    s->place.old = s->old;
    s->place.now = s->now;
    return next;
}

/* The three rows of the path change places: what is now is old. */
static void tff_strand_turn(tff_strand *s)
{
    tff_real *const free_row = s->before;
    s->before = s->old;
    s->old = s->now;
    s->now = free_row;
    s->place.before = s->before;
    s->place.old = s->old;
    s->place.now = s->now;
}

/* Nothing is known yet of what follows from the path. */
static void tff_strand_clear(tff_strand *s, int bodies)
{
    const int n = s->given->chain->count;
    int k;
    for (k = 0; k < (bodies * (n + 1)); k++) {
        s->weight[k] = 0;
    }
    tff_untouched(s->given->chain, &s->w);
}

/* Far end's travel for a body's position, and its slope; straight beyond the ends of a table. */
static tff_real tff_far_travel(const tff_effect *e, int last, tff_real q, tff_real *arm)
{
    tff_real within = q;
    tff_real s;
    const tff_real *c;
    int k = 0;
    if (e->pieces == 0) {
        *arm = e->per[last];
        return *arm * q;
    }
    within = (within < e->knots[0]) ? e->knots[0] : within;
    within = (within > e->knots[e->pieces]) ? e->knots[e->pieces] : within;
    while ((k < (e->pieces - 1)) && (within >= e->knots[k + 1])) {
        k++;
    }
    c = &e->cubics[4 * k];
    s = within - e->knots[k];
    *arm = c[1] + (s * ((2 * c[2]) + (s * 3 * c[3])));
    return (c[0] + (s * (c[1] + (s * (c[2] + (s * c[3])))))) + (*arm * (q - within));
}

/* Weights of four neighbouring coefficients at s in [0, 1] of a piece of the length `step`, and their slopes. */
static void tff_path_weights(tff_real s, tff_real step, tff_real *weight, tff_real *rise)
{
    const tff_real r = 1 - s;
    weight[0] = r * r * r / 6;
    weight[1] = (4 - (3 * s * s * (2 - s))) / 6;
    weight[2] = (4 - (3 * r * r * (2 - r))) / 6;
    weight[3] = s * s * s / 6;
    rise[0] = -TFF_HALF * r * r / step;
    rise[1] = TFF_HALF * ((3 * s * s) - (4 * s)) / step;
    rise[2] = -TFF_HALF * ((3 * r * r) - (4 * r)) / step;
    rise[3] = TFF_HALF * s * s / step;
}

/* Value of a table for positions of the bodies, `stride` apart, and its slopes over its axes. */
static tff_real tff_path_table_at(const tff_path_table *t, const tff_real *q, int stride, tff_real *slope)
{
    tff_real weight[TFF_MOST_AXES][4];
    tff_real rise[TFF_MOST_AXES][4];
    tff_real over[TFF_MOST_AXES];
    tff_real value = 0;
    int size[TFF_MOST_AXES];
    int at = 0;
    int corners = 1;
    int a;
    int b;
    int k;
    for (a = 0; a < t->axes; a++) {
        const tff_real high = t->low[a] + (t->step[a] * (tff_real)(t->nodes[a] - 1));
        const tff_real given = q[t->body[a] * stride];
        const tff_real above = (given < t->low[a]) ? t->low[a] : given;
        const tff_real within = (above > high) ? high : above;
        const tff_real u = (within - t->low[a]) / t->step[a];
        const int most = t->nodes[a] - 2;
        const int piece = ((int)u > most) ? most : (int)u;
        tff_path_weights(u - (tff_real)piece, t->step[a], weight[a], rise[a]);
        over[a] = given - within;
        slope[a] = 0;
        size[a] = t->nodes[a] + 2;
        at = (at * size[a]) + piece;
        corners *= 4;
    }
    for (k = 0; k < corners; k++) {
        tff_real share = 1;
        tff_real by[TFF_MOST_AXES];
        int left = k;
        int next = 1;
        int where = at;
        for (a = 0; a < t->axes; a++) {
            by[a] = 1;
        }
        for (a = t->axes - 1; a >= 0; a--) {
            const int own = left % 4;
            where += own * next;
            next *= size[a];
            left /= 4;
            share *= weight[a][own];
            for (b = 0; b < t->axes; b++) {
                by[b] *= (b == a) ? rise[a][own] : weight[a][own];
            }
        }
        value += share * t->values[where];
        for (a = 0; a < t->axes; a++) {
            slope[a] += by[a] * t->values[where];
        }
    }
    for (a = 0; a < t->axes; a++) {
        value += slope[a] * over[a];
    }
    return value;
}

/* What the tables of a tendon add to its path, and to what each body takes off it. */
static void tff_place_tables(const tff_tendon *t, const tff_real *q, int stride, tff_real *out, tff_real *weight)
{
    const int n = t->chain->count;
    int k;
    int a;
    int i;
    for (k = 0; k < t->tabled; k++) {
        const tff_path_table *const table = &t->tables[k];
        const int bends = (table->per_m > 0) ? 0 : 1;
        tff_real slope[TFF_MOST_AXES];
        const tff_real value = tff_path_table_at(table, q, stride, slope);
        for (i = 0; i < table->count; i++) {
            const tff_real own = table->share[i] * value;
            const int row = table->first + i;
            if (bends != 0) {
                out[row] += own;
            } else {
                out[n + row] += own * table->per_m;
                out[((2 * n) + 1) + row] += own;
            }
        }
        for (a = 0; (weight != NULL) && (bends == 0) && (a < table->axes); a++) {
            for (i = 0; i < table->count; i++) {
                weight[(table->body[a] * (n + 1)) + table->first + i] -= table->share[i] * slope[a];
            }
        }
    }
}

/* The path for positions of the bodies, `stride` apart; `weight`, where it is given, receives what each body takes off
 * the links' lengths. */
static void tff_place_at(const tff_tendon *t, int bodies, const tff_real *q, int stride, tff_real *out, tff_real *weight)
{
    const int n = t->chain->count;
    const int last = (3 * n) + 2;
    int b;
    int i;
    for (i = 0; i <= last; i++) {
        out[i] = t->home[i];
    }
    for (b = 0; b < bodies; b++) {
        const tff_effect *const e = &t->effects[b];
        if (e->per != NULL) {
            const tff_real at = q[b * stride];
            const int gained = (2 * n) + 1 + e->link;
            tff_real arm;
            for (i = e->mass; i < (e->mass + e->masses); i++) {
                out[i] += e->per[i] * at;
            }
            for (i = 0; i < e->links; i++) {
                out[n + e->link + i] += e->per[n + e->link + i] * at;
                out[gained + i] += e->per[gained + i] * at;
            }
            out[last] += tff_far_travel(e, last, at, &arm);
            if (weight != NULL) {
                tff_real *const own = &weight[b * (n + 1)];
                own[n] = 0;
                for (i = 0; i < e->links; i++) {
                    own[e->link + i] = -e->per[gained + i];
                }
                own[n] += arm;
            }
        }
    }
    tff_place_tables(t, q, stride, out, weight);
    for (i = 0; i < n; i++) {
        out[i] = (out[i] > 0) ? out[i] : 0;
    }
    for (i = n; i <= (2 * n); i++) {
        out[i] = 1 / out[i];
    }
}

/* The path for positions at the end of a step, and what each body takes off it. */
static void tff_strand_place(tff_strand *s, int bodies, const tff_real *q)
{
    const tff_tendon *const t = s->given;
    const int n = t->chain->count;
    int b;
    int i;
    tff_place_at(t, bodies, q, 1, s->now, s->weight);
    for (b = 0; b < bodies; b++) {
        const tff_effect *const e = &t->effects[b];
        tff_real *const own = &s->weight[b * (n + 1)];
        tff_real arm = 0;
        if (e->near_m != 0) { /* a drum takes the tendon in: its first link gets longer */
            own[0] = -e->near_m;
            arm = own[0];
        }
        for (i = e->link; i < (e->link + e->links); i++) {
            arm += own[i];
        }
        s->arm[b] = arm + (((e->per != NULL) && ((e->link + e->links) <= n)) ? own[n] : 0);
    }
}

/* The path and everything that follows from it for positions at the end of a step. */
static void tff_strand_at(tff_strand *s, int bodies, const tff_real *q)
{
    const int n = s->given->chain->count;
    int i;
    tff_strand_place(s, bodies, q);
    tff_move(s->c, &s->place, s->given->x, s->given->x_old, &s->w);
    tff_carry(n, &s->w);
    tff_link_starts(s->c, n, s->w.ratio, s->w.base, s->w.start, s->w.gain);
    for (i = 0; i <= n; i++) {
        tff_link_ready(s->c, &s->w, i);
        if (i > 0) {
            tff_mass_ready(s->c, &s->w, i);
        }
    }
}

/* What a step starts from: base of the scheme. */
static void tff_strand_base(tff_strand *s, int row, int piece)
{
    const tff_tendon *const t = s->given;
    const int size = TFF_STATE_REALS(t->chain->count);
    const tff_real carry = (piece != 0) ? 0 : s->rows[TFF_ROW_OF(row)].carry;
    int j;
    s->c = &s->rows[TFF_ROW_OF(row)];
    for (j = 0; j < size; j++) {
        s->w.base[j] = t->x[j] + (carry * (t->x[j] - t->x_old[j]));
    }
}

/* From the far end to the drum: velocities and tensions for a tension at the far end, with their slopes over it, torques
 * on all bodies by local tensions and the drum's travel. Tensions are not cut off at zero. */
static void tff_back(tff_strand *s, int bodies, tff_real tension)
{
    const tff_weights *const c = s->c;
    tff_work *const w = &s->w;
    const int n = s->given->chain->count;
    tff_real f = tension;
    tff_real v = w->drift[n + 1];
    tff_real by_f = 1;
    tff_real by_v = 0;
    int b;
    int i;
    w->v[n + 1] = v;
    for (i = n; i >= 0; i--) {
        const tff_real *const ready = &w->ready[TFF_READY * i];
        tff_real rate;
        tff_real of_force;
        tff_link_of_force(c, ready, f, &rate, &of_force);
        v += rate - w->drift[i];
        by_v += of_force * by_f;
        w->v[i] = v;
        w->force[i] = f;
        s->by_f[i] = by_f;
        if (i > 0) {
            tff_real drop;
            tff_real of_v;
            tff_real of_far;
            tff_mass_of_force(c, ready, w, i, v, f, &drop, &of_v, &of_far);
            f += drop;
            by_f = (of_v * by_v) + (of_far * by_f);
        }
    }
    for (b = 0; b < bodies; b++) {
        const tff_effect *const e = &s->given->effects[b];
        const tff_real *const weight = &s->weight[b * (n + 1)];
        tff_real torque = 0;
        tff_real torque_by = 0;
        for (i = e->link; i < (e->link + e->links); i++) {
            torque += weight[i] * w->force[i];
            torque_by += weight[i] * s->by_f[i];
        }
        if ((e->per != NULL) && ((e->link + e->links) <= n)) { /* the far end alone */
            torque += weight[n] * tension;
            torque_by += weight[n];
        }
        s->torque[b] = torque;
        s->torque_by[b] = torque_by;
    }
    s->drum_N = w->force[0];
    s->travel_m = (w->base[TFF_AT_NEAR(n)] + (c->H * v)) - s->given->start_m;
    s->travel_by = c->H * by_v;
}

/* Take a solved step. */
static void tff_strand_end(tff_strand *s)
{
    const tff_tendon *const t = s->given;
    const int size = TFF_STATE_REALS(t->chain->count);
    int j;
    for (j = 0; j < size; j++) {
        t->x_old[j] = t->x[j];
    }
    tff_finish(s->c, s->c->count, &s->w, t->x);
    tff_strand_turn(s);
}

/* Solve a dense system in place, rows of the matrix `stride` apart; the answer replaces b. Returns 0 where it is singular. */
static int tff_dense(tff_real *a, int stride, tff_real *b, int n)
{
    int i;
    int j;
    int k;
    for (k = 0; k < n; k++) {
        int best = k;
        for (i = k + 1; i < n; i++) {
            best = (TFF_FABS(a[(i * stride) + k]) > TFF_FABS(a[(best * stride) + k])) ? i : best;
        }
        if (!(TFF_FABS(a[(best * stride) + k]) > 0)) {
            return 0;
        }
        if (best != k) {
            tff_real other = b[k];
            b[k] = b[best];
            b[best] = other;
            for (j = k; j < n; j++) {
                other = a[(k * stride) + j];
                a[(k * stride) + j] = a[(best * stride) + j];
                a[(best * stride) + j] = other;
            }
        }
        for (i = k + 1; i < n; i++) {
            const tff_real share = a[(i * stride) + k] / a[(k * stride) + k];
            if (share != 0) {
                for (j = k + 1; j < n; j++) {
                    a[(i * stride) + j] -= share * a[(k * stride) + j];
                }
                b[i] -= share * b[k];
            }
        }
    }
    for (k = n - 1; k >= 0; k--) {
        for (j = k + 1; j < n; j++) {
            b[k] -= a[(k * stride) + j] * b[j];
        }
        b[k] /= a[(k * stride) + k];
    }
    return 1;
}

/* ---- tensions that balance all torques and close all drums ---- */

/* How torques are shared among tendons: the least sum of tensions of which none is below `least`, with a barrier of the
 * width `smooth` above it (0: none) and a price on the change of a step. Tendons of a motor that winds several are bound
 * to one another instead. */
typedef struct {
    tff_real least, smooth, price;
    const tff_real *winding_m;   /* travel of each tendon per radian of its drum, with its sign */
    const int *partner;          /* tendon before it on the same drum; -1: none */
    const int *shares;           /* 1: alone on its drum */
    const tff_real *closure_rad; /* how far each is wound on beyond its partner at the start, as an angle of the drum */
    const tff_real *compliance;  /* at rest only: stretch of each tendon [m/N], */
    const tff_real *pretension;  /* and its tension when it was tensioned [N] */
} tff_sharing;

typedef struct {
    const tff_body *body;
    tff_strand *strands;
    const tff_sharing *how;
    const tff_real *scale;     /* a moment arm of each body */
    int bodies;
    int balanced;              /* the first so many: their balances count, the others' motion is known */
    int led;                   /* of those the first so many have a wanted motion, the others follow from their balances */
    int count;                 /* tendons */
    int still;                 /* 1: at rest, tensions uniform along each tendon */
    tff_real wanted[TFF_MOST_BODIES]; /* torque of the tendons on each body */
    tff_real effort[TFF_MOST_BODIES]; /* torque on what each touches */
    tff_real position[TFF_MOST_BODIES];
    tff_real found[3 * TFF_MOST_BODIES]; /* state of each at the end of the step */
    tff_real z_base[3 * TFF_MOST_BODIES];
    tff_real *last, *past;     /* count: tensions of the step before, and of the one before that */
    tff_real *worth;           /* TFF_MOST_EQUATIONS, of a balance: what it saves to ask for less of it [-] */
    int *loose;                /* count, 1: hangs, no tension, its closure does not count */
    const tff_real *wound_m;   /* null, or the drums stand where they are and positions are unknown: what each has wound */
    const tff_real *gives;     /* of these, by tendon: angle by which a motor gives way to a torque [rad/(N m)], */
    const int *motor_of;       /* and the number of that motor */
    long evaluations;          /* of all tendons */
    long most;                 /* that this step may make `evaluations` */
} tff_balance;

/* Torque that the tendons must give a body in the position that it has, and its state there. */
static void tff_torque_wanted(tff_balance *m, int b)
{
    const tff_real H = m->strands[0].c->H;
    const tff_real q_base = (m->still != 0) ? m->position[b] : m->z_base[(3 * b) + 1];
    const tff_real w = (m->position[b] - q_base) / H;
    tff_real by_w;
    tff_body_torque(&m->body[b], w, m->z_base[3 * b], q_base, m->z_base[(3 * b) + 2], H, &m->wanted[b], &by_w, &m->found[(3 * b) + 2]);
    (void)by_w;
    m->wanted[b] += m->effort[b];
    m->found[3 * b] = w;
    m->found[(3 * b) + 1] = m->position[b];
}

/* All tendons from their far ends to their drums, for tensions u; `moved`: bodies have moved since. */
static void tff_all_back(tff_balance *m, const tff_real *u, int moved)
{
    int t;
    int b;
    for (t = 0; t < m->count; t++) {
        tff_strand *const s = &m->strands[t];
        if (m->still != 0) { /* no friction, nothing slides */
            if (moved != 0) {
                tff_strand_place(s, m->bodies, m->position);
            }
            for (b = 0; b < m->bodies; b++) {
                s->torque[b] = s->arm[b] * u[t];
                s->torque_by[b] = s->arm[b];
            }
            s->travel_m = m->how->compliance[t] * (u[t] - m->how->pretension[t]);
            s->travel_by = m->how->compliance[t];
        } else {
            if (moved != 0) {
                tff_strand_at(s, m->bodies, m->position);
            }
            tff_back(s, m->bodies, u[t]);
        }
    }
    m->evaluations++;
}

/* How far a tendon is wound on beyond its partner, as an angle of their drum. */
static tff_real tff_open(const tff_balance *m, int t, int other)
{
    const tff_sharing *const how = m->how;
    return ((m->strands[t].travel_m / how->winding_m[t]) - (m->strands[other].travel_m / how->winding_m[other])) + how->closure_rad[t];
}

/* What a drum has wound less than its tendon takes: it gives way to all that its motor winds. */
static tff_real tff_unwound(const tff_balance *m, int t)
{
    tff_real torque = 0;
    int i;
    for (i = 0; i < m->count; i++) { /* a drum that holds a loose end holds nothing */
        torque += ((m->motor_of[i] == m->motor_of[t]) && (m->strands[i].drum_N > 0)) ? (m->strands[i].drum_N * m->how->winding_m[i]) : 0;
    }
    return m->strands[t].travel_m - (m->wound_m[t] - (m->gives[t] * torque * m->how->winding_m[t]));
}

/* Balances of torques as forces, and closures as angles of the drum times a tension, or what drums have wound; returns
 * their number. */
static int tff_off(const tff_balance *m, const tff_real *u, tff_real *off)
{
    int rows = 0;
    int b;
    int t;
    for (b = 0; b < m->balanced; b++) {
        tff_real torque = m->wanted[b];
        for (t = 0; t < m->count; t++) {
            torque -= m->strands[t].torque[b];
        }
        off[rows] = torque / m->scale[b];
        rows++;
    }
    for (t = 0; t < m->count; t++) {
        const int other = m->how->partner[t];
        if (m->wound_m != NULL) {
            off[rows] = (m->loose[t] != 0) ? -u[t] : (-tff_unwound(m, t) / m->how->compliance[t]);
            rows++;
        } else if (other >= 0) {
            off[rows] = -tff_open(m, t, other) * TFF_FABS(m->how->winding_m[t]) / m->strands[t].travel_by;
            rows++;
        }
    }
    return rows;
}

/* Less of a move that turns back on the one before, by `turned` (their product; `before`: its square): to and fro over
 * kinks. What turns back by less than half comes nearer by itself. */
static tff_real tff_damped(tff_real damping, tff_real turned, tff_real before)
{
    const tff_real twice = damping + damping;
    const tff_real more = (twice < 1) ? twice : 1;
    const tff_real as_before = (turned < 0) ? damping : more;
    return ((turned + (TFF_HALF * before)) < 0) ? (TFF_HALF * damping) : as_before;
}

/* Tendons hang whose drums would have to push, and no longer where their drums take them in; returns how many have changed. */
static int tff_hang(tff_balance *m, tff_real *u)
{
    const tff_real rounded = 100 * TFF_SHARE_TOLERANCE;
    int changed = 0;
    int t;
    for (t = 0; (m->wound_m != NULL) && (t < m->count); t++) {
        if ((m->loose[t] == 0) && (u[t] < -rounded)) {
            m->loose[t] = 1;
            u[t] = 0;
            changed++;
        } else if ((m->loose[t] != 0) && (tff_unwound(m, t) < (-rounded * m->how->compliance[t]))) {
            m->loose[t] = 0;
            changed++;
        } else {
            /* as it was */
        }
    }
    return changed;
}

/* Tensions and positions of the joints that nothing leads, where balances and closures are as many as both: Newton's
 * method, slopes over positions by differences. Returns 0 where there is no answer. */
static int tff_follow(tff_balance *m, tff_real *u)
{
    static const int stride = TFF_MOST_EQUATIONS;
    tff_real a[TFF_MOST_EQUATIONS * TFF_MOST_EQUATIONS];
    tff_real b[TFF_MOST_EQUATIONS];
    tff_real nudged[TFF_MOST_EQUATIONS];
    tff_real went[TFF_MOST_EQUATIONS] = { 0 };
    const int unknown = m->count + (m->balanced - m->led);
    tff_real moved[TFF_MOST_EQUATIONS] = { 0 };
    tff_real damping = 1;
    int k;
    int i;
    int t;
    for (k = 0; (k < TFF_SHARE_MOVES) && (m->evaluations < m->most); k++) {
        tff_real most = 0;
        tff_real turned = 0;
        tff_real before = 0;
        int rows;
        for (i = m->led; i < m->balanced; i++) {
            tff_torque_wanted(m, i);
        }
        tff_all_back(m, u, 1);
        rows = tff_off(m, u, b);
        if (rows != unknown) {
            return 0;
        }
        for (t = 0; t < m->count; t++) {
            int row = m->balanced;
            for (i = 0; i < m->balanced; i++) {
                a[(i * stride) + t] = m->strands[t].torque_by[i] / m->scale[i];
            }
            for (i = 0; i < m->count; i++) {
                const int other = m->how->partner[i];
                if (m->wound_m != NULL) {
                    const tff_real gives = (m->motor_of[i] == m->motor_of[t]) ? (m->gives[i] * m->how->winding_m[i] * m->how->winding_m[t]) : 0;
                    const tff_real own = (t == i) ? m->strands[t].travel_by : 0;
                    const tff_real pinned = (t == i) ? (tff_real)1 : (tff_real)0;
                    a[(row * stride) + t] = (m->loose[i] != 0) ? pinned : ((own + (gives * m->strands[t].by_f[0])) / m->how->compliance[i]);
                    row++;
                } else if (other >= 0) {
                    const tff_real scale = m->strands[i].travel_by / TFF_FABS(m->how->winding_m[i]);
                    const tff_real own = (t == i) ? (m->strands[t].travel_by / m->how->winding_m[t]) / scale : 0;
                    a[(row * stride) + t] = (t == other) ? -(m->strands[t].travel_by / m->how->winding_m[t]) / scale : own;
                    row++;
                }
            }
        }
        for (i = m->led; i < m->balanced; i++) {
            const int column = m->count + (i - m->led);
            const tff_real stood = m->position[i];
            int row;
            m->position[i] = stood + TFF_NUDGE;
            tff_torque_wanted(m, i);
            tff_all_back(m, u, 1);
            (void)tff_off(m, u, nudged);
            m->position[i] = stood;
            tff_torque_wanted(m, i);
            for (row = 0; row < rows; row++) {
                a[(row * stride) + column] = (b[row] - nudged[row]) / TFF_NUDGE;
            }
        }
        if (tff_dense(a, stride, b, rows) == 0) {
            return 0;
        }
        for (i = 0; i < unknown; i++) {
            const tff_real now = (i < m->count) ? u[i] : m->position[m->led + (i - m->count)];
            const tff_real size = TFF_FABS(b[i]) / (1 + TFF_FABS(now));
            most = (size <= most) ? most : size; /* this way round NaN counts */
            turned += b[i] * went[i];
            before += went[i] * went[i];
            went[i] = b[i];
        }
        if (!(most < TFF_SHARE_LOST)) {
            return 0;
        }
        damping = (k < (TFF_SHARE_MOVES / 2)) ? tff_damped(damping, turned, before) : (tff_real)1;
        for (i = 0; i < unknown; i++) {
            /* where that does not end moves to and fro over a kink: to where both would meet, on the way back */
            moved[i] = ((turned < 0) && (k >= (TFF_SHARE_MOVES / 2))) ? ((turned / (before - turned)) * moved[i]) : (damping * b[i]);
            if (i < m->count) {
                u[i] += moved[i];
            } else {
                m->position[m->led + (i - m->count)] += moved[i];
            }
        }
        /* later on less will do: moves go to and fro by what rounding leaves */
        if ((tff_hang(m, u) == 0) && ((most <= TFF_SHARE_TOLERANCE) || ((k >= (TFF_SHARE_MOVES / 2)) && (most <= (100 * TFF_SHARE_TOLERANCE))))) {
            for (i = m->led; i < m->balanced; i++) {
                tff_torque_wanted(m, i);
            }
            tff_all_back(m, u, 1);
            return 1;
        }
    }
    return 0;
}

static tff_real tff_way(const tff_sharing *how, int t)
{
    return (how->winding_m[t] > 0) ? (tff_real)1 : (tff_real)-1;
}

/* What is missing in all balances of torque and closures of drums, as tensions, and its slopes over the tensions;
 * `of_row` tells which each is. Returns their number. */
static int tff_missing(const tff_balance *m, tff_real *a, int stride, tff_real *b, int *of_row)
{
    const tff_sharing *const how = m->how;
    int rows = 0;
    int i;
    int t;
    int j;
    for (i = 0; i < m->balanced; i++) {
        tff_real off = m->wanted[i];
        for (t = 0; t < m->count; t++) {
            off -= m->strands[t].torque[i];
            a[(rows * stride) + t] = m->strands[t].torque_by[i] / m->scale[i];
        }
        b[rows] = off / m->scale[i];
        of_row[rows] = i;
        rows++;
    }
    for (t = 0; t < m->count; t++) {
        const int other = how->partner[t];
        if ((other >= 0) && (m->loose[t] == 0) && (m->loose[other] == 0)) {
            const tff_strand *const s = &m->strands[t];
            const tff_strand *const o = &m->strands[other];
            const tff_real scale = s->travel_by / TFF_FABS(how->winding_m[t]); /* as a tension */
            const tff_real own = (s->travel_by / how->winding_m[t]) / scale;
            const tff_real its = -(o->travel_by / how->winding_m[other]) / scale;
            for (j = 0; j < m->count; j++) {
                a[(rows * stride) + j] = 0;
            }
            a[(rows * stride) + t] = own;
            a[(rows * stride) + other] = its;
            of_row[rows] = m->balanced + t;
            b[rows] = -tff_open(m, t, other) / scale;
            rows++;
        }
    }
    return rows;
}

/* 1 - x/size for size^2 = x^2 + rest, without the difference of two that are nearly alike. */
static tff_real tff_short_of(tff_real x, tff_real rest, tff_real size)
{
    const tff_real otherwise = (size > 0) ? (1 - (x / size)) : TFF_HALF;
    return (x > 0) ? (rest / (size * (size + x))) : otherwise;
}

/* What the prices of the tensions know of the balances that count: arms in units of tension, as without friction, and
 * which each is, in the order of `tff_missing`. Returns their number. */
static int tff_plain(const tff_balance *m, tff_real *a, int *of_row)
{
    int rows = 0;
    int i;
    int t;
    for (i = 0; i < m->balanced; i++) {
        for (t = 0; t < m->count; t++) {
            a[(rows * TFF_MOST_TENDONS) + t] = m->strands[t].arm[i] / m->scale[i];
        }
        of_row[rows] = i;
        rows++;
    }
    for (i = 0; i < m->count; i++) {
        const int other = m->how->partner[i];
        if ((other >= 0) && (m->loose[i] == 0) && (m->loose[other] == 0)) {
            for (t = 0; t < m->count; t++) {
                a[(rows * TFF_MOST_TENDONS) + t] = 0;
            }
            a[(rows * TFF_MOST_TENDONS) + i] = tff_way(m->how, i);
            a[(rows * TFF_MOST_TENDONS) + other] = -tff_way(m->how, other);
            of_row[rows] = m->balanced + i;
            rows++;
        }
    }
    return rows;
}

/* Tensions u at the far ends that balance all torques and close all drums. Newton's method on those balances with local
 * tensions, and on the conditions of the least price among tensions that give the same torques without friction: their
 * slopes do not jump where a mass turns. The conditions give the tensions' moves for those of the balances' worth, the
 * balances the latter. Returns 0 where there are none. */
static int tff_share(tff_balance *m, tff_real *u)
{
    tff_real plain[TFF_MOST_ROWS * TFF_MOST_TENDONS];
    tff_real by[TFF_MOST_ROWS * TFF_MOST_TENDONS];
    tff_real a[TFF_MOST_ROWS * TFF_MOST_ROWS];
    tff_real b[TFF_MOST_ROWS];
    const tff_sharing *const how = m->how;
    const tff_real price = (m->still != 0) ? 0 : how->price;
    tff_real move[TFF_MOST_TENDONS] = { 0 }; /* of each tension as its own condition alone asks, */
    tff_real gives[TFF_MOST_TENDONS] = { 0 }; /* and per unit of a slope of its price */
    int of_row[TFF_MOST_ROWS];
    const int rows = tff_plain(m, plain, of_row);
    tff_real went[TFF_MOST_TENDONS] = { 0 };
    tff_real damping = 1;
    tff_real least = TFF_SHARE_LOST; /* of all moves so far */
    int k;
    int t;
    int i;
    int j;
    for (k = 0; (k < TFF_SHARE_MOVES) && (m->evaluations < m->most); k++) {
        tff_real turned = 0;
        tff_real before = 0;
        tff_real most = 0;
        tff_all_back(m, u, 0);
        (void)tff_missing(m, by, TFF_MOST_TENDONS, b, of_row);
        for (t = 0; t < m->count; t++) {
            tff_real slope = price * (u[t] - m->last[t]);
            tff_real of_u = 0;
            tff_real of_slope = 1;
            tff_real off;
            for (i = 0; i < rows; i++) {
                slope += plain[(i * TFF_MOST_TENDONS) + t] * m->worth[of_row[i]];
            }
            off = -slope;
            if (m->loose[t] != 0) { /* no tension: pinned */
                of_u = 1;
                of_slope = 0;
                off = -u[t];
            } else if (how->shares[t] != 0) { /* room and the saving of less tension: neither negative, their product `smooth` */
                const tff_real room = u[t] - how->least;
                const tff_real saving = 1 + slope;
                const tff_real size = TFF_SQRT(((room * room) + (saving * saving)) + (2 * how->smooth));
                of_u = tff_short_of(room, (saving * saving) + (2 * how->smooth), size);
                of_slope = tff_short_of(saving, (room * room) + (2 * how->smooth), size);
                off = ((room + saving) > 0) ? (2 * (how->smooth - (room * saving))) / (size + (room + saving)) : (size - (room + saving));
            } else {
                /* bound to the others on its drum */
            }
            of_u += of_slope * price;
            of_u = (of_u > TFF_SHARE_STIFF) ? of_u : TFF_SHARE_STIFF;
            move[t] = off / of_u;
            gives[t] = of_slope / of_u;
        }
        for (i = 0; i < rows; i++) {
            tff_real *const own = &by[i * TFF_MOST_TENDONS];
            b[i] = -b[i];
            for (t = 0; t < m->count; t++) {
                b[i] += own[t] * move[t];
                own[t] *= gives[t];
            }
            for (j = 0; j < rows; j++) {
                const tff_real *const its = &plain[j * TFF_MOST_TENDONS];
                tff_real sum = 0;
                for (t = 0; t < m->count; t++) {
                    sum += own[t] * its[t];
                }
                a[(i * TFF_MOST_ROWS) + j] = sum;
            }
        }
        if (tff_dense(a, TFF_MOST_ROWS, b, rows) == 0) {
            return 0;
        }
        for (t = 0; t < m->count; t++) {
            tff_real size;
            for (i = 0; i < rows; i++) {
                move[t] -= gives[t] * (plain[(i * TFF_MOST_TENDONS) + t] * b[i]);
            }
            size = TFF_FABS(move[t]) / (1 + TFF_FABS(u[t]));
            most = (size <= most) ? most : size; /* this way round NaN counts */
            turned += move[t] * went[t];
            before += went[t] * went[t];
            went[t] = move[t];
        }
        if (!(most < TFF_SHARE_LOST)) {
            return 0;
        }
        damping = tff_damped(damping, turned, before);
        for (t = 0; t < m->count; t++) {
            const tff_real to = u[t] + (damping * move[t]);
            const tff_real lowest = TFF_HALF * how->least; /* near slack there are no slopes to go by, and no answer */
            u[t] = ((how->shares[t] != 0) && (to < lowest)) ? lowest : to;
        }
        for (i = 0; i < rows; i++) {
            m->worth[of_row[i]] += damping * b[i];
        }
        if ((most <= TFF_SHARE_TOLERANCE) || ((most <= TFF_SHARE_ROUNDING) && (most > (TFF_HALF * least)))) {
            return 1; /* or rounding leaves no less */
        }
        if ((most <= TFF_SHARE_NEAR) && ((most * most) <= (TFF_SHARE_TOLERANCE * least)) && !(damping < 1)) {
            tff_all_back(m, u, 0); /* the next move would be as much less again */
            return 1;
        }
        least = (most < least) ? most : least;
    }
    return 0;
}

/* Tensions near u that balance all torques and close all drums, where those of the least price do not: there masses that
 * turn have friction that outweighs what the price knows of the arms. Newton's method of least change, of those least on
 * which masses turn, halved until the balances come nearer. Returns 0 where there are none, or one would be below the least tension. */
static int tff_nearest(tff_balance *m, tff_real *u)
{
    static const int stride = TFF_MOST_EQUATIONS;
    tff_real a[TFF_MOST_EQUATIONS * TFF_MOST_EQUATIONS];
    tff_real by[TFF_MOST_EQUATIONS * TFF_MOST_EQUATIONS];
    tff_real b[TFF_MOST_EQUATIONS];
    int of_row[TFF_MOST_EQUATIONS];
    tff_real kept[TFF_MOST_TENDONS];
    tff_real move[TFF_MOST_TENDONS];
    tff_real ease[TFF_MOST_TENDONS] = { 0 }; /* 1: its torques follow its tension as without friction; small: masses turn */
    tff_real held = 0;
    tff_real damping = 1;
    int k;
    int t;
    int i;
    int j;
    for (t = 0; t < m->count; t++) {
        ease[t] = (m->loose[t] != 0) ? 0 : 1;
    }
    for (k = 0; (k < (2 * TFF_SHARE_MOVES)) && (m->evaluations < m->most); k++) {
        int rows;
        tff_real off = 0;
        tff_all_back(m, u, 0);
        rows = tff_missing(m, by, stride, b, of_row);
        for (i = 0; i < rows; i++) {
            off += b[i] * b[i];
        }
        for (t = 0; t < m->count; t++) {
            tff_real flat = 0;
            tff_real steep = 0;
            for (i = 0; i < m->balanced; i++) {
                const tff_real arm = m->strands[t].arm[i] / m->scale[i];
                const tff_real rise = m->strands[t].torque_by[i] / m->scale[i];
                flat += arm * arm;
                steep += rise * rise;
            }
            ease[t] = ((ease[t] * steep) > flat) ? flat / steep : ease[t];
        }
        if ((k > 0) && !(off < held)) {
            damping *= TFF_HALF;
        } else {
            tff_real most = 0;
            int room = 1;
            held = off;
            for (i = 0; i < rows; i++) {
                for (j = 0; j < rows; j++) {
                    tff_real sum = 0;
                    for (t = 0; t < m->count; t++) {
                        sum += ease[t] * (by[(i * stride) + t] * by[(j * stride) + t]);
                    }
                    a[(i * stride) + j] = sum;
                }
            }
            if (tff_dense(a, stride, b, rows) == 0) {
                return 0;
            }
            for (t = 0; t < m->count; t++) {
                tff_real size;
                kept[t] = u[t];
                move[t] = 0;
                for (i = 0; i < rows; i++) {
                    move[t] += ease[t] * (by[(i * stride) + t] * b[i]);
                }
                size = TFF_FABS(move[t]) / (1 + TFF_FABS(u[t]));
                most = (size <= most) ? most : size; /* this way round NaN counts */
                room &= ((m->how->shares[t] == 0) || (u[t] >= m->how->least)) ? 1 : 0;
            }
            if (most <= TFF_SHARE_TOLERANCE) {
                return room;
            }
            damping = tff_damped(damping, 1, 0);
        }
        for (t = 0; t < m->count; t++) {
            u[t] = kept[t] + (damping * move[t]);
        }
    }
    return 0;
}

/* Tensions of a step, with the set of tendons that hang loose in loops. */
static int tff_tensions_of(tff_balance *m, tff_real *u, tff_real *slack)
{
    const tff_sharing *const how = m->how;
    int round;
    int t;
    for (round = 0; round < (2 * TFF_MOST_TENDONS); round++) {
        int flip = -1;
        tff_real worst = 0;
        if ((tff_share(m, u) == 0) && (tff_nearest(m, u) == 0)) {
            return 0;
        }
        for (t = 0; t < m->count; t++) {
            slack[t] = 0;
            if ((how->shares[t] == 0) && (m->loose[t] == 0) && (u[t] < worst)) {
                worst = u[t];
                flip = t;
            }
        }
        for (t = 0; t < m->count; t++) {
            const int other = how->partner[t];
            if ((other >= 0) && ((m->loose[t] != 0) != (m->loose[other] != 0))) {
                const int hangs = (m->loose[t] != 0) ? t : other;
                const tff_real open = tff_open(m, t, other);
                /* length of the hanging one that the drum has not taken in */
                slack[hangs] = (hangs == t) ? open * how->winding_m[t] : -open * how->winding_m[other];
                if ((slack[hangs] < 0) && (flip < 0)) {
                    flip = hangs;
                }
            }
        }
        if (flip < 0) {
            return 1;
        }
        m->loose[flip] = (m->loose[flip] != 0) ? 0 : 1;
        u[flip] = 0;
    }
    return 0;
}

/* What finds the unknowns of a step. */
static int tff_solved(tff_balance *m, tff_real *u, tff_real *slack)
{
    const int follows = ((m->led < m->balanced) || (m->wound_m != NULL)) ? 1 : 0;
    const int found = (follows != 0) ? tff_follow(m, u) : tff_tensions_of(m, u, slack);
    int t;
    for (t = 0; (m->wound_m != NULL) && (t < m->count); t++) {
        slack[t] = ((m->loose[t] != 0) && (tff_unwound(m, t) > 0)) ? tff_unwound(m, t) : 0;
    }
    return found;
}

/* Advance to the positions of bodies that are wanted at the end of a step while bodies give torques to what they touch;
 * `fresh`: there is no earlier state, or the first row of the scheme is for steps of other lengths. z, z_old: bodies x 3;
 * u: tensions; slack: length that hangs loose. Returns 0 where there are no such tensions; then no state has changed. */
static int tff_balance_step(tff_balance *m, int fresh, const tff_real *wanted, const tff_real *effort, tff_real *z, tff_real *z_old, tff_real *u, tff_real *slack)
{
    const int scheme = (fresh != 0) ? 0 : 1;
    int b;
    int k;
    int i;
    for (b = 0; b < m->bodies; b++) {
        const tff_real stood = z[(3 * b) + 1];
        const int own = ((b >= m->led) && (b < m->balanced)) ? 1 : 0;
        m->position[b] = (own != 0) ? stood + ((scheme != 0) ? stood - z_old[(3 * b) + 1] : 0) : wanted[b];
        m->effort[b] = effort[b];
    }
    for (k = 0; k < m->count; k++) {
        tff_strand_base(&m->strands[k], scheme, 0);
        tff_strand_at(&m->strands[k], m->bodies, m->position);
        u[k] = m->last[k] + ((scheme != 0) ? m->last[k] - m->past[k] : 0); /* as the last step went on */
        slack[k] = 0;
    }
    for (i = 0; i < (3 * m->bodies); i++) {
        m->z_base[i] = z[i] + (m->strands[0].c->carry * (z[i] - z_old[i]));
    }
    for (b = 0; b < m->bodies; b++) {
        tff_torque_wanted(m, b);
    }
    if (tff_solved(m, u, slack) == 0) {
        return 0;
    }
    for (k = 0; k < m->count; k++) {
        m->past[k] = m->last[k];
        m->last[k] = u[k];
        tff_strand_end(&m->strands[k]);
    }
    for (i = 0; i < (3 * m->bodies); i++) {
        z_old[i] = z[i];
        z[i] = m->found[i];
    }
    return 1;
}

#endif
