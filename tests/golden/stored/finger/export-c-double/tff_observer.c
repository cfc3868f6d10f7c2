/* tff_observer.c: see tff_observer.h.
 *
 * Scenario "robot finger: polymer tendon on six 30 degree arcs", hash 6b567c7d1473e421, level presliding.
 * Written by tendonff VERSION export-c --precision double --prefix tff.
 * The licence of tendonff does not cover what it writes: this file is yours.
 */
#include "tff_observer.h"

#define TFF_OBSERVER_ADHESION_N 0.0
#define TFF_OBSERVER_NARROW 0.90849010156042365 /* e^-margin */
#define TFF_OBSERVER_WIDE 1.1007274578802773
#define TFF_OBSERVER_GAIN 0.20000000000000001        /* of the position's error that is taken for the far end, a sample */
#define TFF_OBSERVER_MOST_M 0.40900753650317923      /* largest error that is believed [m] */
#define TFF_OBSERVER_SLACK_M_PER_N 8.0500000000000005e-05 /* what a stiffness that is off explains */

/* Nothing good has arrived for so many samples: the output may be anything that a tendon carries. */
static void tff_observer_lose(tff_observer *self, int32_t samples)
{
    if (samples > 0) {
        tff_entry_lose(&self->entry, samples);
        self->blind = 1;
        self->output.low = 0.0;
        self->output.high = TFF_OBSERVER_INPUT_MAX_N;
    }
}

/* Bounds under an input tension [N]; `any`: of every history. */
static void tff_observer_enclose(tff_observer *self, tff_real tension, int32_t any)
{
    const tff_real lifted = tension + TFF_OBSERVER_ADHESION_N;
    const tff_real least = lifted * 0.47048921771981794;
    const tff_real most = lifted * 2.1254472203346269;
    tff_real low;
    tff_real high;

    if (any != 0) {
        self->low_memory = least;
        self->high_memory = most;
    } else {
        self->low_memory = tff_play(self->low_memory, least, lifted * 1.6531041517617928);
        self->high_memory = tff_play(self->high_memory, lifted * 0.60492256276427092, most);
    }
    self->blind = 0;
    low = self->low_memory;
    high = self->high_memory;
    low = (low * TFF_OBSERVER_NARROW) - TFF_OBSERVER_ADHESION_N;
    high = (high * TFF_OBSERVER_WIDE) - TFF_OBSERVER_ADHESION_N;
    low = (low < self->output.tension) ? low : self->output.tension;
    self->output.low = (low > 0.0) ? low : 0.0;
    self->output.high = (high > self->output.tension) ? high : self->output.tension;
}

void tff_observer_init(tff_observer *self, tff_real initial_tension)
{
    const tff_real tension = tff_tension_of(initial_tension, 0.0, TFF_OBSERVER_INPUT_MAX_N, TFF_REFERENCE_MIN_N, &self->output.status);

    self->output.seen = self->output.status;
    tff_state_init(&self->chain, tension);
    self->home = self->chain.x[28];
    self->start = tension;
    self->far = 0.0;
    self->homed = 1;
    self->evaluations = 0;
    tff_entry_init(&self->entry, tension);
    self->force = tension;
    self->blind = 0;
    self->low_memory = tension + TFF_OBSERVER_ADHESION_N;
    self->high_memory = self->low_memory;
    self->output.tension = tension;
    tff_observer_enclose(self, tension, 0);
}

void tff_observer_init_at(tff_observer *self, tff_real output_tension, tff_real input_tension)
{
    const int32_t known = tff_is_within(output_tension, 0.0, TFF_OBSERVER_INPUT_MAX_N);
    const tff_real tension = (known != 0) ? output_tension : input_tension;

    tff_observer_init(self, tension);
    if (tff_is_within(input_tension, 0.0, TFF_OBSERVER_INPUT_MAX_N) == 0) {
        self->output.status = TFF_INPUT_HELD;
        self->output.seen = TFF_INPUT_HELD;
        tff_observer_lose(self, TFF_RE_ENTRY);
    } else {
        if (tension > 0.0) {
            tff_state_carry(self->chain.x, self->chain.x_old, tension, input_tension);
        }
        self->force = input_tension;
        self->entry.last = input_tension;
        self->homed = 0;
        if (known == 0) {
            self->blind = 1;
        }
        tff_observer_enclose(self, input_tension, self->blind);
    }
}

/* After a step without a solution: in motion under this input tension [N], from the output that is held. */
static void tff_observer_start_over(tff_observer *self, tff_real tension)
{
    const tff_real held = self->output.tension;
    const tff_real waiting = self->entry.waiting;
    const uint32_t seen = self->output.seen;
    const int32_t evaluations = self->evaluations;

    tff_observer_init_at(self, (held > 0.0) ? held : tension, tension);
    self->chain.fresh = 1;
    self->evaluations = evaluations;
    self->entry.waiting = waiting;
    self->output.tension = held;
    self->output.seen = seen;
}

void tff_observer_missed(tff_observer *self, int32_t samples)
{
    tff_observer_lose(self, samples);
}

/* What the position [m] says beyond the chain: something else moves the far end. */
static int32_t tff_observer_compare(tff_observer *self, tff_real position, int32_t steps)
{
    const tff_real near = self->chain.x[28];
    int32_t moved = 0;

    if (tff_is_within(position, -TFF_OBSERVER_MOST_M, TFF_OBSERVER_MOST_M) != 0) {
        if (self->homed == 0) {
            self->home = near - position;
            self->start = self->force;
            self->homed = 1;
        } else {
            const tff_real share = TFF_OBSERVER_GAIN * (tff_real)steps;
            const tff_real error = position - (near - self->home);
            const tff_real change = (self->force > self->start) ? (self->force - self->start) : (self->start - self->force);
            const tff_real slack = TFF_OBSERVER_SLACK_M_PER_N * (change + (0.050000000000000003 * (self->start + TFF_OBSERVER_ADHESION_N)));

            self->far += ((share < 1.0) ? share : 1.0) * error;
            if (tff_is_within(self->far, -slack, slack) == 0) {
                moved = 1;
            }
        }
    }
    return moved;
}

/* Some steps, over which the input tension [N] goes straight from its last value to this one. */
static uint32_t tff_observer_advance(tff_observer *self, int32_t steps, tff_real tension)
{
    uint32_t status = TFF_OK;
    const tff_real from = self->force;
    const tff_real part = 1.0 / (tff_real)steps;
    int32_t k;
    for (k = 1; (k <= steps) && (status != TFF_FAILED); k++) {
        const tff_real share = (k < steps) ? ((tff_real)k * part) : 1.0;
        const tff_real force = from + ((tension - from) * share);
        const tff_chain_input now = { force, self->far, 1 };

        if (tff_chain_advance(&self->chain, &now, &self->output.tension, &self->evaluations) != 0) {
            self->force = force;
            if (self->output.tension <= 0.0) {
                status |= TFF_WOULD_PUSH;
            }
        } else {
            status = TFF_FAILED;
        }
    }
    return status;
}

static void tff_observer_say(tff_observer *self, uint32_t status)
{
    self->output.status = status;
    self->output.seen |= status;
}

/* Follow an input tension [N] that is good. */
static uint32_t tff_observer_follow(tff_observer *self, int32_t steps, tff_real tension, tff_real position)
{
    int32_t any = self->blind;
    uint32_t status = tff_observer_advance(self, steps, tff_entry_take(&self->entry, tension));

    if (status == TFF_FAILED) {
        tff_observer_start_over(self, tension);
        tff_observer_lose(self, 1);
    } else {
        if (tff_observer_compare(self, position, steps) != 0) {
            status |= TFF_OBSERVER_FAR_MOVED;
            any = 1;
        }
        tff_observer_enclose(self, tension, any);
    }
    return status;
}

static tff_real tff_observer_after(tff_observer *self, int32_t steps, tff_real input_tension, tff_real input_position)
{
    const tff_real tension = (input_tension > 0.0) ? input_tension : 0.0;
    uint32_t status = TFF_OK;

    self->evaluations = 0;
    if (tff_is_within(input_tension, -TFF_OBSERVER_INPUT_MAX_N, TFF_OBSERVER_INPUT_MAX_N) == 0) {
        status = TFF_INPUT_HELD;
        tff_observer_lose(self, 1);
    } else {
        if (tff_state_begins(&self->chain, tension, self->force) == 0) {
            status = tff_observer_follow(self, steps, tension, input_position);
        }
    }
    tff_observer_say(self, status);
    return self->output.tension;
}

tff_real tff_observer_step(tff_observer *self, tff_real input_tension, tff_real input_position)
{
    return (self->entry.waiting > 0.0) ? tff_observer_step_dt(self, TFF_STEP_S, input_tension, input_position) : tff_observer_after(self, 1, input_tension, input_position);
}

tff_real tff_observer_step_dt(tff_observer *self, tff_real dt_s, tff_real input_tension, tff_real input_position)
{
    tff_real samples = tff_samples(&self->entry.waiting, dt_s);
    const int32_t missed = tff_paused(samples);

    if (missed > 0) {
        tff_observer_missed(self, missed);
        samples = 1.0;
    }
    if (samples >= 1.0) {
        const int32_t steps = (int32_t)samples;

        self->entry.waiting = (samples - (tff_real)steps) * TFF_STEP_S;
        (void)tff_observer_after(self, steps, input_tension, input_position);
    } else { /* waits for the next call */
        if (samples > 0.0) {
            self->entry.waiting = samples * TFF_STEP_S;
        }
        tff_observer_say(self, (tff_is_within(dt_s, 0.0, TFF_STEP_MAX_S) != 0) ? TFF_OK : TFF_INPUT_HELD);
    }
    return self->output.tension;
}
