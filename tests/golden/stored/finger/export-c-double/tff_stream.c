/* tff_stream.c: see tff_stream.h.
 *
 * Scenario "robot finger: polymer tendon on six 30 degree arcs", hash 6b567c7d1473e421, level presliding.
 * Written by tendonff VERSION export-c --precision double --prefix tff.
 * The licence of tendonff does not cover what it writes: this file is yours.
 */
#include "tff_stream.h"

#define TFF_STREAM_LARGEST_N 1e+30

static void tff_stream_start(tff_stream *self)
{
    int32_t j;

    self->output = self->inverse.output;
    self->low = 5.7798712817485942;
    self->high = 55.244025743650283;
    tff_entry_init(&self->entry, self->inverse.start);
    for (j = 0; j < TFF_STREAM_LINE; j++) {
        self->line[j] = self->inverse.start;
    }
    self->centre = self->inverse.start;
    self->newest = 0;
    self->passed = self->inverse.start;
}

void tff_stream_init(tff_stream *self, tff_real initial_tension)
{
    tff_inverse_init(&self->inverse, initial_tension);
    tff_stream_start(self);
}

void tff_stream_init_at(tff_stream *self, tff_real tension, tff_real force)
{
    tff_inverse_init_at(&self->inverse, tension, force);
    tff_stream_start(self);
    tff_entry_lose(&self->entry, self->inverse.entry.lost);
}

void tff_stream_missed(tff_stream *self, int32_t samples)
{
    tff_entry_lose(&self->entry, samples);
}

/* A reference that can be followed: in range, and led back smoothly after it was lost. */
static uint32_t tff_stream_take(tff_stream *self, tff_real reference)
{
    uint32_t status = tff_held(reference);

    if (tff_is_within(reference, -TFF_STREAM_LARGEST_N, TFF_STREAM_LARGEST_N) == 0) {
        tff_entry_lose(&self->entry, 1); /* not a number, or infinite: time goes on with the last one */
    } else if (reference < self->low) {
        (void)tff_entry_take(&self->entry, self->low);
    } else if (reference > self->high) {
        (void)tff_entry_take(&self->entry, self->high);
    } else {
        (void)tff_entry_take(&self->entry, reference);
        status = TFF_OK;
    }
    return status;
}

/* The smoothed reference: weights over what has arrived, relative to the newest of them, so that a constant stays one. */
static tff_real tff_stream_smooth(const tff_stream *self)
{
    static const tff_real weight[TFF_STREAM_TAPS] = { NUMBERS };
    const int32_t oldest = self->newest + 1;
    const int32_t last = oldest + (TFF_STREAM_TAPS - 1);
    const tff_real base = self->line[(last < TFF_STREAM_LINE) ? last : (last - TFF_STREAM_LINE)];
    tff_real sum = 0.0;
    int32_t j;

    for (j = 0; j < TFF_STREAM_TAPS; j++) {
        const int32_t at = oldest + j;
        sum += weight[j] * (self->line[(at < TFF_STREAM_LINE) ? at : (at - TFF_STREAM_LINE)] - base);
    }
    return base + sum;
}

int32_t tff_stream_use(tff_stream *self, const tff_parameters *given)
{
    const int32_t good = tff_inverse_use(&self->inverse, given);

    if (good != 0) {
        self->low = given->reference_min;
        self->high = given->reference_max;
        if (tff_is_within(self->entry.last, self->low, self->high) == 0) {
            tff_entry_lose(&self->entry, TFF_RE_ENTRY); /* led inside */
        }
    }
    return good;
}

static tff_real tff_stream_sample(tff_stream *self, tff_real reference)
{
    const uint32_t status = tff_stream_take(self, reference);
    const tff_real above = self->entry.last - TFF_STREAM_BAND_N;
    const tff_real below = self->entry.last + TFF_STREAM_BAND_N;
    tff_real force;

    self->centre = (self->centre < above) ? above : self->centre;
    self->centre = (self->centre > below) ? below : self->centre;
    self->newest = (self->newest < (TFF_STREAM_LINE - 1)) ? (self->newest + 1) : 0;
    self->line[self->newest] = self->centre;
    force = tff_inverse_step(&self->inverse, tff_stream_smooth(self));
    self->output = self->inverse.output;
    self->output.status |= status;
    self->inverse.output.seen |= status;
    self->output.seen = self->inverse.output.seen;
    return force;
}

/* The next samples are on the way from what was passed now. */
static void tff_stream_pass(tff_stream *self, tff_real reference)
{
    if (tff_is_within(reference, -TFF_STREAM_LARGEST_N, TFF_STREAM_LARGEST_N) != 0) {
        const tff_real raised = (reference < self->low) ? self->low : reference;

        self->passed = (raised > self->high) ? self->high : raised;
    }
}

tff_real tff_stream_step(tff_stream *self, tff_real reference)
{
    tff_real force;

    if (self->entry.waiting > 0.0) {
        force = tff_stream_step_dt(self, TFF_STEP_S, reference);
    } else {
        force = tff_stream_sample(self, reference);
        tff_stream_pass(self, reference);
    }
    return force;
}

tff_real tff_stream_step_dt(tff_stream *self, tff_real dt_s, tff_real reference)
{
    tff_span span = tff_span_of(&self->entry, dt_s);
    tff_real answer = self->output.force;

    tff_stream_missed(self, span.missed);
    while (tff_span_next(&span) != 0) {
        answer = tff_stream_sample(self, tff_on_the_way(reference, self->passed, span.rest));
    }
    if (span.samples == 0) {
        tff_stream_pass(self, reference);
    } else {
        (void)tff_output_hold(&self->output, TFF_INPUT_HELD);
        self->inverse.output.seen |= TFF_INPUT_HELD;
    }
    return answer;
}
