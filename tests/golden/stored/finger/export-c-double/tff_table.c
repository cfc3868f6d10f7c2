/* tff_table.c: see tff_table.h.
 *
 * Scenario "robot finger: polymer tendon on six 30 degree arcs", hash 6b567c7d1473e421, level presliding.
 * Written by tendonff VERSION export-c --precision double --prefix tff.
 * The licence of tendonff does not cover what it writes: this file is yours.
 */
#include "tff_table.h"
#include "tff_table_data.h"

/* Node below a reference that lies so many cells from the first one. */
static int32_t tff_table_row_of(tff_real cells)
{
    const int32_t last = TFF_TABLE_REFERENCES - 2;
    const int32_t row = (int32_t)cells;

    return (row > last) ? last : row;
}

/* Ratio [-] at a node of the pull branch; `node` is the one at the reference below. */
static inline tff_real tff_table_pull_at(const tff_real *node, tff_real place)
{
    return node[0] + (place * (node[TFF_TABLE_PULL_SHARES] - node[0]));
}

/* Share at which the pull branch has this ratio: bisection over its nodes, written out. */
static tff_real tff_table_pull_share_of(const tff_real *first, tff_real place, tff_real ratio)
{
    const tff_real *node = first;
    const tff_real *share = &tff_table_pull_share[0];
    tff_real near;
    tff_real far;
    tff_real way;
    tff_real swing;
    tff_real found;

    if (ratio >= tff_table_pull_at(&node[9], place)) {
        node = &node[9];
        share = &share[9];
    }
    if (ratio >= tff_table_pull_at(&node[5], place)) {
        node = &node[5];
        share = &share[5];
    }
    if (ratio >= tff_table_pull_at(&node[2], place)) {
        node = &node[2];
        share = &share[2];
    }
    if (ratio >= tff_table_pull_at(&node[1], place)) {
        node = &node[1];
        share = &share[1];
    }
    if (ratio >= tff_table_pull_at(&node[1], place)) {
        node = &node[1];
        share = &share[1];
    }
    near = tff_table_pull_at(&node[0], place);
    far = tff_table_pull_at(&node[1], place);
    way = ratio - near;
    swing = far - near;
    if (way >= swing) {
        found = share[1];
    } else if (way > 0.0) {
        found = share[0] + ((way / swing) * (share[1] - share[0]));
    } else {
        found = share[0];
    }
    return found;
}

static void tff_table_pull(tff_table *self, tff_real reference)
{
    const tff_real cells = (reference - TFF_TABLE_FIRST_N) * TFF_TABLE_CELLS_PER_N;
    const int32_t row = tff_table_row_of(cells);
    const tff_real along = cells - (tff_real)row; /* to the node above, 0 to 1 */
    const tff_real *first = &tff_table_pull_ratio[row * TFF_TABLE_PULL_SHARES];
    const tff_real lifted = reference + TFF_TABLE_ADHESION_N;
    tff_real share;
    tff_real place;
    tff_real near;
    tff_real far;
    int32_t cell;

    if (self->branch != 1) {
        share = tff_table_pull_share_of(first, along, self->ratio);
        self->turn = self->last - (share * (self->last + TFF_TABLE_ADHESION_N));
        self->branch = 1;
    }
    share = (reference - self->turn) / lifted;
    if (share > tff_table_pull_share[TFF_TABLE_PULL_SHARES - 1]) {
        share = tff_table_pull_share[TFF_TABLE_PULL_SHARES - 1]; /* the transition is over */
    }
    cell = (int32_t)tff_table_pull_cell[(int32_t)(share * TFF_TABLE_PULL_BINS_PER_SHARE)];
    if (share < tff_table_pull_share[cell]) {
        cell--;
    }
    place = (share - tff_table_pull_share[cell]) / (tff_table_pull_share[cell + 1] - tff_table_pull_share[cell]);
    near = tff_table_pull_at(&first[cell], along);
    far = tff_table_pull_at(&first[cell + 1], along);
    self->ratio = near + (place * (far - near));
    self->wanted = (self->ratio * lifted) - TFF_TABLE_ADHESION_N;
    self->last = reference;
}

/* Ratio [-] at a node of the release branch; `node` is the one at the reference below. */
static inline tff_real tff_table_release_at(const tff_real *node, tff_real place)
{
    return node[0] + (place * (node[TFF_TABLE_RELEASE_SHARES] - node[0]));
}

/* Share at which the release branch has this ratio: bisection over its nodes, written out. */
static tff_real tff_table_release_share_of(const tff_real *first, tff_real place, tff_real ratio)
{
    const tff_real *node = first;
    const tff_real *share = &tff_table_release_share[0];
    tff_real near;
    tff_real far;
    tff_real way;
    tff_real swing;
    tff_real found;

    if (ratio <= tff_table_release_at(&node[8], place)) {
        node = &node[8];
        share = &share[8];
    }
    if (ratio <= tff_table_release_at(&node[4], place)) {
        node = &node[4];
        share = &share[4];
    }
    if (ratio <= tff_table_release_at(&node[2], place)) {
        node = &node[2];
        share = &share[2];
    }
    if (ratio <= tff_table_release_at(&node[1], place)) {
        node = &node[1];
        share = &share[1];
    }
    near = tff_table_release_at(&node[0], place);
    far = tff_table_release_at(&node[1], place);
    way = near - ratio;
    swing = near - far;
    if (way >= swing) {
        found = share[1];
    } else if (way > 0.0) {
        found = share[0] + ((way / swing) * (share[1] - share[0]));
    } else {
        found = share[0];
    }
    return found;
}

static void tff_table_release(tff_table *self, tff_real reference)
{
    const tff_real cells = (reference - TFF_TABLE_FIRST_N) * TFF_TABLE_CELLS_PER_N;
    const int32_t row = tff_table_row_of(cells);
    const tff_real along = cells - (tff_real)row; /* to the node above, 0 to 1 */
    const tff_real *first = &tff_table_release_ratio[row * TFF_TABLE_RELEASE_SHARES];
    const tff_real lifted = reference + TFF_TABLE_ADHESION_N;
    tff_real share;
    tff_real place;
    tff_real near;
    tff_real far;
    int32_t cell;

    if (self->branch != -1) {
        share = tff_table_release_share_of(first, along, self->ratio);
        self->turn = self->last + (share * (self->last + TFF_TABLE_ADHESION_N));
        self->branch = -1;
    }
    share = (self->turn - reference) / lifted;
    if (share > tff_table_release_share[TFF_TABLE_RELEASE_SHARES - 1]) {
        share = tff_table_release_share[TFF_TABLE_RELEASE_SHARES - 1]; /* the transition is over */
    }
    cell = (int32_t)tff_table_release_cell[(int32_t)(share * TFF_TABLE_RELEASE_BINS_PER_SHARE)];
    if (share < tff_table_release_share[cell]) {
        cell--;
    }
    place = (share - tff_table_release_share[cell]) / (tff_table_release_share[cell + 1] - tff_table_release_share[cell]);
    near = tff_table_release_at(&first[cell], along);
    far = tff_table_release_at(&first[cell + 1], along);
    self->ratio = near + (place * (far - near));
    self->wanted = (self->ratio * lifted) - TFF_TABLE_ADHESION_N;
    self->last = reference;
}

void tff_table_init(tff_table *self, tff_real initial_tension)
{
    const tff_real tension = tff_begin(&self->output, &self->entry, initial_tension, TFF_TABLE_MIN_N, TFF_TABLE_MAX_N);

    self->last = tension;
    self->wanted = tension;
    self->turn = tension;
    self->branch = 0;
    self->ratio = 1.0;
}

void tff_table_init_at(tff_table *self, tff_real tension, tff_real force)
{
    tff_table_init(self, tension);
    if (tff_begin_at(&self->output, &self->entry, self->last, force) != 0) {
        self->ratio = (force + TFF_TABLE_ADHESION_N) / (self->last + TFF_TABLE_ADHESION_N);
        self->wanted = force;
    }
}

void tff_table_missed(tff_table *self, int32_t samples)
{
    tff_entry_lose(&self->entry, samples);
}

int32_t tff_table_use(tff_table *self, const tff_parameters *given)
{
    return tff_output_use(&self->output, given);
}

/* Force for a reference that is accepted. */
static tff_real tff_table_take(tff_table *self, tff_real reference)
{
    const tff_real followed = tff_entry_take(&self->entry, reference);
    if (followed > self->last) {
        tff_table_pull(self, followed);
    } else if (followed < self->last) {
        tff_table_release(self, followed);
    } else {
        /* held: the same force */
    }
    return tff_output_set(&self->output, self->wanted);
}

/* A step, as long as the rate limit was set for. */
static tff_real tff_table_after(tff_table *self, tff_real reference)
{
    return (tff_is_within(reference, TFF_TABLE_MIN_N, TFF_TABLE_MAX_N) != 0) ? tff_table_take(self, reference) : tff_lose(&self->output, &self->entry, reference);
}

tff_real tff_table_step(tff_table *self, tff_real reference)
{
    return (self->entry.waiting > 0.0) ? tff_table_step_dt(self, TFF_STEP_S, reference) : tff_table_after(self, reference);
}

tff_real tff_table_step_dt(tff_table *self, tff_real dt_s, tff_real reference)
{
    const tff_pause pause = tff_pause_of(&self->output, &self->entry, dt_s);

    return (pause.samples > 0.0) ? tff_resume(&self->output, &self->entry, &pause, tff_table_after(self, reference)) : self->output.force;
}
