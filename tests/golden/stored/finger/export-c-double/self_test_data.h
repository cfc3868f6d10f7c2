/* self_test_data.h: what self_test.c calls, with which numbers, and what must come out.
 *
 * Scenario "robot finger: polymer tendon on six 30 degree arcs", hash 6b567c7d1473e421, level presliding.
 * Written by tendonff VERSION export-c --precision double --prefix tff.
 * The licence of tendonff does not cover what it writes: this file is yours.
 * Outputs are those of the Python model, bounds and status bits are stated here anew, apart from the headers.
 */
#include "tff_capstan.h"
#include "tff_inverse.h"
#include "tff_profile.h"
#include "tff_table.h"
#include "tff_stream.h"
#include "tff_plant.h"
#include "tff_observer.h"
#include "tff_table_data.h"

/* Acts of a line. */
enum {
    TEST_GIVE,      /* input `port` becomes the number `a`, and so much as `b` more in each row; `other` inputs do */
    TEST_CALL,      /* call number `port` of the module, with the inputs given so far */
    TEST_WRITE,     /* member `port` of the state becomes the number `a` */
    TEST_COPY,      /* the state becomes that of the slot `other` */
    TEST_FILL,      /* the state becomes bytes `other` */
    TEST_NEAR,      /* at most `b` from `a`; not compared where `a` is NaN */
    TEST_MEAN,      /* the mean of the last TEST_MEAN_OF differences from `a` is at most `b` */
    TEST_WITHIN,    /* from `a` to `b` */
    TEST_BITS,      /* of the bits `a` those of `b` are set, and no others */
    TEST_WHEN,      /* the next `other` lines only where all numbers are from `a` to `b` */
    TEST_WHEN_BITS, /* and only where of the bits `a` those of `b` are set, and no others */
    TEST_SUM        /* the checksum of all rows is `a` */
};

/* What a line looks at. */
enum {
    TEST_VALUE,  /* the output */
    TEST_CHANGE, /* its change since before the last call of any slot */
    TEST_APART   /* its difference from the output `versus` of the slot `other` */
};

/* An output of a module, or any other member of its state. */
typedef struct {
    const char *name; /* with its unit */
    uint32_t offset;
    uint16_t count;
    char type; /* r tff_real, i int32_t, u uint32_t, n int, d double, c what the last call returned */
} test_port;

typedef struct {
    const char *name;
    double (*call)(void *state, int which, const tff_real *in); /* what it returns; 0 where that is nothing */
    const test_port *ports;
} test_module;

/* `a` and `b` are places in test_numbers, `next` is how far the next row of `a` is from there; of bits the bits themselves. */
typedef struct {
    uint8_t act, slot, port, look, other, versus;
    uint16_t next;
    uint32_t a, b;
} test_line;

typedef struct {
    const char *name; /* NULL: more rows of the check before */
    uint16_t module, lines;
    int32_t rows;
    uint32_t first; /* of its lines */
} test_check;

#define TEST_SLOTS 3
#define TEST_INPUTS 13
#define TEST_MEAN_OF 8

/* ---- modules: state, calls, outputs ---- */

static tff_parameters test_record;
static const tff_parameters *test_parameters_of(const tff_real *in)
{
    test_record.mu_pull = in[0];
    test_record.mu_release = in[1];
    test_record.adhesion = in[2];
    test_record.force_min = in[3];
    test_record.force_max = in[4];
    test_record.force_rate_max = in[5];
    test_record.reference_min = in[6];
    test_record.reference_max = in[7];
    return &test_record;
}

typedef union {
    tff_real of_data;
    tff_output of_limits;
    tff_parameters of_parameters;
    tff_capstan of_capstan;
    tff_table of_table;
    tff_inverse of_inverse;
    tff_stream of_stream;
    tff_profile of_profile;
    tff_plant of_plant;
    tff_observer of_observer;
} test_state;

static double call_data(void *state, int which, const tff_real *in)
{
    tff_real *const self = (tff_real *)state;
    double answer = 0.0;

    (void)in;
    (void)self;
    switch (which) {
    case 0: answer = (double)TFF_INPUT_HELD; break;
    case 1: answer = (double)TFF_FORCE_LIMITED; break;
    case 2: answer = (double)TFF_RATE_LIMITED; break;
    case 3: answer = (double)TFF_WOULD_PUSH; break;
    case 4: answer = (double)TFF_FAILED; break;
    case 5: answer = (double)TFF_ENDED; break;
    case 6: answer = (double)TFF_RANGE; break;
    case 7: answer = (double)TFF_OK; break;
    case 8: answer = (double)TFF_FORCE_MIN_N; break;
    case 9: answer = (double)TFF_FORCE_MAX_N; break;
    case 10: answer = (double)TFF_CHANGE_MAX_N; break;
    case 11: answer = (double)TFF_REFERENCE_MIN_N; break;
    case 12: answer = (double)TFF_REFERENCE_MAX_N; break;
    case 13: answer = (double)TFF_STEP_S; break;
    case 14: answer = (double)TFF_PROFILE_LENGTH; break;
    case 15: answer = (double)TFF_STREAM_LAG_S; break;
    case 16: answer = (double)TFF_TABLE_MIN_N; break;
    case 17: answer = (double)TFF_TABLE_MAX_N; break;
    case 18: answer = (double)TFF_TABLE_FIRST_N; break;
    case 19: answer = (double)TFF_TABLE_CELLS_PER_N; break;
    case 20: answer = (double)tff_table_pull_share[(uint32_t)in[0]]; break;
    case 21: answer = (double)tff_table_pull_ratio[(uint32_t)in[0]]; break;
    case 22: answer = (double)tff_table_pull_cell[(uint32_t)in[0]]; break;
    case 23: answer = (double)tff_table_release_share[(uint32_t)in[0]]; break;
    case 24: answer = (double)tff_table_release_ratio[(uint32_t)in[0]]; break;
    case 25: answer = (double)tff_table_release_cell[(uint32_t)in[0]]; break;
    default: break;
    }
    return answer;
}

static const test_port ports_of_data[] = {
    { "answer", 0, 1, 'c' },
};

static double call_limits(void *state, int which, const tff_real *in)
{
    tff_output *const self = (tff_output *)state;
    double answer = 0.0;

    (void)in;
    (void)self;
    switch (which) {
    case 0: tff_output_init(self, in[0]); break;
    case 1: answer = (double)tff_output_set(self, in[0]); break;
    case 2: answer = (double)tff_output_hold(self, TFF_INPUT_HELD); break;
    case 3: answer = (double)tff_output_use(self, test_parameters_of(&in[1])); break;
    default: break;
    }
    return answer;
}

static const test_port ports_of_limits[] = {
    { "answer", 0, 1, 'c' },
    { "force [N]", (uint32_t)offsetof(tff_output, force), 1, 'r' },
    { "status", (uint32_t)offsetof(tff_output, status), 1, 'u' },
    { "seen", (uint32_t)offsetof(tff_output, seen), 1, 'u' },
    { "least force [N]", (uint32_t)offsetof(tff_output, low), 1, 'r' },
    { "largest force [N]", (uint32_t)offsetof(tff_output, high), 1, 'r' },
    { "largest change [N]", (uint32_t)offsetof(tff_output, change), 1, 'r' },
};

static double call_parameters(void *state, int which, const tff_real *in)
{
    tff_parameters *const self = (tff_parameters *)state;
    double answer = 0.0;

    (void)in;
    (void)self;
    switch (which) {
    case 0: tff_parameters_init(self); break;
    case 1: answer = (double)tff_parameters_are_good(self); break;
    case 2: answer = (double)tff_parameters_set_mu(self, in[0], in[1]); break;
    case 3: answer = (double)tff_parameters_set_adhesion(self, in[0]); break;
    case 4: answer = (double)tff_parameters_set_limits(self, in[0], in[1], in[2]); break;
    case 5: answer = (double)tff_parameters_set_references(self, in[0], in[1]); break;
    default: break;
    }
    return answer;
}

static const test_port ports_of_parameters[] = {
    { "answer", 0, 1, 'c' },
    { "mu_pull", (uint32_t)offsetof(tff_parameters, mu_pull), 1, 'r' },
    { "mu_release", (uint32_t)offsetof(tff_parameters, mu_release), 1, 'r' },
    { "adhesion", (uint32_t)offsetof(tff_parameters, adhesion), 1, 'r' },
    { "force_min", (uint32_t)offsetof(tff_parameters, force_min), 1, 'r' },
    { "force_max", (uint32_t)offsetof(tff_parameters, force_max), 1, 'r' },
    { "force_rate_max", (uint32_t)offsetof(tff_parameters, force_rate_max), 1, 'r' },
    { "reference_min", (uint32_t)offsetof(tff_parameters, reference_min), 1, 'r' },
    { "reference_max", (uint32_t)offsetof(tff_parameters, reference_max), 1, 'r' },
};

static double call_capstan(void *state, int which, const tff_real *in)
{
    tff_capstan *const self = (tff_capstan *)state;
    double answer = 0.0;

    (void)in;
    (void)self;
    switch (which) {
    case 0: tff_capstan_init(self, in[0]); break;
    case 1: tff_capstan_init_at(self, in[0], in[2]); break;
    case 2: answer = (double)tff_capstan_step(self, in[0]); break;
    case 3: answer = (double)tff_capstan_step_dt(self, in[1], in[0]); break;
    case 4: tff_capstan_missed(self, (int32_t)in[3]); break;
    case 5: answer = (double)tff_capstan_use(self, test_parameters_of(&in[4])); break;
    default: break;
    }
    return answer;
}

static const test_port ports_of_capstan[] = {
    { "answer", 0, 1, 'c' },
    { "force [N]", (uint32_t)offsetof(tff_capstan, output.force), 1, 'r' },
    { "status", (uint32_t)offsetof(tff_capstan, output.status), 1, 'u' },
    { "seen", (uint32_t)offsetof(tff_capstan, output.seen), 1, 'u' },
    { "least force [N]", (uint32_t)offsetof(tff_capstan, output.low), 1, 'r' },
    { "largest force [N]", (uint32_t)offsetof(tff_capstan, output.high), 1, 'r' },
    { "largest change [N]", (uint32_t)offsetof(tff_capstan, output.change), 1, 'r' },
    { "followed [N]", (uint32_t)offsetof(tff_capstan, entry.last), 1, 'r' },
    { "samples left", (uint32_t)offsetof(tff_capstan, entry.left), 1, 'r' },
    { "waiting [s]", (uint32_t)offsetof(tff_capstan, entry.waiting), 1, 'r' },
    { "lost", (uint32_t)offsetof(tff_capstan, entry.lost), 1, 'i' },
    { "pull", (uint32_t)offsetof(tff_capstan, pull), 1, 'r' },
    { "release", (uint32_t)offsetof(tff_capstan, release), 1, 'r' },
    { "adhesion", (uint32_t)offsetof(tff_capstan, adhesion), 1, 'r' },
};

static double call_table(void *state, int which, const tff_real *in)
{
    tff_table *const self = (tff_table *)state;
    double answer = 0.0;

    (void)in;
    (void)self;
    switch (which) {
    case 0: tff_table_init(self, in[0]); break;
    case 1: tff_table_init_at(self, in[0], in[2]); break;
    case 2: answer = (double)tff_table_step(self, in[0]); break;
    case 3: answer = (double)tff_table_step_dt(self, in[1], in[0]); break;
    case 4: tff_table_missed(self, (int32_t)in[3]); break;
    case 5: answer = (double)tff_table_use(self, test_parameters_of(&in[4])); break;
    default: break;
    }
    return answer;
}

static const test_port ports_of_table[] = {
    { "answer", 0, 1, 'c' },
    { "force [N]", (uint32_t)offsetof(tff_table, output.force), 1, 'r' },
    { "status", (uint32_t)offsetof(tff_table, output.status), 1, 'u' },
    { "seen", (uint32_t)offsetof(tff_table, output.seen), 1, 'u' },
    { "least force [N]", (uint32_t)offsetof(tff_table, output.low), 1, 'r' },
    { "largest force [N]", (uint32_t)offsetof(tff_table, output.high), 1, 'r' },
    { "largest change [N]", (uint32_t)offsetof(tff_table, output.change), 1, 'r' },
    { "followed [N]", (uint32_t)offsetof(tff_table, entry.last), 1, 'r' },
    { "samples left", (uint32_t)offsetof(tff_table, entry.left), 1, 'r' },
    { "waiting [s]", (uint32_t)offsetof(tff_table, entry.waiting), 1, 'r' },
    { "lost", (uint32_t)offsetof(tff_table, entry.lost), 1, 'i' },
    { "branch", (uint32_t)offsetof(tff_table, branch), 1, 'i' },
};

static double call_inverse(void *state, int which, const tff_real *in)
{
    tff_inverse *const self = (tff_inverse *)state;
    double answer = 0.0;

    (void)in;
    (void)self;
    switch (which) {
    case 0: tff_inverse_init(self, in[0]); break;
    case 1: tff_inverse_init_at(self, in[0], in[2]); break;
    case 2: answer = (double)tff_inverse_step(self, in[0]); break;
    case 3: answer = (double)tff_inverse_step_dt(self, in[1], in[0]); break;
    case 4: tff_inverse_missed(self, (int32_t)in[3]); break;
    case 5: answer = (double)tff_inverse_use(self, test_parameters_of(&in[4])); break;
    case 6: tff_inverse_set_mu(self, in[12]); break;
    case 7: answer = (double)tff_inverse_mu(self); break;
    case 8: answer = (double)self->chain.x[22] + (double)self->chain.x[23] + (double)self->chain.x[24] + (double)self->chain.x[25] + (double)self->chain.x[26] + (double)self->chain.x[27]; break;
    case 9: answer = ((double)self->chain.x[28] - (double)self->chain.x[29]) - ((double)self->chain.x[8] + (double)self->chain.x[9] + (double)self->chain.x[10] + (double)self->chain.x[11] + (double)self->chain.x[12] + (double)self->chain.x[13] + (double)self->chain.x[14]); break;
    default: break;
    }
    return answer;
}

static const test_port ports_of_inverse[] = {
    { "answer", 0, 1, 'c' },
    { "force [N]", (uint32_t)offsetof(tff_inverse, output.force), 1, 'r' },
    { "status", (uint32_t)offsetof(tff_inverse, output.status), 1, 'u' },
    { "seen", (uint32_t)offsetof(tff_inverse, output.seen), 1, 'u' },
    { "least force [N]", (uint32_t)offsetof(tff_inverse, output.low), 1, 'r' },
    { "largest force [N]", (uint32_t)offsetof(tff_inverse, output.high), 1, 'r' },
    { "largest change [N]", (uint32_t)offsetof(tff_inverse, output.change), 1, 'r' },
    { "followed [N]", (uint32_t)offsetof(tff_inverse, entry.last), 1, 'r' },
    { "samples left", (uint32_t)offsetof(tff_inverse, entry.left), 1, 'r' },
    { "waiting [s]", (uint32_t)offsetof(tff_inverse, entry.waiting), 1, 'r' },
    { "lost", (uint32_t)offsetof(tff_inverse, entry.lost), 1, 'i' },
    { "states", (uint32_t)offsetof(tff_inverse, chain.x), 30, 'r' },
    { "states before", (uint32_t)offsetof(tff_inverse, chain.x_old), 30, 'r' },
    { "tension at the start [N]", (uint32_t)offsetof(tff_inverse, start), 1, 'r' },
    { "mu", (uint32_t)offsetof(tff_inverse, mu), 1, 'r' },
    { "adhesion", (uint32_t)offsetof(tff_inverse, adhesion), 1, 'r' },
    { "own.piece_adhesion_N", (uint32_t)offsetof(tff_inverse, own.piece_adhesion_N), 1, 'r' },
    { "own.friction_mu_dynamic_pull", (uint32_t)offsetof(tff_inverse, own.friction_mu_dynamic_pull), 1, 'r' },
    { "own.friction_mu_dynamic_release", (uint32_t)offsetof(tff_inverse, own.friction_mu_dynamic_release), 1, 'r' },
};

static double call_stream(void *state, int which, const tff_real *in)
{
    tff_stream *const self = (tff_stream *)state;
    double answer = 0.0;

    (void)in;
    (void)self;
    switch (which) {
    case 0: tff_stream_init(self, in[0]); break;
    case 1: tff_stream_init_at(self, in[0], in[2]); break;
    case 2: answer = (double)tff_stream_step(self, in[0]); break;
    case 3: answer = (double)tff_stream_step_dt(self, in[1], in[0]); break;
    case 4: tff_stream_missed(self, (int32_t)in[3]); break;
    case 5: answer = (double)tff_stream_use(self, test_parameters_of(&in[4])); break;
    default: break;
    }
    return answer;
}

static const test_port ports_of_stream[] = {
    { "answer", 0, 1, 'c' },
    { "force [N]", (uint32_t)offsetof(tff_stream, output.force), 1, 'r' },
    { "status", (uint32_t)offsetof(tff_stream, output.status), 1, 'u' },
    { "seen", (uint32_t)offsetof(tff_stream, output.seen), 1, 'u' },
    { "least force [N]", (uint32_t)offsetof(tff_stream, output.low), 1, 'r' },
    { "largest force [N]", (uint32_t)offsetof(tff_stream, output.high), 1, 'r' },
    { "largest change [N]", (uint32_t)offsetof(tff_stream, output.change), 1, 'r' },
    { "followed [N]", (uint32_t)offsetof(tff_stream, entry.last), 1, 'r' },
    { "samples left", (uint32_t)offsetof(tff_stream, entry.left), 1, 'r' },
    { "waiting [s]", (uint32_t)offsetof(tff_stream, entry.waiting), 1, 'r' },
    { "lost", (uint32_t)offsetof(tff_stream, entry.lost), 1, 'i' },
    { "load-independent friction [N]", (uint32_t)offsetof(tff_stream, inverse.adhesion), 1, 'r' },
    { "least reference [N]", (uint32_t)offsetof(tff_stream, low), 1, 'r' },
    { "largest reference [N]", (uint32_t)offsetof(tff_stream, high), 1, 'r' },
};

static double call_profile(void *state, int which, const tff_real *in)
{
    tff_profile *const self = (tff_profile *)state;
    double answer = 0.0;

    (void)in;
    (void)self;
    switch (which) {
    case 0: tff_profile_init(self); break;
    case 1: answer = (double)tff_profile_step(self); break;
    case 2: answer = (double)tff_profile_at((uint32_t)in[0]); break;
    case 3: answer = (double)tff_profile_at(UINT32_C(4294967295)); break;
    default: break;
    }
    return answer;
}

static const test_port ports_of_profile[] = {
    { "answer", 0, 1, 'c' },
    { "force [N]", (uint32_t)offsetof(tff_profile, output.force), 1, 'r' },
    { "status", (uint32_t)offsetof(tff_profile, output.status), 1, 'u' },
    { "seen", (uint32_t)offsetof(tff_profile, output.seen), 1, 'u' },
    { "least force [N]", (uint32_t)offsetof(tff_profile, output.low), 1, 'r' },
    { "largest force [N]", (uint32_t)offsetof(tff_profile, output.high), 1, 'r' },
    { "largest change [N]", (uint32_t)offsetof(tff_profile, output.change), 1, 'r' },
};

static double call_plant(void *state, int which, const tff_real *in)
{
    tff_plant *const self = (tff_plant *)state;
    double answer = 0.0;

    (void)in;
    (void)self;
    switch (which) {
    case 0: tff_plant_init(self, in[0]); break;
    case 1: answer = (double)tff_plant_step(self, in[1]); break;
    case 2: answer = (double)tff_plant_actuator_position(self); break;
    case 3: answer = (double)tff_plant_load_position(self); break;
    default: break;
    }
    return answer;
}

static const test_port ports_of_plant[] = {
    { "answer", 0, 1, 'c' },
    { "tension [N]", (uint32_t)offsetof(tff_plant, tension), 1, 'r' },
    { "status", (uint32_t)offsetof(tff_plant, status), 1, 'u' },
    { "seen", (uint32_t)offsetof(tff_plant, seen), 1, 'u' },
    { "evaluations", (uint32_t)offsetof(tff_plant, evaluations), 1, 'i' },
    { "states", (uint32_t)offsetof(tff_plant, chain.x), 1, 'r' },
};

static double call_observer(void *state, int which, const tff_real *in)
{
    tff_observer *const self = (tff_observer *)state;
    double answer = 0.0;

    (void)in;
    (void)self;
    switch (which) {
    case 0: tff_observer_init(self, in[0]); break;
    case 1: tff_observer_init_at(self, in[4], in[0]); break;
    case 2: answer = (double)tff_observer_step(self, in[0], in[1]); break;
    case 3: answer = (double)tff_observer_step_dt(self, in[2], in[0], in[1]); break;
    case 4: tff_observer_missed(self, (int32_t)in[3]); break;
    case 5: answer = (double)self->chain.x[22] + (double)self->chain.x[23] + (double)self->chain.x[24] + (double)self->chain.x[25] + (double)self->chain.x[26] + (double)self->chain.x[27]; break;
    default: break;
    }
    return answer;
}

static const test_port ports_of_observer[] = {
    { "answer", 0, 1, 'c' },
    { "tension [N]", (uint32_t)offsetof(tff_observer, output.tension), 1, 'r' },
    { "lower bound [N]", (uint32_t)offsetof(tff_observer, output.low), 1, 'r' },
    { "upper bound [N]", (uint32_t)offsetof(tff_observer, output.high), 1, 'r' },
    { "status", (uint32_t)offsetof(tff_observer, output.status), 1, 'u' },
    { "seen", (uint32_t)offsetof(tff_observer, output.seen), 1, 'u' },
    { "followed [N]", (uint32_t)offsetof(tff_observer, entry.last), 1, 'r' },
    { "samples left", (uint32_t)offsetof(tff_observer, entry.left), 1, 'r' },
    { "waiting [s]", (uint32_t)offsetof(tff_observer, entry.waiting), 1, 'r' },
    { "lost", (uint32_t)offsetof(tff_observer, entry.lost), 1, 'i' },
    { "lower memory [N]", (uint32_t)offsetof(tff_observer, low_memory), 1, 'r' },
    { "upper memory [N]", (uint32_t)offsetof(tff_observer, high_memory), 1, 'r' },
    { "states", (uint32_t)offsetof(tff_observer, chain.x), 1, 'r' },
    { "evaluations", (uint32_t)offsetof(tff_observer, evaluations), 1, 'i' },
};

static const test_module test_modules[] = {
    { "data", call_data, ports_of_data },
    { "limits", call_limits, ports_of_limits },
    { "parameters", call_parameters, ports_of_parameters },
    { "capstan", call_capstan, ports_of_capstan },
    { "table", call_table, ports_of_table },
    { "inverse", call_inverse, ports_of_inverse },
    { "stream", call_stream, ports_of_stream },
    { "profile", call_profile, ports_of_profile },
    { "plant", call_plant, ports_of_plant },
    { "observer", call_observer, ports_of_observer },
};

/* ---- scripts ---- */

/* act, slot, port, look, other, versus, next, a, b */
static const test_line test_lines[] = { NUMBERS };

static const test_check test_checks[] = {
    { "status bits, limits, accepted references and sample time", 0, 40, 1, 0u },
    { "checksum of table_pull_share", 0, 3, 20, 40u },
    { "checksum of table_pull_ratio", 0, 3, 100, 43u },
    { "checksum of table_pull_cell", 0, 3, 129, 46u },
    { "checksum of table_release_share", 0, 3, 17, 49u },
    { "checksum of table_release_ratio", 0, 3, 85, 52u },
    { "checksum of table_release_cell", 0, 3, 65, 55u },
    { "forces, status bits, and bits since init", 1, 15, 62, 58u },
    { "narrower limits hold", 1, 12, 1, 73u },
    { "the scenario's", 2, 11, 1, 85u },
    { "set_mu: what means nothing is refused and changes nothing", 2, 13, 6, 96u },
    { "set_adhesion: what means nothing is refused and changes nothing", 2, 13, 3, 109u },
    { "set_limits: what means nothing is refused and changes nothing", 2, 13, 12, 122u },
    { "set_references: what means nothing is refused and changes nothing", 2, 13, 2, 135u },
    { "what means something is taken", 2, 23, 1, 148u },
    { "golden vectors", 3, 2, 1, 171u },
    { NULL, 3, 11, 1047, 173u },
    { "bad references hold the last good output and say so", 3, 1, 1, 184u },
    { NULL, 3, 4, 6, 185u },
    { NULL, 3, 1, 1, 189u },
    { "bad references leave the state alone", 3, 5, 20, 190u },
    { "the ends of the accepted range are accepted", 3, 8, 1, 195u },
    { "a bad start is replaced and flagged", 3, 5, 6, 203u },
    { "a reference that was lost or missed is led back", 3, 5, 1, 208u },
    { NULL, 3, 3, 1, 213u },
    { NULL, 3, 3, 100, 216u },
    { NULL, 3, 3, 1, 219u },
    { NULL, 3, 3, 100, 222u },
    { NULL, 3, 1, 1, 225u },
    { NULL, 3, 5, 1, 226u },
    { NULL, 3, 3, 1, 231u },
    { NULL, 3, 3, 100, 234u },
    { NULL, 3, 1, 1, 237u },
    { NULL, 3, 3, 1, 238u },
    { NULL, 3, 3, 1, 241u },
    { NULL, 3, 3, 1, 244u },
    { NULL, 3, 3, 2, 247u },
    { NULL, 3, 1, 1, 250u },
    { "parts of a sample are one", 3, 3, 1, 251u },
    { NULL, 3, 22, 13, 254u },
    { "no time, no change", 3, 5, 2, 276u },
    { "the way back after a pause begins where it was", 3, 4, 1, 281u },
    { "steps without a time are of one sample, among others too", 3, 3, 1, 285u },
    { NULL, 3, 40, 9, 288u },
    { "a longer step has its share of the rate limit, the next one that of a sample", 3, 9, 1, 328u },
    { "golden vectors of jumps", 3, 2, 1, 337u },
    { NULL, 3, 10, 12, 339u },
    { "limits that bind are flagged, what did not happen is not", 3, 1, 1, 349u },
    { "a start in motion with a force that means nothing is flagged", 3, 5, 3, 350u },
    { "a start in motion goes on from its force", 3, 8, 1, 355u },
    { "the scenario's parameters are those of init", 3, 9, 1, 363u },
    { "valid parameters are accepted, others refused", 3, 16, 1, 372u },
    { "golden vectors of other friction", 3, 5, 1, 388u },
    { NULL, 3, 3, 160, 393u },
    { "golden vectors", 4, 2, 1, 396u },
    { NULL, 4, 11, 1047, 398u },
    { "bad references hold the last good output and say so", 4, 1, 1, 409u },
    { NULL, 4, 4, 6, 410u },
    { NULL, 4, 1, 1, 414u },
    { "bad references leave the state alone", 4, 5, 20, 415u },
    { "the ends of the accepted range are accepted", 4, 8, 1, 420u },
    { "a bad start is replaced and flagged", 4, 5, 6, 428u },
    { "a reference that was lost or missed is led back", 4, 5, 1, 433u },
    { NULL, 4, 3, 1, 438u },
    { NULL, 4, 3, 100, 441u },
    { NULL, 4, 3, 1, 444u },
    { NULL, 4, 3, 100, 447u },
    { NULL, 4, 1, 1, 450u },
    { NULL, 4, 5, 1, 451u },
    { NULL, 4, 3, 1, 456u },
    { NULL, 4, 3, 100, 459u },
    { NULL, 4, 1, 1, 462u },
    { NULL, 4, 3, 1, 463u },
    { NULL, 4, 3, 1, 466u },
    { NULL, 4, 3, 1, 469u },
    { NULL, 4, 3, 2, 472u },
    { NULL, 4, 1, 1, 475u },
    { "parts of a sample are one", 4, 3, 1, 476u },
    { NULL, 4, 22, 13, 479u },
    { "no time, no change", 4, 5, 2, 501u },
    { "the way back after a pause begins where it was", 4, 4, 1, 506u },
    { "steps without a time are of one sample, among others too", 4, 3, 1, 510u },
    { NULL, 4, 40, 9, 513u },
    { "a longer step has its share of the rate limit, the next one that of a sample", 4, 9, 1, 553u },
    { "golden vectors of jumps", 4, 2, 1, 562u },
    { NULL, 4, 10, 12, 564u },
    { "limits that bind are flagged, what did not happen is not", 4, 1, 1, 574u },
    { "a start in motion with a force that means nothing is flagged", 4, 5, 3, 575u },
    { "a start in motion goes on from its force", 4, 10, 1, 580u },
    { "valid parameters are accepted, others refused", 4, 13, 1, 590u },
    { "golden vectors", 5, 2, 1, 603u },
    { NULL, 5, 11, 1047, 605u },
    { "bad references hold the last good output and say so", 5, 1, 1, 616u },
    { NULL, 5, 4, 6, 617u },
    { NULL, 5, 1, 1, 621u },
    { "bad references leave the state alone", 5, 5, 20, 622u },
    { "the ends of the accepted range are accepted", 5, 8, 1, 627u },
    { "a bad start is replaced and flagged", 5, 5, 6, 635u },
    { "a reference that was lost or missed is led back", 5, 5, 1, 640u },
    { NULL, 5, 3, 1, 645u },
    { NULL, 5, 3, 100, 648u },
    { NULL, 5, 3, 1, 651u },
    { NULL, 5, 3, 100, 654u },
    { NULL, 5, 1, 1, 657u },
    { NULL, 5, 5, 1, 658u },
    { NULL, 5, 3, 1, 663u },
    { NULL, 5, 3, 100, 666u },
    { NULL, 5, 1, 1, 669u },
    { NULL, 5, 3, 1, 670u },
    { NULL, 5, 3, 1, 673u },
    { NULL, 5, 3, 1, 676u },
    { NULL, 5, 3, 2, 679u },
    { NULL, 5, 1, 1, 682u },
    { "parts of a sample are one", 5, 3, 1, 683u },
    { NULL, 5, 22, 13, 686u },
    { "no time, no change", 5, 5, 2, 708u },
    { "the way back after a pause begins where it was", 5, 4, 1, 713u },
    { "steps without a time are of one sample, among others too", 5, 3, 1, 717u },
    { NULL, 5, 40, 9, 720u },
    { "a longer step has its share of the rate limit, the next one that of a sample", 5, 9, 1, 760u },
    { "golden vectors of jumps", 5, 2, 1, 769u },
    { NULL, 5, 10, 12, 771u },
    { "limits that bind are flagged, what did not happen is not", 5, 1, 1, 781u },
    { "a fall that no tendon follows is flagged", 5, 6, 1, 782u },
    { "golden vectors of longer steps", 5, 2, 1, 788u },
    { NULL, 5, 4, 120, 790u },
    { "a start in motion takes force less tension for friction, and the tendon hangs together", 5, 11, 1, 794u },
    { "a start in motion without friction is one at rest", 5, 6, 1, 805u },
    { "a start in motion with a force that means nothing is flagged", 5, 5, 3, 811u },
    { "another mu scales friction both ways and leaves the other parameters", 5, 24, 1, 816u },
    { "the scenario's parameters are those of init", 5, 11, 1, 840u },
    { "valid parameters are accepted, others refused", 5, 18, 1, 851u },
    { "golden vectors of other friction", 5, 5, 1, 869u },
    { NULL, 5, 3, 160, 874u },
    { "golden vectors of a live reference", 6, 2, 1, 877u },
    { NULL, 6, 6, 500, 879u },
    { "a reference that is not a number is flagged, and a rate limit with ramps ahead of it", 6, 3, 1, 885u },
    { NULL, 6, 3, 2, 888u },
    { "references out of range are clamped and flagged", 6, 2, 1, 891u },
    { NULL, 6, 6, 4, 893u },
    { NULL, 6, 6, 4, 899u },
    { "a bad start is replaced and flagged", 6, 4, 1, 905u },
    { "a reference that was lost or missed is led back", 6, 5, 1, 909u },
    { NULL, 6, 3, 1, 914u },
    { NULL, 6, 3, 100, 917u },
    { NULL, 6, 3, 1, 920u },
    { NULL, 6, 3, 100, 923u },
    { NULL, 6, 1, 1, 926u },
    { NULL, 6, 5, 1, 927u },
    { NULL, 6, 3, 1, 932u },
    { NULL, 6, 3, 100, 935u },
    { NULL, 6, 1, 1, 938u },
    { NULL, 6, 3, 1, 939u },
    { NULL, 6, 3, 1, 942u },
    { NULL, 6, 3, 1, 945u },
    { NULL, 6, 3, 2, 948u },
    { NULL, 6, 1, 1, 951u },
    { "parts of a sample are one", 6, 3, 1, 952u },
    { NULL, 6, 21, 13, 955u },
    { "no time, no change", 6, 5, 2, 976u },
    { "the way back after a pause begins where it was", 6, 4, 1, 981u },
    { "steps without a time are of one sample, among others too", 6, 3, 1, 985u },
    { NULL, 6, 40, 9, 988u },
    { "samples between two calls are on the straight line", 6, 3, 1, 1028u },
    { NULL, 6, 17, 20, 1031u },
    { "valid parameters are accepted, others refused", 6, 23, 1, 1048u },
    { "a start in motion keeps the force and is led to the reference", 6, 6, 1, 1071u },
    { "checksum of the profile", 7, 3, 4001, 1077u },
    { "its steps give its samples", 7, 3, 1, 1080u },
    { NULL, 7, 4, 4001, 1083u },
    { "holds its last sample and reports its end", 7, 6, 3, 1087u },
    { "golden vectors", 8, 2, 1, 1093u },
    { NULL, 8, 3, 1047, 1095u },
    { "positions of the ends", 8, 4, 1, 1098u },
    { "bad forces hold the last tension and say so", 8, 6, 2, 1102u },
    { "a step without a solution holds the last tension and says so", 8, 7, 1, 1108u },
    { "a bad start is replaced and flagged", 8, 4, 1, 1115u },
    { "a slack tendon is flagged, or that it was not reached", 8, 2, 1, 1119u },
    { NULL, 8, 2, 200, 1121u },
    { NULL, 8, 1, 1, 1123u },
    { "golden vectors and bounds", 9, 3, 1, 1124u },
    { NULL, 9, 5, 1047, 1127u },
    { NULL, 9, 1, 1, 1132u },
    { "bad inputs hold the last good output, and nothing is known", 9, 0, 1, 1133u },
    { NULL, 9, 6, 4, 1133u },
    { NULL, 9, 6, 2, 1139u },
    { "after lost inputs any history is admitted", 9, 2, 1, 1145u },
    { NULL, 9, 4, 10, 1147u },
    { NULL, 9, 2, 1, 1151u },
    { "a bad start is replaced and flagged", 9, 10, 4, 1153u },
    { "a start in motion takes what is known", 9, 11, 1, 1163u },
    { "a start in motion takes the difference for friction", 9, 7, 1, 1174u },
    { "what was lost or missed is led back", 9, 10, 1, 1181u },
    { NULL, 9, 4, 100, 1191u },
    { NULL, 9, 7, 1, 1195u },
    { "parts of a sample are one", 9, 4, 1, 1202u },
    { NULL, 9, 24, 13, 1206u },
    { "so are steps with and without a time", 9, 4, 1, 1230u },
    { NULL, 9, 25, 13, 1234u },
    { "samples between two calls are on the straight line", 9, 4, 1, 1259u },
    { NULL, 9, 8, 20, 1263u },
    { "what is left of a time waits", 9, 6, 1, 1271u },
    { "golden vectors of a far end that is moved", 9, 3, 1, 1277u },
    { NULL, 9, 6, 200, 1280u },
    { NULL, 9, 1, 1, 1286u },
    { "a step without a solution holds the last tension, says so, and starts over", 9, 10, 1, 1287u },
    { NULL, 9, 1, 8, 1297u },
    { NULL, 9, 4, 1, 1298u },
};

static const tff_real test_numbers[] = { NUMBERS };

#define TEST_DRIVE drive
/* ---- a drive at random ----
 * What instances answer to calls drawn at random: starts, steps with and without a time, pauses, bad inputs. Answers stand
 * for 20 samples as sums with random weights, and all status words as one. Expected are those of this code on
 * the machine that wrote it; what rounding can change is compared no closer, or not at all. */
#define DRIVE_ROWS 20
#define DRIVE_CHANNELS 7
#define DRIVE_WORK (DRIVE_CHANNELS - 1) /* what calls cost: evaluations */
#define DRIVE_START 12345u
static uint32_t drive_drawn = DRIVE_START;
static uint32_t drive_weighed = DRIVE_START;
static double drive_nudge = 0.0; /* of inputs: how much of their scale */
static double drive_sum[DRIVE_CHANNELS];
static uint32_t drive_word = 2166136261u;
static int drive_row = 0;
static int drive_block = 0;

static void drive_done(const char *what); /* a block has ended */

static double drive_next(uint32_t *at)
{
    *at = (*at * 1664525u) + 1013904223u;
    return (double)*at / 4294967296.0;
}

/* Uniform between 0 and 1. */
static double drive_draw(void)
{
    return drive_next(&drive_drawn);
}

/* An input: as it is, or nudged; equal ones alike. */
static tff_real drive_given(double value, double scale)
{
    const double place = (value / scale) * 7919.0;
    return (tff_real)((drive_nudge > 0.0) ? value + (drive_nudge * scale * ((2.0 * (place - floor(place))) - 1.0)) : value);
}

static void drive_say(uint32_t word)
{
    drive_word = (drive_word ^ word) * 16777619u;
}

static void drive_tell(int channel, double value)
{
    const double weight = 0.5 + drive_next(&drive_weighed);
    if (fabs(value) < 1e30) {
        drive_sum[channel] += weight * value;
    } else {
        drive_say(65535u);
    }
}

static void drive_sample(const char *what)
{
    drive_row++;
    if (drive_row == DRIVE_ROWS) {
        int k;
        drive_done(what);
        for (k = 0; k < DRIVE_CHANNELS; k++) {
            drive_sum[k] = 0.0;
        }
        drive_word = 2166136261u;
        drive_row = 0;
        drive_block++;
    }
}

/* A place that is led to targets, at rates between slow and fast, with jumps. */
typedef struct {
    double low, high, usual; /* usual change in a sample */
    double at, target, rate;
} drive_course;

static void drive_begin(drive_course *c, double low, double high, double usual, double at)
{
    c->low = low;
    c->high = high;
    c->usual = usual;
    c->at = at;
    c->target = at;
    c->rate = 0.0;
}

static double drive_move(drive_course *c, double turns)
{
    static const double faster[8] = { NUMBERS };
    if (drive_draw() < turns) {
        c->target = c->low + ((c->high - c->low) * drive_draw());
        c->rate = c->usual * faster[(int)(8.0 * drive_draw())];
    }
    c->at += (fabs(c->target - c->at) <= c->rate) ? (c->target - c->at) : ((c->target > c->at) ? c->rate : -c->rate);
    return c->at;
}
#define DRIVE_BLOCKS 218
/* 0: what rounding can change */
static int drive_failures;

static void drive_done(const char *what)
{
    int k;
    int good = (drive_block < DRIVE_BLOCKS) ? 1 : 0;
    for (k = 0; (good != 0) && (k < DRIVE_CHANNELS); k++) {
        const int place = (drive_block * DRIVE_CHANNELS) + k;
        good = (fabs(drive_sum[k] - drive_expected[place]) <= drive_tolerance[place]) ? 1 : 0;
    }
    if ((good != 0) && (drive_status[drive_block] != 0u)) {
        good = (drive_status[drive_block] == drive_word) ? 1 : 0;
    }
    if (good == 0) {
        drive_failures++;
        if (drive_failures < 10) {
            printf("FAILED: drive at random, block %d of %s\n", drive_block, what);
        }
    }
}
#define DRIVE_SPAN_N 32.976102974601126

/* One of the calls of an episode, the same for every module. */
typedef struct {
    int call;         /* 0 step, 1 step_dt, 2 missed, 3 other parameters, 4 a start in motion */
    tff_real dt, reference, force, position, factor, jolt;
    double measured;  /* added to what is measured */
} drive_call;
static drive_call drive_course_of[100];
static tff_real drive_force[100]; /* of the last module that follows a reference */
static double drive_from;

static void drive_prepare(int episode)
{
    static const double beyond[8] = { NUMBERS };
    drive_course reference;
    double stuck = 0.0;
    double off = 0.0;
    int near = 0;
    int paused = 0;
    int k;
    drive_from = ((episode % 2) == 0) ? 30.0 : (14.023897025398876 + (DRIVE_SPAN_N * drive_draw()));
    drive_begin(&reference, 14.023897025398876, 14.023897025398876 + DRIVE_SPAN_N, 0.0747175546210741, drive_from);
    for (k = 0; k < 100; k++) {
        drive_call *const at = &drive_course_of[k];
        const double what = drive_draw();
        const double fault = drive_draw();
        double wanted = drive_move(&reference, 0.04);
        at->call = ((episode % 3) == 0) ? 0 : ((what < 0.45) ? 0 : ((what < 0.97) ? 1 : ((what < 0.98) ? 2 : ((what < 0.99) ? 3 : 4))));
        at->dt = (tff_real)((double)TFF_STEP_S * ((drive_draw() < 0.02) ? 100.0 : (0.2 + (2.0 * drive_draw()))));
        if ((fault > 0.4) && (fault < 0.42)) {
            at->dt = (tff_real)((fault < 0.405) ? (double)NAN : ((fault < 0.41) ? -1.0 : ((double)TFF_STEP_S * (1.0 + (6e-7 * drive_draw())))));
        }
        if (near != 0) {
            at->call = 0;
            near = 0;
        } else if (((episode % 3) != 0) && (fault > 0.42) && (fault < 0.46)) { /* hardly more than a step, then a step */
            at->call = 1;
            near = 1;
        } else {
            /* as drawn */
        }
        if (near != 0) {
            at->dt = (tff_real)((double)TFF_STEP_S * (1.0 + (0.25 * (fault - 0.42))));
        }
        if ((k > 0) && ((episode % 3) != 0) && (near == 0) && (fault > 0.46) && (fault < 0.48)) { /* hardly more than four times as long as the last */
            const double last = (drive_course_of[k - 1].call == 1) ? (double)drive_course_of[k - 1].dt : (double)TFF_STEP_S;
            if ((last > (0.6 * (double)TFF_STEP_S)) && (last < (2.2 * (double)TFF_STEP_S))) {
                at->call = 1;
                at->dt = (tff_real)(4.02 * last);
            }
        }
        if (paused != 0) { /* a pause leaves no time over */
            at->call = 1;
            at->dt = (tff_real)(0.995 * (double)TFF_STEP_S);
        }
        paused = ((at->call == 1) && ((double)at->dt > (50.0 * (double)TFF_STEP_S))) ? 1 : 0;
        if (fault < 0.012) {
            wanted = (fault < 0.004) ? (double)NAN : ((fault < 0.01) ? beyond[(int)(8.0 * drive_draw())] * DRIVE_SPAN_N : -wanted);
        }
        if ((fault > 0.985) && (episode > 1)) { /* a jump */
            reference.at = reference.low + (DRIVE_SPAN_N * drive_draw());
            wanted = reference.at;
        }
        at->reference = drive_given(wanted, DRIVE_SPAN_N);
        at->force = (tff_real)(((fault > 0.5) && (fault < 0.51)) ? ((fault < 0.504) ? (double)NAN : 1e9) : 0.0);
        at->position = (tff_real)NAN;
        at->jolt = (tff_real)(((episode > 2) && (drive_draw() < 0.1)) ? drive_draw() : -1.0);
        at->factor = (tff_real)(0.7 + (0.6 * drive_draw()));
        if ((fault > 0.6) && (fault < 0.605)) {
            stuck = (drive_draw() < 0.5) ? 40.0 : -40.0;
            off = drive_draw();
        }
        stuck -= (stuck > 0.0) ? 1.0 : ((stuck < 0.0) ? -1.0 : 0.0);
        at->measured = (stuck > 0.0) ? 1e3 : ((stuck < 0.0) ? off : (((fault > 0.7) && (fault < 0.71)) ? (double)NAN : 0.0));
    }
}

/* Parameters that differ from the scenario's, some of them not good. */
static tff_parameters drive_parameters(const drive_call *at)
{
    tff_parameters own;
    tff_parameters_init(&own);
    drive_say((uint32_t)tff_parameters_set_mu(&own, at->factor * own.mu_pull, (((tff_real)2) - at->factor) * own.mu_release));
    drive_say((uint32_t)tff_parameters_set_adhesion(&own, own.adhesion + (tff_real)(0.01 * DRIVE_SPAN_N)));
    drive_say((uint32_t)tff_parameters_set_limits(&own, own.force_min + (tff_real)(0.02 * DRIVE_SPAN_N), (tff_real)0.9 * own.force_max, (tff_real)0.8 * own.force_rate_max));
    if (at->factor > (tff_real)1.2) {
        own.adhesion = -(tff_real)1;
    }
    drive_say((uint32_t)tff_parameters_are_good(&own));
    return own;
}

static void drive_capstan(void)
{
    static tff_capstan self;
    int k;

    tff_capstan_init(&self, drive_given(drive_from, DRIVE_SPAN_N));
    for (k = 0; k < 100; k++) {
        const drive_call *const at = &drive_course_of[k];
        tff_real f = self.output.force;

        switch (at->call) {
        case 0: f = tff_capstan_step(&self, at->reference); break;
        case 1: f = tff_capstan_step_dt(&self, at->dt, at->reference); break;
        case 2: tff_capstan_missed(&self, 20); tff_capstan_missed(&self, (at->factor > 1) ? 7 : -7); break;
        case 3: { const tff_parameters own = drive_parameters(at); drive_say((uint32_t)tff_capstan_use(&self, &own)); break; }
        default: tff_capstan_init_at(&self, drive_given(drive_from, DRIVE_SPAN_N), drive_given((double)at->factor * drive_from, DRIVE_SPAN_N)); break;
        }
        drive_tell(0, (double)f);
        drive_tell(1, (double)self.output.force);
        drive_say(self.output.status);
        drive_say(self.output.seen);
        drive_force[k] = self.output.force;

        drive_sample("capstan");
    }
}


static void drive_table(void)
{
    static tff_table self;
    int k;

    tff_table_init(&self, drive_given(drive_from, DRIVE_SPAN_N));
    for (k = 0; k < 100; k++) {
        const drive_call *const at = &drive_course_of[k];
        tff_real f = self.output.force;

        switch (at->call) {
        case 0: f = tff_table_step(&self, at->reference); break;
        case 1: f = tff_table_step_dt(&self, at->dt, at->reference); break;
        case 2: tff_table_missed(&self, 20); tff_table_missed(&self, (at->factor > 1) ? 7 : -7); break;
        case 3: { const tff_parameters own = drive_parameters(at); drive_say((uint32_t)tff_table_use(&self, &own)); break; }
        default: tff_table_init_at(&self, drive_given(drive_from, DRIVE_SPAN_N), drive_given((double)at->factor * drive_from, DRIVE_SPAN_N)); break;
        }
        drive_tell(0, (double)f);
        drive_tell(1, (double)self.output.force);
        drive_say(self.output.status);
        drive_say(self.output.seen);
        drive_force[k] = self.output.force;

        drive_sample("table");
    }
}


static void drive_stream(void)
{
    static tff_stream self;
    int k;

    tff_stream_init(&self, drive_given(drive_from, DRIVE_SPAN_N));
    for (k = 0; k < 100; k++) {
        const drive_call *const at = &drive_course_of[k];
        tff_real f = self.output.force;

        switch (at->call) {
        case 0: f = tff_stream_step(&self, at->reference); break;
        case 1: f = tff_stream_step_dt(&self, at->dt, at->reference); break;
        case 2: tff_stream_missed(&self, 20); tff_stream_missed(&self, (at->factor > 1) ? 7 : -7); break;
        case 3: { const tff_parameters own = drive_parameters(at); drive_say((uint32_t)tff_stream_use(&self, &own)); break; }
        default: tff_stream_init_at(&self, drive_given(drive_from, DRIVE_SPAN_N), drive_given((double)at->factor * drive_from, DRIVE_SPAN_N)); break;
        }
        drive_tell(0, (double)f);
        drive_tell(1, (double)self.output.force);
        drive_say(self.output.status);
        drive_say(self.output.seen);
        drive_force[k] = self.output.force;

        drive_sample("stream");
    }
}


static void drive_inverse(void)
{
    static tff_inverse self;
    int k;

    tff_inverse_init(&self, drive_given(drive_from, DRIVE_SPAN_N));
    for (k = 0; k < 100; k++) {
        const drive_call *const at = &drive_course_of[k];
        tff_real f = self.output.force;

        switch (at->call) {
        case 0: f = tff_inverse_step(&self, at->reference); break;
        case 1: f = tff_inverse_step_dt(&self, at->dt, at->reference); break;
        case 2: tff_inverse_missed(&self, 20); tff_inverse_missed(&self, (at->factor > 1) ? 7 : -7); break;
        case 3: { const tff_parameters own = drive_parameters(at); drive_say((uint32_t)tff_inverse_use(&self, &own)); break; }
        default: tff_inverse_init_at(&self, drive_given(drive_from, DRIVE_SPAN_N), drive_given((double)at->factor * drive_from, DRIVE_SPAN_N)); break;
        }
        drive_tell(0, (double)f);
        drive_tell(1, (double)self.output.force);
        drive_say(self.output.status);
        drive_say(self.output.seen);
        drive_force[k] = self.output.force;
        drive_tell(3, (double)tff_inverse_mu(&self));
        if ((k == 60) && (at->factor > 1)) {
            tff_inverse_set_mu(&self, at->factor * tff_inverse_mu(&self));
        }

        drive_sample("inverse");
    }
}


static void drive_plant(void)
{
    static tff_plant self;
    int k;
    tff_plant_init(&self, drive_given(drive_from, DRIVE_SPAN_N));
    for (k = 0; k < 100; k++) {
        const double fault = (double)drive_course_of[k].force;
        drive_tell(0, (double)tff_plant_step(&self, (isnan(fault) || (fault > 1.0)) ? drive_course_of[k].force : ((drive_course_of[k].jolt < 0) ? drive_force[k] : (drive_course_of[k].jolt * (tff_real)(DRIVE_SPAN_N * 2.0)))));
        drive_tell(4, (double)tff_plant_actuator_position(&self));
        drive_tell(5, (double)tff_plant_load_position(&self));
        drive_tell(DRIVE_WORK, (double)self.evaluations);
        drive_say(self.status);
        drive_say(self.seen);
        drive_course_of[k].position = (tff_real)tff_plant_actuator_position(&self);
        drive_sample("plant");
    }
}

static void drive_observer(int episode)
{
    static tff_observer self;
    double moved = 0.0;
    int k;
    tff_observer_init(&self, drive_given(drive_from, DRIVE_SPAN_N));
    for (k = 0; k < 100; k++) {
        const drive_call *const at = &drive_course_of[k];
        const double fault = (double)at->force;
        const tff_real input = ((isnan(fault) || (fault > 1.0)) ? at->force : ((at->jolt < 0) ? drive_force[k] : (at->jolt * (tff_real)(DRIVE_SPAN_N * 2.0))));
        tff_real position = (tff_real)NAN;
        if ((episode % 2) == 1) {
            moved = (at->measured > 0.0) ? (0.01 * at->measured) : moved;
            position = at->position + (tff_real)(isnan(at->measured) ? 0.0 : 1e-5 * moved);
        }
        if (at->call == 0) {
            drive_tell(0, (double)tff_observer_step(&self, input, position));
        } else if (at->call == 1) {
            drive_tell(0, (double)tff_observer_step_dt(&self, at->dt, input, position));
        } else if (at->call == 2) {
            tff_observer_missed(&self, 20);
            tff_observer_missed(&self, (at->factor > 1) ? 7 : -7);
        } else {
            tff_observer_init_at(&self, drive_given(drive_from, DRIVE_SPAN_N), drive_given((double)at->factor * drive_from, DRIVE_SPAN_N));
        }
        drive_tell(0, (double)self.output.tension);
        drive_tell(1, (double)self.output.low);
        drive_tell(2, (double)self.output.high);
        drive_tell(DRIVE_WORK, (double)self.evaluations);
        drive_say(self.output.status);
        drive_say(self.output.seen);
        drive_sample("observer");
    }
}

/* Parameters at the ends of their ranges. */
static void drive_edges(void)
{
    static const double share[5] = { NUMBERS };
    static const double value[19] = { NUMBERS };
    int field;
    int k;
    for (field = 0; field < 8; field++) {
        for (k = 0; k < 95; k++) {
            const tff_real to = (tff_real)(value[k / 5] * share[k % 5]);
            tff_parameters own;
            tff_real *fields[8];
            tff_parameters_init(&own);
            fields[0] = &own.mu_pull;
            fields[1] = &own.mu_release;
            fields[2] = &own.adhesion;
            fields[3] = &own.force_min;
            fields[4] = &own.force_max;
            fields[5] = &own.force_rate_max;
            fields[6] = &own.reference_min;
            fields[7] = &own.reference_max;
            *fields[field] = to;
            drive_say((uint32_t)tff_parameters_are_good(&own));
            *fields[field] = -to;
            drive_say((uint32_t)tff_parameters_are_good(&own));
            tff_parameters_init(&own);
            drive_say((uint32_t)tff_parameters_set_mu(&own, to, own.mu_release));
            drive_say((uint32_t)tff_parameters_set_mu(&own, own.mu_pull, to));
            drive_say((uint32_t)tff_parameters_set_adhesion(&own, to));
            drive_say((uint32_t)tff_parameters_set_limits(&own, own.force_min, to, own.force_rate_max));
            drive_say((uint32_t)tff_parameters_set_references(&own, own.reference_min, to));
            drive_sample("parameters");
        }
    }
}

static void drive(void)
{
    int episode;
    drive_edges();
    for (episode = 0; episode < 6; episode++) {
        drive_prepare(episode);
        drive_capstan();
        drive_table();
        drive_stream();
        drive_inverse();
        drive_plant();
        drive_observer(episode);
    }
}

