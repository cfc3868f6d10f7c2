/* tff_limits.c: see tff_limits.h.
 *
 * Scenario "robot finger: polymer tendon on six 30 degree arcs", hash 6b567c7d1473e421, level presliding.
 * Written by tendonff VERSION export-c --precision double --prefix tff.
 * The licence of tendonff does not cover what it writes: this file is yours.
 */
#include "tff_limits.h"

#define TFF_LARGEST_N 1e+30

void tff_output_init(tff_output *self, tff_real force)
{
    tff_real start = force;

    start = (start < TFF_FORCE_MIN_N) ? TFF_FORCE_MIN_N : start;
    start = (start > TFF_FORCE_MAX_N) ? TFF_FORCE_MAX_N : start;
    self->force = start;
    self->status = TFF_OK;
    self->seen = TFF_OK;
    self->low = TFF_FORCE_MIN_N;
    self->high = TFF_FORCE_MAX_N;
    self->change = TFF_CHANGE_MAX_N;
}

int32_t tff_output_use(tff_output *self, const tff_parameters *given)
{
    const tff_real change = given->force_rate_max * TFF_STEP_S;
    const int32_t good = tff_parameters_are_good(given);

    if (good != 0) {
        self->low = given->force_min;
        self->high = given->force_max;
        self->change = (change < TFF_CHANGE_MAX_N) ? change : TFF_CHANGE_MAX_N;
    }
    return good;
}

tff_real tff_output_hold(tff_output *self, uint32_t why)
{
    self->status = why;
    self->seen |= why;
    return self->force;
}

tff_real tff_output_set(tff_output *self, tff_real wanted)
{
    const tff_real low = self->force - self->change;
    const tff_real high = self->force + self->change;
    tff_real force = self->force;
    uint32_t status = TFF_FAILED;

    if (wanted > self->high) {
        if (wanted <= TFF_LARGEST_N) {
            force = self->high;
            status = TFF_FORCE_LIMITED;
        }
    } else if (wanted >= self->low) {
        force = wanted; /* the usual case */
        status = TFF_OK;
    } else if (wanted >= -TFF_LARGEST_N) {
        force = self->low;
        status = TFF_FORCE_LIMITED;
    } else {
        /* not a number, or minus infinity */
    }
    if (force < low) {
        force = low;
        status |= TFF_RATE_LIMITED;
    } else if (force > high) {
        force = high;
        status |= TFF_RATE_LIMITED;
    } else {
        /* within the rate */
    }
    self->force = force;
    self->status = status;
    self->seen |= status;
    return force;
}

tff_real tff_samples(tff_real *waiting, tff_real dt_s)
{
    tff_real samples = 0.0;

    if (tff_is_within(dt_s, 0.0, TFF_LARGEST_N) != 0) {
        const tff_real since = *waiting + dt_s;
        *waiting = since;
        if (since >= TFF_STEP_MIN_S) {
            *waiting = 0.0;
            samples = since * 1000.0;
            samples = (tff_is_within(samples, 0.99999899999999997, 1.0000009999999999) != 0) ? 1.0 : samples;
        }
    }
    return samples;
}

int32_t tff_paused(tff_real samples)
{
    const tff_real most = (tff_real)TFF_RE_ENTRY;
    const tff_real counted = (samples < most) ? samples : most;

    return (samples > (TFF_STEP_MAX_S * 1000.0)) ? (int32_t)counted : 0;
}

void tff_entry_init(tff_entry *self, tff_real reference)
{
    self->last = reference;
    self->held = reference;
    self->span = (tff_real)TFF_RE_ENTRY;
    self->left = 0.0;
    self->waiting = 0.0;
    self->lost = 0;
}

void tff_entry_lose(tff_entry *self, int32_t samples)
{
    if (samples > 0) { /* more than the longest way back counts as that */
        const int32_t more = (samples < TFF_RE_ENTRY) ? samples : TFF_RE_ENTRY;
        self->lost = ((self->lost + more) < TFF_RE_ENTRY) ? (self->lost + more) : TFF_RE_ENTRY;
    }
}

tff_real tff_entry_take(tff_entry *self, tff_real reference)
{
    tff_real followed = reference;

    if (self->lost != 0) {
        const tff_real most = (tff_real)TFF_RE_ENTRY;
        const int32_t share = TFF_RE_ENTRY_SHARE * self->lost;
        const tff_real asked = (tff_real)share;
        const tff_real span = (asked > self->left) ? asked : self->left; /* never shorter than the way that it was on */
        self->span = (span < most) ? span : most;
        self->left = self->span;
        self->held = self->last;
        self->lost = 0;
    }
    if (self->left > 0.0) {
        const tff_real place = self->left / self->span;
        const tff_real left = place * place * place * (10.0 + (place * ((6.0 * place) - 15.0)));
        followed = self->held + ((reference - self->held) * (1.0 - left)); /* at first exactly what was held */
        self->left -= 1.0;
    }
    self->last = followed;
    return followed;
}

tff_real tff_tension_of(tff_real given, tff_real low, tff_real high, tff_real otherwise, uint32_t *status)
{
    tff_real taken = given;

    *status = TFF_OK;
    if (tff_is_within(given, low, high) == 0) {
        taken = otherwise;
        *status = TFF_INPUT_HELD;
    }
    return taken;
}

tff_real tff_begin(tff_output *output, tff_entry *entry, tff_real initial_tension, tff_real low, tff_real high)
{
    uint32_t status;
    const tff_real tension = tff_tension_of(initial_tension, low, high, (initial_tension > high) ? high : low, &status);

    tff_output_init(output, tension);
    output->status = status;
    output->seen = status;
    tff_entry_init(entry, tension);
    return tension;
}

int32_t tff_begin_at(tff_output *output, tff_entry *entry, tff_real rest, tff_real force)
{
    const int32_t good = tff_is_within(force, TFF_FORCE_MIN_N, TFF_FORCE_MAX_N);

    if (good != 0) {
        output->force = force;
        tff_entry_lose(entry, (tff_is_within(force, rest, rest) != 0) ? 0 : TFF_RE_ENTRY);
    } else {
        output->status |= TFF_INPUT_HELD;
        output->seen |= TFF_INPUT_HELD;
    }
    return good;
}

tff_real tff_lose(tff_output *output, tff_entry *entry, tff_real reference)
{
    tff_entry_lose(entry, 1);
    return tff_output_hold(output, tff_held(reference));
}

tff_pause tff_pause_of(tff_output *output, tff_entry *entry, tff_real dt_s)
{
    const tff_real samples = tff_samples(&entry->waiting, dt_s);
    tff_pause pause;

    pause.missed = tff_paused(samples);
    pause.samples = (pause.missed > 0) ? 1.0 : samples;
    pause.change = output->change;
    tff_entry_lose(entry, pause.missed);
    if (samples > 0.0) {
        output->change *= pause.samples;
    } else {
        (void)tff_output_hold(output, (tff_is_within(dt_s, 0.0, TFF_STEP_MIN_S) != 0) ? TFF_OK : TFF_INPUT_HELD);
    }
    return pause;
}

tff_real tff_resume(tff_output *output, tff_entry *entry, const tff_pause *pause, tff_real answer)
{
    output->change = pause->change;
    entry->left = (entry->left > 0.0) ? (entry->left - (pause->samples - 1.0)) : 0.0;
    return answer;
}

tff_span tff_span_of(tff_entry *entry, tff_real dt_s)
{
    tff_span span = { dt_s, 0.0, -1, 0, 0.0 };

    if (tff_is_within(dt_s, 0.0, TFF_LARGEST_N) != 0) {
        const int32_t missed = tff_paused(dt_s * 1000.0);
        const tff_real since = (missed > 0) ? TFF_STEP_S : (entry->waiting + dt_s);
        const tff_real fit = (since * 1000.0) + 9.9999999999999995e-07;

        span.samples = (int32_t)fit;
        span.missed = missed;
        span.left = since - ((tff_real)span.samples * TFF_STEP_S);
        entry->waiting = (span.left > 0.0) ? span.left : 0.0;
    }
    return span;
}

int32_t tff_span_next(tff_span *self)
{
    int32_t comes = 0;

    if (self->samples > 0) {
        const tff_real least = self->dt_s * 9.9999999999999995e-07;
        tff_real back;

        self->samples--;
        back = ((tff_real)self->samples * TFF_STEP_S) + self->left;
        self->rest = ((self->missed > 0) || (back <= least)) ? 0.0 : (back / self->dt_s);
        comes = 1;
    }
    return comes;
}

tff_real tff_on_the_way(tff_real reference, tff_real before, tff_real rest)
{
    return (rest > 0.0) ? (reference + (rest * (before - reference))) : reference;
}
