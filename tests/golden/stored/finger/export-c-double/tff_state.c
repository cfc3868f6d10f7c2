/* tff_state.c: see tff_state.h.
 *
 * Scenario "robot finger: polymer tendon on six 30 degree arcs", hash 6b567c7d1473e421, level presliding.
 * Written by tendonff VERSION export-c --precision double --prefix tff.
 * The licence of tendonff does not cover what it writes: this file is yours.
 */
#include "tff_state.h"

const tff_weights tff_rows[4] = { NUMBERS };

/* Largest of the balances; the first that is not a number where there is one. */
double tff_largest(int rows, const double *residual)
{
    double largest = 0.0;
    int bad = -1;
    int i;
    for (i = 0; i < rows; i++) {
        const double size = fabs(residual[i]);
        largest = (size > largest) ? size : largest;
        bad = ((size >= 0.0) || (bad >= 0)) ? bad : i;
    }
    return (bad < 0) ? largest : residual[bad];
}

/* Factorise the matrix from both ends towards the middle: two chains of divisions that do not wait for each other.
 * Afterwards diag holds reciprocal pivots, upper the ratios of the first half and lower those of the second. */
void tff_factorise(int rows, double *lower, double *diag, double *upper, double *middle)
{
    const int last = rows - 1;
    const int half = rows / 2;
    double a = 1.0 / diag[0];
    double b = 1.0 / diag[last];
    int i;
    diag[0] = a;
    diag[last] = b;
    for (i = 1; i < half; i++) {
        const int k = last - i;
        upper[i - 1] *= a;
        lower[k + 1] *= b;
        a = 1.0 / (diag[i] - (lower[i] * upper[i - 1]));
        b = 1.0 / (diag[k] - (upper[k] * lower[k + 1]));
        diag[i] = a;
        diag[k] = b;
    }
    upper[half - 1] *= a;
    lower[(last - half) + 1] *= b;
    if ((rows % 2) != 0) { /* one row in the middle */
        *middle = 1.0 / ((diag[half] - (lower[half] * upper[half - 1])) - (upper[half] * lower[half + 1]));
    } else { /* two rows that meet */
        *middle = 1.0 / (1.0 - (upper[half - 1] * lower[half]));
    }
}

/* Newton's move: minus the inverse of the factorised matrix times the balances. */
void tff_newton_move(
    int rows, const double *residual, const double *lower, const double *diag, const double *upper, double middle, double *move)
{
    const int last = rows - 1;
    const int half = rows / 2;
    double a = -residual[0] * diag[0];
    double b = -residual[last] * diag[last];
    int i;
    move[0] = a;
    move[last] = b;
    for (i = 1; i < half; i++) {
        const int k = last - i;
        a = -(residual[i] + (lower[i] * a)) * diag[i];
        b = -(residual[k] + (upper[k] * b)) * diag[k];
        move[i] = a;
        move[k] = b;
    }
    if ((rows % 2) != 0) {
        const double between = -((residual[half] + (lower[half] * a)) + (upper[half] * b)) * middle;
        move[half] = between;
        a -= upper[half - 1] * between;
        b -= lower[half + 1] * between;
    } else {
        const double near = (a - (upper[half - 1] * b)) * middle;
        b -= lower[half] * near;
        a = near;
    }
    move[half - 1] = a;
    move[(last - half) + 1] = b;
    for (i = half - 2; i >= 0; i--) {
        const int k = last - i;
        a = move[i] - (upper[i] * a);
        b = move[k] - (lower[k] * b);
        move[i] = a;
        move[k] = b;
    }
}

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

void tff_state_init(tff_state *self, tff_real tension)
{
    tff_state_rest(self->x, self->x_old, tension);
    self->fresh = 2;
}

void tff_state_stop(tff_state *self)
{
    int32_t j;

    for (j = 0; j < TFF_STATE_REALS; j++) {
        self->x[j] = (j <= (TFF_STATE_COUNT + 1)) ? 0.0 : self->x_old[j];
    }
    self->fresh = 1;
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
