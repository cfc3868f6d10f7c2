/* tff_state.c: see tff_state.h.
 *
 * Scenario "robot finger: polymer tendon on six 30 degree arcs", hash 6b567c7d1473e421, level presliding.
 * Written by tendonff VERSION export-c --precision double --prefix tff.
 * The licence of tendonff does not cover what it writes: this file is yours.
 */
#include "tff_state.h"

const tff_weights tff_rows[4] = { NUMBERS };

void tff_state_rest(tff_real *x, tff_real *x_old, tff_real tension)
{
    int32_t j;

    for (j = 0; j < 8; j++) {
        x[j] = 0.0;
    }
    x[8] = tension * 4.1666666666666669e-06;
    for (j = 9; j < 14; j++) {
        x[j] = tension * 8.3333333333333337e-06;
    }
    for (j = 14; j < 16; j++) {
        x[j] = tension * 4.1666666666666669e-06;
    }
    for (j = 16; j < 21; j++) {
        x[j] = tension * 8.3333333333333337e-06;
    }
    x[21] = tension * 4.1666666666666669e-06;
    for (j = 22; j < 28; j++) {
        x[j] = 0.0;
    }
    x[28] = tension * 0.00038333333333333334;
    x[29] = tension * 0.00033333333333333332;
    for (j = 0; j < TFF_STATE_REALS; j++) {
        x_old[j] = x[j];
    }
}

/* What slip cannot hold is left out; below it each mass has its share of full slip. */
void tff_state_rub(tff_real *x, tff_real *x_old, tff_real rest, tff_real force)
{
    static const tff_real pull[TFF_STATE_COUNT] = { NUMBERS };
    static const tff_real release[TFF_STATE_COUNT] = { NUMBERS };
    const tff_real lifted = rest + 0.0;
    const tff_real most = lifted * 0.87445608758533822;
    const tff_real least = lifted * -0.46651190890889671;
    const tff_real *const shares = (force > rest) ? pull : release;
    tff_real held = force - rest;
    int32_t j;

    held = (held > most) ? most : held;
    held = (held < least) ? least : held;
    for (j = 0; j < TFF_STATE_COUNT; j++) {
        x[22 + j] = held * shares[j];
        x_old[22 + j] = held * shares[j];
    }
}

void tff_state_carry(tff_real *x, tff_real *x_old, tff_real rest, tff_real force)
{
    tff_real lifted = rest + 0.0;
    tff_real longer = 0.0;
    int32_t j;

    tff_state_rub(x, x_old, rest, force);
    for (j = 6 - 1; j >= 0; j--) {
        tff_real stretch;

        lifted += x[22 + j];
        stretch = (lifted - 0.0) / rest;
        longer += x[8 + j] * (stretch - 1.0);
        x[8 + j] *= stretch;
        x_old[8 + j] = x[8 + j];
        x[15 + j] *= stretch;
        x_old[15 + j] = x[15 + j];
    }
    x[28] += longer;
    x_old[28] = x[28];
}
