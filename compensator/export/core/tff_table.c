/* tff_table.c: see tff_table.h. Fixed text; its numbers stand in tff_table_data.h. */
#include "tff_table_data.h"

/* Motor angle on a branch (-1 down, 0 at rest, 1 up). */
static tff_real tff_table_at(const tff_table_record *r, int32_t way, int32_t motor, tff_real angle_rad)
{
    const tff_real *const branch = r->branch_rad[way + 1];
    const tff_real place = (angle_rad - r->low_rad) * r->nodes_per_rad;
    const int32_t last = r->nodes - 2;
    int32_t node = (int32_t)place;
    tff_real below;
    tff_real above;

    node = (node < last) ? node : last;
    below = branch[(node * r->motors) + motor];
    above = branch[((node + 1) * r->motors) + motor];
    return below + ((above - below) * (place - (tff_real)node));
}

static int tff_table_within(tff_real value, tff_real low, tff_real high)
{
    return ((value >= low) && (value <= high)) ? 1 : 0; /* 0 for NaN too */
}

int32_t tff_table_init(tff_table *self, int32_t which, tff_real angle_rad)
{
    int32_t ready = 0;
    int32_t m;

    for (m = 0; m < TFF_TABLE_MOTORS; m++) {
        self->command_rad[m] = (tff_real)0;
        self->zero_rad[m] = (tff_real)0;
    }
    self->which = -1;
    self->way = 0;
    self->furthest_rad = angle_rad;
    self->status = TFF_FAILED;
    if ((which >= 0) && (which < TFF_TABLE_NUMBER)) {
        const tff_table_record *const r = &tff_table_records[which];
        if (tff_table_within(angle_rad, r->low_rad, r->high_rad) != 0) {
            ready = 1;
            self->which = which;
            self->status = TFF_OK;
            for (m = 0; m < r->motors; m++) {
                self->zero_rad[m] = tff_table_at(r, 0, m, angle_rad);
            }
        }
    }
    self->seen = self->status;
    return ready;
}

/* The way in which the joint turns: another one once it has come back far enough. */
static void tff_table_turn(tff_table *self, tff_real turning_rad, tff_real angle_rad)
{
    const tff_real on = angle_rad - self->furthest_rad;

    if ((self->way <= 0) && (on > turning_rad)) {
        self->way = 1;
    } else if ((self->way >= 0) && (on < -turning_rad)) {
        self->way = -1;
    } else {
        /* as before */
    }
    if (((self->way > 0) && (on > (tff_real)0)) || ((self->way < 0) && (on < (tff_real)0))) {
        self->furthest_rad = angle_rad;
    }
}

uint32_t tff_table_step(tff_table *self, tff_real angle_rad)
{
    self->status = TFF_OK;
    if (self->which < 0) {
        self->status = TFF_FAILED;
    } else {
        const tff_table_record *const r = &tff_table_records[self->which];
        if (tff_table_within(angle_rad, r->low_rad, r->high_rad) == 0) {
            self->status = TFF_INPUT_HELD;
            if (tff_table_within(angle_rad, (tff_real)-1e30, (tff_real)1e30) != 0) {
                self->status = TFF_RANGE;
            }
        } else {
            int32_t m;
            tff_table_turn(self, r->turning_rad, angle_rad);
            for (m = 0; m < r->motors; m++) {
                const tff_real wanted = tff_table_at(r, self->way, m, angle_rad) - self->zero_rad[m];
                const tff_real change = wanted - self->command_rad[m];
                if (tff_table_within(change, -r->change_rad, r->change_rad) != 0) {
                    self->command_rad[m] = wanted;
                } else {
                    self->command_rad[m] += (change > (tff_real)0) ? r->change_rad : -r->change_rad;
                    self->status |= TFF_SPEED_LIMITED;
                }
            }
        }
    }
    self->seen |= self->status;
    return self->status;
}
