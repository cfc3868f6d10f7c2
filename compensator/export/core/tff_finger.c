/* tff_finger.c: see tff_finger.h. Fixed text; its numbers stand in tff_finger_data.h, its laws in tff_finger_laws.h. */
#include "tff_finger.h"

#include <math.h>
#include <stddef.h>

#include "tff_finger_laws.h"
#include "tff_core.h"

typedef struct {
    tff_real change_rad;   /* largest change of its command in a sample */
    tff_real torque_max_N_m;
    tff_real lag;          /* of its servo, in samples */
    tff_real play_rad;     /* half the play of its gear, */
    tff_real turning_rad;  /* and the way back that counts as a reversal */
    tff_real gives;        /* angle by which gear and servo give way to a torque [rad/(N m)] */
} tff_finger_motor;

typedef struct {
    int bodies;                    /* joints, */
    int wanted;                    /* of which the first so many have a reference */
    int tendons, motors;
    const tff_body *body;
    const tff_tendon *tendon;
    const tff_finger_motor *motor;
    const int *motor_of;           /* by tendon */
    const tff_real *scale_m;       /* a moment arm of each joint */
    const tff_real *least_rad, *most_rad; /* angles that are accepted; of joints that follow, where a search starts */
    tff_sharing sharing;           /* for steps of the usual length */
} tff_finger_record;

#include "tff_finger_data.h"

/* The header's numbers are those of the largest tendon and finger: this does not compile where they are not. */
typedef char tff_finger_states_fit[(TFF_FINGER_STATES >= TFF_STATE_REALS(TFF_FINGER_MASSES)) ? 1 : -1];
typedef char tff_finger_memory_fits[(TFF_FINGER_MEMORY >= TFF_STRAND_REALS(TFF_FINGER_MASSES, TFF_FINGER_BODIES)) ? 1 : -1];
typedef char tff_finger_worth_fits[(TFF_FINGER_EQUATIONS == TFF_MOST_EQUATIONS) ? 1 : -1];

/* Views of the state for one call. */
typedef struct {
    const tff_finger_record *record;
    tff_tendon given[TFF_FINGER_TENDONS];
    tff_strand strands[TFF_FINGER_TENDONS];
    tff_balance m;
} tff_finger_view;

static int tff_finger_within(tff_real value, tff_real low, tff_real high)
{
    return ((value >= low) && (value <= high)) ? 1 : 0; /* 0 for NaN too */
}

static void tff_finger_views(tff_finger *self, tff_finger_view *v)
{
    const tff_finger_record *const r = &tff_finger_records[self->which];
    int k;
    int i;
    v->record = r;
    for (k = 0; k < r->tendons; k++) {
        v->given[k] = r->tendon[k];
        v->given[k].start_m = self->start_m[k];
        v->given[k].x = self->x[k];
        v->given[k].x_old = self->x_old[k];
        v->given[k].memory = self->memory[k];
        (void)tff_strand_of(&v->given[k], r->bodies, v->given[k].chain, &v->strands[k]);
        for (i = 0; i < self->turn; i++) {
            tff_strand_turn(&v->strands[k]);
        }
    }
    v->m.body = r->body;
    v->m.strands = v->strands;
    v->m.how = &r->sharing;
    v->m.scale = r->scale_m;
    v->m.bodies = r->bodies;
    v->m.balanced = r->bodies;
    v->m.led = r->wanted;
    v->m.count = r->tendons;
    v->m.still = 0;
    v->m.last = self->last;
    v->m.past = self->past;
    v->m.worth = self->worth;
    v->m.loose = self->loose;
    v->m.wound_m = NULL;
    v->m.gives = NULL;
    v->m.motor_of = r->motor_of;
    v->m.evaluations = 0;
    v->m.most = TFF_MOST_EVALUATIONS;
}

/* Nothing is known of what balances are worth, and no tendon hangs. */
static void tff_finger_forget(tff_finger *self)
{
    int k;
    for (k = 0; k < TFF_FINGER_EQUATIONS; k++) {
        self->worth[k] = 0;
    }
    for (k = 0; k < TFF_FINGER_TENDONS; k++) {
        self->loose[k] = 0;
    }
}

/* The joints stand where they are: what stopped them is not the tendons' affair. */
static void tff_finger_settle(tff_finger *self)
{
    int b;
    for (b = 0; b < TFF_FINGER_BODIES; b++) {
        self->z[3 * b] = 0;
        self->z_old[3 * b] = 0;
        self->z_old[(3 * b) + 1] = self->z[(3 * b) + 1];
    }
    self->fresh = 1;
}

/* Sum of what the path has gained in length. */
static tff_real tff_finger_gained(const tff_real *row, int n)
{
    tff_real sum = 0;
    int i;
    for (i = (2 * n) + 1; i <= ((3 * n) + 1); i++) {
        sum += row[i];
    }
    return sum;
}

/* Position of the near end from lengths as they are: rounding adds up nowhere. */
static void tff_finger_anchor(const tff_finger *self, const tff_strand *s, int k)
{
    tff_real *const x = s->given->x;
    const int n = s->given->chain->count;
    tff_real sum = x[TFF_AT_FAR(n)] - (tff_finger_gained(s->old, n) - self->gained_m[k]);
    int i;
    for (i = 0; i <= n; i++) {
        sum += x[TFF_AT_E(n) + i];
    }
    x[TFF_AT_NEAR(n)] = sum;
}

/* Commands of the motors after a step: its play and lag taken back, within its speed. After a loss of the reference they
 * set out from where they were. `samples`: time since the last one, `ratio` that over the time before. */
static void tff_finger_tell(tff_finger *self, const tff_real *drum_rad, tff_real samples, tff_real ratio, int again)
{
    const tff_finger_record *const r = &tff_finger_records[self->which];
    const tff_real now = (1 + (ratio + ratio)) / (1 + ratio);
    const tff_real then = (ratio * ratio) / (1 + ratio);
    int k;
    for (k = 0; k < r->motors; k++) {
        self->motor_torque_N_m[k] = 0;
    }
    for (k = 0; k < r->tendons; k++) { /* a drum that holds a loose end holds nothing */
        self->motor_torque_N_m[r->motor_of[k]] += (self->drum_N[k] > 0) ? (self->drum_N[k] * r->sharing.winding_m[k]) : 0;
    }
    for (k = 0; k < r->motors; k++) {
        const tff_finger_motor *const own = &r->motor[k];
        const tff_real change_rad = own->change_rad * samples;
        const tff_real motor_rad = drum_rad[k] + (own->gives * (self->motor_torque_N_m[k] - self->rest_N_m[k]));
        const tff_real lead = (own->lag / samples) * ((now * (motor_rad - self->motor_rad[k])) - (then * (self->motor_rad[k] - self->before_rad[k])));
        const tff_real gone = motor_rad - self->furthest[k];
        const int ahead = ((gone * self->side[k]) > 0) ? 1 : 0;
        const int turned = (TFF_FABS(gone) > own->turning_rad) ? 1 : 0;
        tff_real command;
        if ((turned != 0) && (ahead == 0)) {
            self->side[k] = (gone > 0) ? (tff_real)1 : (tff_real)-1;
        }
        if ((turned != 0) || (ahead != 0)) {
            self->furthest[k] = motor_rad;
        }
        command = motor_rad + (self->side[k] * own->play_rad) + lead;
        self->apart_rad[k] = (again != 0) ? (self->command_rad[k] - command) : self->apart_rad[k];
        command += self->back * self->apart_rad[k];
        if ((command - self->command_rad[k]) > change_rad) {
            command = self->command_rad[k] + change_rad;
            self->status |= TFF_SPEED_LIMITED;
        } else if ((self->command_rad[k] - command) > change_rad) {
            command = self->command_rad[k] - change_rad;
            self->status |= TFF_SPEED_LIMITED;
        } else {
            /* within its speed */
        }
        self->before_rad[k] = self->motor_rad[k];
        self->motor_rad[k] = motor_rad;
        self->command_rad[k] = command;
        if (tff_finger_within(self->motor_torque_N_m[k], -own->torque_max_N_m, own->torque_max_N_m) == 0) {
            self->status |= TFF_TORQUE_LIMITED;
        }
    }
}

/* The state of a finger that is not ready. */
static void tff_finger_blank(tff_finger *self)
{
    int k;
    self->status = TFF_OK;
    self->seen = TFF_OK;
    self->evaluations = 0;
    self->fresh = 3;
    self->lost = 0;
    self->turn = 0;
    self->least_N = 0;
    self->slack_m = 0;
    self->step_s = 0;
    self->waiting_s = 0;
    self->left_s = 0;
    self->back = 0;
    for (k = 0; k < TFF_FINGER_MOTORS; k++) {
        self->command_rad[k] = 0;
        self->motor_rad[k] = 0;
        self->motor_torque_N_m[k] = 0;
        self->before_rad[k] = 0;
        self->rest_N_m[k] = 0;
        self->furthest[k] = 0;
        self->side[k] = 0;
        self->apart_rad[k] = 0;
    }
    for (k = 0; k < TFF_FINGER_TENDONS; k++) {
        self->tension_N[k] = 0;
        self->drum_N[k] = 0;
        self->last[k] = 0;
        self->past[k] = 0;
        self->start_m[k] = 0;
        self->gained_m[k] = 0;
    }
    for (k = 0; k < TFF_FINGER_BODIES; k++) {
        self->joint_rad[k] = 0;
        self->held_rad[k] = 0;
        self->torque_N_m[k] = 0;
    }
    for (k = 0; k < (3 * TFF_FINGER_BODIES); k++) {
        self->z[k] = 0;
        self->z_old[k] = 0;
    }
    tff_finger_forget(self);
}

/* What is wrong with joints and torques: 0, or the bit of the status that says so. */
static uint32_t tff_finger_bad(const tff_finger *self, const tff_real *joint_rad, const tff_real *torque_N_m)
{
    const tff_finger_record *const r = &tff_finger_records[self->which];
    uint32_t bad = TFF_OK;
    int b;
    for (b = 0; b < r->wanted; b++) {
        if ((tff_finger_within(joint_rad[b], r->least_rad[b], r->most_rad[b]) == 0) || (tff_finger_within(torque_N_m[b], -(tff_real)1e6, (tff_real)1e6) == 0)) {
            const int finite = tff_finger_within(joint_rad[b], -(tff_real)1e30, (tff_real)1e30) & tff_finger_within(torque_N_m[b], -(tff_real)1e30, (tff_real)1e30);
            bad |= (finite != 0) ? TFF_RANGE : TFF_INPUT_HELD;
        }
    }
    return ((bad & TFF_INPUT_HELD) != 0u) ? TFF_INPUT_HELD : bad;
}

/* A tendon at rest under a tension, where its path stands. */
static void tff_finger_still(tff_finger *self, tff_strand *s, int k, tff_real tension)
{
    const int n = s->given->chain->count;
    int i;
    int j;
    for (i = 0; i < TFF_FINGER_STATES; i++) {
        self->x[k][i] = 0;
    }
    for (i = 0; i < TFF_PLACE_REALS(n); i++) {
        s->old[i] = s->now[i];
        s->before[i] = s->now[i];
    }
    for (i = 0; i <= n; i++) {
        for (j = 0; j <= TFF_LINK_STATES; j++) { /* elongation, and the links' own states */
            self->x[k][TFF_AT_E(n) + (j * (n + 1)) + i] = (s->given->chain->compliance * tension) / s->now[n + i];
        }
    }
    self->x[k][TFF_AT_FAR(n)] = s->now[(3 * n) + 2];
    self->gained_m[k] = tff_finger_gained(s->now, n);
    tff_finger_anchor(self, s, k);
    self->start_m[k] = self->x[k][TFF_AT_NEAR(n)];
    for (i = 0; i < TFF_FINGER_STATES; i++) {
        self->x_old[k][i] = self->x[k][i];
    }
}

int32_t tff_finger_init_at(tff_finger *self, int which, const tff_real joint_rad[], const tff_real torque_N_m[])
{
    tff_finger_view v;
    tff_real still_rad[TFF_FINGER_MOTORS] = { 0 };
    int good = ((which >= 0) && (which < TFF_FINGER_NUMBER)) ? 1 : 0;
    int k;
    int b;

    self->which = (good != 0) ? which : 0;
    tff_finger_blank(self);
    good = ((good != 0) && (tff_finger_bad(self, joint_rad, torque_N_m) == TFF_OK)) ? 1 : 0;
    if (good != 0) {
        tff_finger_views(self, &v);
        v.m.still = 1;
        for (b = 0; b < v.record->bodies; b++) {
            const int own = (b < v.record->wanted) ? 1 : 0;
            v.m.position[b] = (own != 0) ? joint_rad[b] : v.record->least_rad[b];
            v.m.effort[b] = (own != 0) ? torque_N_m[b] : 0;
            v.m.z_base[3 * b] = 0;
            v.m.z_base[(3 * b) + 1] = v.m.position[b];
            v.m.z_base[(3 * b) + 2] = 0;
            self->torque_N_m[b] = v.m.effort[b];
            tff_torque_wanted(&v.m, b);
        }
        for (k = 0; k < v.record->tendons; k++) {
            tff_strand_clear(&v.strands[k], v.record->bodies);
            tff_strand_place(&v.strands[k], v.record->bodies, v.m.position);
            self->last[k] = (v.record->sharing.shares[k] != 0) ? v.record->sharing.least + (5 * v.record->sharing.smooth) : v.record->sharing.pretension[k];
        }
        good = (v.record->wanted < v.record->bodies) ? tff_follow(&v.m, self->last) : tff_share(&v.m, self->last);
        for (k = 0; k < v.record->tendons; k++) {
            good &= tff_finger_within(self->last[k], 0, (tff_real)1e30);
        }
    }
    if (good != 0) {
        self->least_N = self->last[0];
        for (k = 0; k < v.record->tendons; k++) {
            tff_finger_still(self, &v.strands[k], k, self->last[k]);
            self->past[k] = self->last[k];
            self->tension_N[k] = self->last[k];
            self->drum_N[k] = self->last[k];
            self->rest_N_m[v.record->motor_of[k]] += self->last[k] * v.record->sharing.winding_m[k];
            self->least_N = (self->last[k] < self->least_N) ? self->last[k] : self->least_N;
        }
        for (b = 0; b < v.record->bodies; b++) {
            self->joint_rad[b] = v.m.position[b];
            self->z[(3 * b) + 1] = v.m.position[b];
            self->z_old[(3 * b) + 1] = v.m.position[b];
        }
        tff_finger_forget(self);
        tff_finger_tell(self, still_rad, 1, 1, 0);
        self->fresh = 2;
    }
    return good;
}

int32_t tff_finger_init(tff_finger *self, int which, const tff_real joint_rad[])
{
    const tff_real none[TFF_FINGER_BODIES] = { 0 };
    return tff_finger_init_at(self, which, joint_rad, none);
}

/* A step of the model over a time [s], `again` after a loss of the reference; 0 where it has no answer: the joints then
 * stand. Backwards from the joints, or forwards from the motors: the other of both is null. */
static int tff_finger_advance(tff_finger *self, tff_real step_s, const tff_real *joint_rad, const tff_real *driven_rad, int again)
{
    const tff_real before_s = (self->fresh != 0) ? 0 : self->step_s;
    const int usual = ((tff_finger_within(step_s, TFF_STEP_S, TFF_STEP_S) != 0) && ((self->fresh != 0) || (tff_finger_within(before_s, TFF_STEP_S, TFF_STEP_S) != 0))) ? 1 : 0;
    tff_weights own[TFF_FINGER_TENDONS];
    tff_finger_view v;
    tff_sharing how;
    tff_real u[TFF_FINGER_TENDONS];
    tff_real slack[TFF_FINGER_TENDONS];
    tff_real motor_rad[TFF_FINGER_MOTORS] = { 0 };
    tff_real loosest[TFF_FINGER_MOTORS];
    tff_real wound_m[TFF_FINGER_TENDONS];
    tff_real gives[TFF_FINGER_TENDONS];
    int k;
    int b;
    int i;

    tff_finger_views(self, &v);
    for (k = 0; (driven_rad != NULL) && (k < v.record->tendons); k++) {
        const int motor = v.record->motor_of[k];
        gives[k] = v.record->motor[motor].gives;
        wound_m[k] = (driven_rad[motor] + (gives[k] * self->rest_N_m[motor])) * v.record->sharing.winding_m[k];
        v.m.wound_m = wound_m;
        v.m.gives = gives;
        v.m.led = 0;
        v.m.most = TFF_MOST_EVALUATIONS * (1 + TFF_FINGER_BODIES); /* slopes over the joints are differences */
    }
    if (usual == 0) {
        how = v.record->sharing;
        how.price = (how.price * TFF_STEP_S) / step_s;
        v.m.how = &how;
        for (k = 0; k < v.record->tendons; k++) {
            tff_reweigh(v.given[k].chain, step_s, before_s, &own[k]);
            v.strands[k].rows = &own[k];
        }
    }
    i = tff_balance_step(&v.m, ((usual == 0) || (self->fresh != 0)) ? 1 : 0, joint_rad, self->torque_N_m, self->z, self->z_old, u, slack);
    self->evaluations = (int32_t)v.m.evaluations;
    if (i == 0) {
        self->status |= TFF_FAILED;
        tff_finger_settle(self);
        tff_finger_forget(self);
        return 0;
    }
    self->turn = (self->turn + 1) % 3;
    self->fresh = 0;
    self->step_s = step_s;
    self->slack_m = 0;
    self->least_N = v.strands[0].w.force[0];
    for (b = 0; b < v.record->bodies; b++) {
        self->joint_rad[b] = v.m.position[b];
    }
    for (k = 0; k < v.record->motors; k++) {
        loosest[k] = -1;
    }
    for (k = 0; k < v.record->tendons; k++) {
        const tff_strand *const s = &v.strands[k];
        const int n = s->given->chain->count;
        const int motor = v.record->motor_of[k];
        tff_finger_anchor(self, s, k);
        if ((loosest[motor] < 0) || (slack[k] < loosest[motor])) { /* the tightest tendon says where its drum stands */
            loosest[motor] = slack[k];
            motor_rad[motor] = (self->x[k][TFF_AT_NEAR(n)] - self->start_m[k]) / v.record->sharing.winding_m[k];
        }
        self->slack_m = (slack[k] > self->slack_m) ? slack[k] : self->slack_m;
        self->tension_N[k] = u[k];
        self->drum_N[k] = s->drum_N;
        for (i = 0; i <= n; i++) {
            self->least_N = (s->w.force[i] < self->least_N) ? s->w.force[i] : self->least_N;
        }
    }
    if (self->slack_m > 0) {
        self->status |= TFF_SLACK;
    } else if (self->least_N <= 0) {
        self->status |= (driven_rad != NULL) ? TFF_SLACK : TFF_WOULD_PUSH; /* a drum pays out, but does not push */
    } else {
        /* taut */
    }
    tff_finger_tell(self, motor_rad, step_s / TFF_STEP_S, (before_s > 0) ? (step_s / before_s) : (tff_real)1, again);
    for (k = 0; (driven_rad != NULL) && (k < v.record->motors); k++) {
        self->motor_rad[k] = driven_rad[k];
    }
    return 1;
}

/* A step after which the motors keep their commands: the joints stay at their last reference. */
static void tff_finger_stand(tff_finger *self, tff_real step_s)
{
    tff_real held[TFF_FINGER_MOTORS];
    tff_real at[TFF_FINGER_BODIES];
    int k;
    for (k = 0; k < TFF_FINGER_MOTORS; k++) {
        held[k] = self->command_rad[k];
    }
    for (k = 0; k < TFF_FINGER_BODIES; k++) {
        at[k] = self->z[(3 * k) + 1];
    }
    self->back = 0;
    tff_finger_settle(self);
    (void)tff_finger_advance(self, step_s, at, NULL, 0);
    self->status &= ~(uint32_t)TFF_SPEED_LIMITED; /* no new command */
    self->lost = 1;
    for (k = 0; k < TFF_FINGER_MOTORS; k++) {
        self->command_rad[k] = held[k];
    }
}

/* Follow a good reference, without a jump where it was lost before. */
static void tff_finger_follow(tff_finger *self, tff_real step_s, const tff_real *joint_rad, const tff_real *torque_N_m)
{
    const int wanted = tff_finger_records[self->which].wanted;
    const int again = self->lost;
    tff_real to[TFF_FINGER_BODIES] = { 0 };
    int b;
    self->back = 0;
    if (again != 0) {
        self->lost = 0;
        self->left_s = TFF_RE_ENTRY_S;
        for (b = 0; b < wanted; b++) {
            self->held_rad[b] = self->z[(3 * b) + 1];
        }
    }
    if (self->left_s > 0) { /* in speed and acceleration too */
        const tff_real place = self->left_s / TFF_RE_ENTRY_S;
        self->back = place * place * place * (10 + (place * ((6 * place) - 15)));
        self->left_s -= step_s;
    }
    for (b = 0; b < wanted; b++) {
        self->torque_N_m[b] = torque_N_m[b];
        to[b] = (self->back > 0) ? self->held_rad[b] + ((joint_rad[b] - self->held_rad[b]) * (1 - self->back)) : joint_rad[b];
    }
    if (tff_finger_advance(self, step_s, to, NULL, again) == 0) {
        self->lost = 1;
    }
}

uint32_t tff_finger_step(tff_finger *self, const tff_real joint_rad[], const tff_real torque_N_m[])
{
    return tff_finger_step_dt(self, TFF_STEP_S, joint_rad, torque_N_m);
}

uint32_t tff_finger_step_dt(tff_finger *self, tff_real dt_s, const tff_real joint_rad[], const tff_real torque_N_m[])
{
    const tff_real since = self->waiting_s + dt_s;
    tff_real step_s = (tff_finger_within(since, TFF_STEP_S * (1 - TFF_SAME_STEP), TFF_STEP_S * (1 + TFF_SAME_STEP)) != 0) ? TFF_STEP_S : since;
    const uint32_t held = tff_finger_bad(self, joint_rad, torque_N_m);
    const int good = (held == TFF_OK) ? 1 : 0;
    int moved = 0;
    int b;

    for (b = 0; (good != 0) && (b < tff_finger_records[self->which].wanted); b++) {
        moved |= (tff_finger_within(joint_rad[b], self->z[(3 * b) + 1], self->z[(3 * b) + 1]) != 0) ? 0 : 1;
    }
    self->status = TFF_OK;
    if (self->fresh == 3) {
        self->status = TFF_FAILED; /* init refused */
    } else if ((self->fresh == 2) && (good == 0)) {
        self->status = held;
    } else if ((self->fresh == 2) && (moved == 0)) {
        self->fresh = 1; /* the sample at t = 0: at rest */
    } else if (tff_finger_within(dt_s, 0, (tff_real)1e30) == 0) {
        self->status = TFF_INPUT_HELD; /* no time: nothing moves */
    } else if (since < TFF_STEP_MIN_S) {
        self->waiting_s = since; /* too short for a step of its own: counted with the next one */
    } else {
        self->waiting_s = 0;
        if (since > TFF_STEP_MAX_S) { /* a pause, in which the rig came to rest where it was */
            tff_finger_stand(self, TFF_STEP_MAX_S);
            step_s = TFF_STEP_S;
        }
        if (good == 0) {
            self->status |= held;
            tff_finger_stand(self, step_s);
        } else {
            tff_finger_follow(self, step_s, joint_rad, torque_N_m);
        }
    }
    self->seen |= self->status;
    return self->status;
}

uint32_t tff_finger_observe(tff_finger *self, tff_real dt_s, const tff_real motor_rad[], const tff_real torque_N_m[])
{
    const tff_finger_record *const r = &tff_finger_records[self->which];
    const tff_real since = self->waiting_s + dt_s;
    const int pause = (since > TFF_STEP_MAX_S) ? 1 : 0; /* in which the finger came to rest */
    int good = tff_finger_within(dt_s, 0, (tff_real)1e30);
    int k;

    for (k = 0; k < r->motors; k++) {
        good &= tff_finger_within(motor_rad[k], -(tff_real)1e6, (tff_real)1e6);
    }
    for (k = 0; k < r->wanted; k++) {
        good &= tff_finger_within(torque_N_m[k], -(tff_real)1e6, (tff_real)1e6);
    }
    self->status = TFF_OK;
    if (self->fresh == 3) {
        self->status = TFF_FAILED; /* init refused */
    } else if (good == 0) {
        self->status = TFF_INPUT_HELD;
    } else if (since < TFF_STEP_MIN_S) {
        self->waiting_s = since; /* too short for a step of its own: counted with the next one */
    } else {
        const int usual = tff_finger_within(since, TFF_STEP_S * (1 - TFF_SAME_STEP), TFF_STEP_S * (1 + TFF_SAME_STEP));
        const tff_real step_s = (usual != 0) ? TFF_STEP_S : since;
        self->waiting_s = 0;
        for (k = 0; k < r->wanted; k++) {
            self->torque_N_m[k] = torque_N_m[k];
        }
        if (pause != 0) {
            tff_finger_settle(self);
        }
        (void)tff_finger_advance(self, (pause != 0) ? TFF_STEP_MAX_S : step_s, self->joint_rad, motor_rad, 0);
        self->status &= ~(uint32_t)TFF_SPEED_LIMITED; /* no new command */
    }
    self->seen |= self->status;
    return self->status;
}
