/* tff_profile.c: see tff_profile.h. Fixed text; its numbers stand in tff_profile_data.h. */
#include "tff_profile_data.h"

static void tff_profile_show(tff_profile *self, uint32_t row)
{
    const tff_profile_record *const r = &tff_profile_records[self->which];
    const tff_real *const command = &r->command_rad[row * (uint32_t)r->motors];
    int32_t m;

    for (m = 0; m < r->motors; m++) {
        self->command_rad[m] = command[m];
    }
}

int32_t tff_profile_init(tff_profile *self, int32_t which)
{
    int32_t ready = 0;
    int32_t m;

    for (m = 0; m < TFF_PROFILE_MOTORS; m++) {
        self->command_rad[m] = (tff_real)0;
    }
    self->which = -1;
    self->index = 0u;
    self->status = TFF_FAILED;
    if ((which >= 0) && (which < TFF_PROFILE_NUMBER)) {
        ready = 1;
        self->which = which;
        self->status = TFF_OK;
        tff_profile_show(self, 0u);
    }
    self->seen = self->status;
    return ready;
}

uint32_t tff_profile_step(tff_profile *self)
{
    if (self->which < 0) {
        self->status = TFF_FAILED;
    } else {
        const tff_profile_record *const r = &tff_profile_records[self->which];
        self->status = TFF_OK;
        if (self->index < r->rows) {
            tff_profile_show(self, self->index);
            self->index++;
            if ((self->index == r->rows) && (r->loops != 0)) {
                self->index = 0u;
            }
        } else {
            self->status = TFF_ENDED;
        }
    }
    self->seen |= self->status;
    return self->status;
}
