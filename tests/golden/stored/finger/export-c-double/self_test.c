/* self_test.c: what the modules answer, what they must never do, and whether their data are whole.
 *
 * Scenario "robot finger: polymer tendon on six 30 degree arcs", hash 6b567c7d1473e421, level presliding.
 * Written by tendonff VERSION export-c --precision double --prefix tff.
 * The licence of tendonff does not cover what it writes: this file is yours.
 * Golden vectors come from the Python model: first the scenario's reference, 5 samples in one so that the
 * whole course fits, and a way to and fro that turns round in unfinished transitions; then jumps, in which the limits
 * of force and rate bind. All bounds are stated here anew, apart from the headers. Exit status 0 when everything passes.
 */
#ifndef ARDUINO /* whose tools compile every file of a library */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "tff_capstan.h"
#include "tff_inverse.h"
#include "tff_profile.h"
#include "tff_table.h"
#include "tff_stream.h"
#include "tff_plant.h"
#include "tff_observer.h"
#include "tff_table_data.h"

#define ROWS 1047
#define JUMPS 12
#define LIMIT_CASES 62

/* Bounds that no output may leave [N]. */
#define LEAST_N 0.0
#define MOST_N 200.0
#define CHANGE_N 100.0
#define ROUNDING 1e-12

static const tff_real golden_reference[ROWS] = { NUMBERS };
static const double golden_capstan[ROWS] = { NUMBERS };
static const double golden_inverse[ROWS] = { NUMBERS };
static const double golden_table[ROWS] = { NUMBERS };
static const tff_real jump_reference[JUMPS] = { NUMBERS };
static const double jump_capstan[JUMPS] = { NUMBERS };
static const double jump_inverse[JUMPS] = { NUMBERS };
static const double jump_table[JUMPS] = { NUMBERS };
#define LONGER 120
static const double longer_inverse[LONGER] = { NUMBERS };
#define OTHER 160
static const double other_capstan[OTHER] = { NUMBERS };
static const double other_inverse[OTHER] = { NUMBERS };
#define PLANT_ROWS 1047
static const double golden_plant[PLANT_ROWS] = { NUMBERS };
static const tff_real golden_plant_force[ROWS] = { NUMBERS };

#define SEEN 1047
static const tff_real seen_input[SEEN] = { NUMBERS };
static const double seen_output[SEEN] = { NUMBERS };
static const double seen_low[SEEN] = { NUMBERS };
static const double seen_high[SEEN] = { NUMBERS };
#define SEEN_FAR 200
static const tff_real seen_position[SEEN_FAR] = { NUMBERS };
static const double seen_far_output[SEEN_FAR] = { NUMBERS };
#define LIVE 500
static const tff_real live_reference[LIVE] = {
    30.0, 30.00791745357067, 30.00791745357067, 30.00791745357067, 30.040893187036129, 30.073868920501592,
    30.106844653967055, 30.172796120897981, 30.205771854363441, 30.337674788225293, 30.370650521690752,
    30.502553455552601, 30.568504922483527, 30.634456389414453, 30.766359323276301, 30.89826225713815,
    30.964213724069076, 31.096116657930924, 31.19504385832731, 31.359922525654621, 31.425873992585547,
    31.656704126843781, 31.78860706070563, 31.854558527636556, 32.052412928429327, 32.250267329222105,
    32.38217026308395, 32.514073196945802, 32.744903331204036, 32.909781998531351, 33.074660665858659,
    33.173587866255048, 33.371442267047819, 33.60227240130606, 33.701199601702442, 33.932029735960676,
    34.063932669822528, 34.261787070615298, 34.459641471408077, 34.624520138735384, 34.822374539528163,
    34.954277473390007, 35.119156140717323, 35.317010541510093, 35.481889208837408, 35.712719343095642,
    35.844622276957487, 36.009500944284802, 36.141403878146654, 36.306282545473962, 36.504136946266733,
    36.603064146663122, 36.767942813990437, 36.932821481317745, 37.064724415179597, 37.196627349041442,
    37.295554549437831, 37.427457483299683, 37.559360417161528, 37.625311884092454, 37.757214817954299,
    37.856142018350688, 37.955069218747077, 38.021020685678003, 38.119947886074385, 38.152923619539848,
    38.251850819936237, 38.350778020332626, 38.383753753798089, 38.416729487263545, 38.449705220729008,
    38.482680954194471, 38.548632421125397, 38.58160815459086, 38.614583888056323, 38.647559621521786,
    38.58160815459086, 38.680535354987249, 38.647559621521786, 38.647559621521786, 38.647559621521786,
    38.614583888056323, 38.58160815459086, 38.548632421125397, 38.614583888056323, 38.548632421125397,
    38.515656687659934, 38.482680954194471, 38.482680954194471, 38.416729487263545, 38.350778020332626,
    38.383753753798089, 38.251850819936237, 38.218875086470774, 38.251850819936237, 38.152923619539848,
    38.086972152608922, 38.053996419143466, 38.053996419143466, 38.021020685678003, 37.955069218747077,
    37.856142018350688, 37.69126335102338, 37.592336150626991, 37.526384683696065, 37.427457483299683,
    37.262578815972368, 37.196627349041442, 37.163651615575979, 37.064724415179597, 36.965797214783208,
    36.866870014386819, 36.866870014386819, 36.767942813990437, 36.767942813990437, 36.701991347059511,
    36.669015613594048, 36.537112679732196, 36.570088413197659, 36.504136946266733, 36.504136946266733,
    36.471161212801277, 36.504136946266733, 36.438185479335814, 36.504136946266733, 36.438185479335814,
    36.471161212801277, 36.504136946266733, 36.537112679732196, 36.504136946266733, 36.603064146663122,
    36.636039880128585, 36.669015613594048, 36.636039880128585, 36.734967080524974, 36.800918547455893,
    36.767942813990437, 36.866870014386819, 36.899845747852282, 36.932821481317745, 37.031748681714134,
    37.09770014864506, 37.196627349041442, 37.262578815972368, 37.295554549437831, 37.361506016368757,
    37.427457483299683, 37.526384683696065, 37.526384683696065, 37.625311884092454, 37.658287617557917,
    37.757214817954299, 37.856142018350688, 37.889117751816151, 37.955069218747077, 38.053996419143466,
    38.086972152608922, 38.185899353005311, 38.152923619539848, 38.251850819936237, 38.317802286867163,
    38.383753753798089, 38.383753753798089, 38.416729487263545, 38.449705220729008, 38.482680954194471,
    38.449705220729008, 38.548632421125397, 38.482680954194471, 38.515656687659934, 38.482680954194471,
    38.548632421125397, 38.515656687659934, 38.482680954194471, 38.449705220729008, 38.416729487263545,
    38.317802286867163, 38.251850819936237, 38.185899353005311, 38.185899353005311, 38.119947886074385,
    38.053996419143466, 37.955069218747077, 37.856142018350688, 37.724239084488843, 37.559360417161528,
    37.427457483299683, 37.361506016368757, 37.130675882110516, 37.064724415179597, 36.899845747852282,
    36.701991347059511, 36.504136946266733, 36.273306812008499, 36.108428144681191, 35.943549477353876,
    35.712719343095642, 35.514864942302871, 35.251059074579167, 35.020228940320933, (tff_real)NAN, (tff_real)NAN,
    (tff_real)NAN, (tff_real)NAN, (tff_real)NAN, (tff_real)NAN, (tff_real)NAN, (tff_real)NAN, (tff_real)NAN,
    (tff_real)NAN, (tff_real)NAN, (tff_real)NAN, (tff_real)NAN, (tff_real)NAN, (tff_real)NAN, (tff_real)NAN,
    (tff_real)NAN, (tff_real)NAN, (tff_real)NAN, (tff_real)NAN, (tff_real)NAN, (tff_real)NAN, (tff_real)NAN,
    (tff_real)NAN, (tff_real)NAN, (tff_real)NAN, (tff_real)NAN, (tff_real)NAN, (tff_real)NAN, (tff_real)NAN,
    (tff_real)NAN, (tff_real)NAN, (tff_real)NAN, (tff_real)NAN, (tff_real)NAN, (tff_real)NAN, (tff_real)NAN,
    (tff_real)NAN, (tff_real)NAN, (tff_real)NAN, 21.104469417895857, 20.774712083241234, 20.411979015121148,
    20.115197413931988, 19.818415812742828, 19.488658478088205, 19.125925409968119, 18.862119542244422,
    18.598313674520721, 18.235580606400639, 17.938799005211475, 17.674993137487778, 17.411187269764081,
    17.213332868971307, 16.916551267782147, 16.652745400058446, 16.421915265800212, 16.224060865007438,
    16.059182197680126, 15.795376329956429, 15.663473396094579, 15.465618995301806, 15.333716061439956,
    15.135861660647183, 15.003958726785335, 14.872055792923485, 14.674201392130712, 14.608249925199788,
    14.476346991337937, 14.37741979094155, 14.311468324010626, 14.245516857079702, 14.179565390148777,
    14.146589656683314, 14.113613923217853, 14.047662456286929, 14.08063818975239, 14.047662456286929,
    14.014686722821466, 14.047662456286929, 14.014686722821466, 14.08063818975239, 14.113613923217853,
    14.179565390148777, 14.21254112361424, 14.37741979094155, 14.443371257872476, 14.476346991337937,
    14.641225658665249, 14.707177125596173, 14.80610432599256, 15.003958726785335, 15.135861660647183,
    15.201813127578108, 15.399667528370882, 15.597521929163655, 15.762400596490966, 15.894303530352815,
    16.125133664611052, 16.290012331938364, 16.421915265800212, 16.619769666592987, 16.817624067385758,
    17.048454201643995, 17.24630860243677, 17.444163003229541, 17.674993137487778, 17.938799005211475,
    18.169629139469713, 18.367483540262487, 18.664265141451647, 18.895095275709881, 19.092949676502656,
    19.356755544226353, 19.58758567848459, 19.752464345811902, 20.016270213535599, 20.313051814724759,
    20.510906215517533, 20.741736349775771, 21.005542217499467, 21.236372351757705, 21.467202486015939,
    21.698032620274176, 21.895887021066951, 22.159692888790648, 22.390523023048882, 22.654328890772582,
    22.852183291565357, 23.083013425823591, 23.214916359685439, 23.445746493943677, 23.709552361667374,
    23.841455295529222, 24.07228542978746, 24.303115564045694, 24.435018497907546, 24.66584863216578,
    24.764775832562169, 24.96263023335494, 25.127508900682251, 25.292387568009563, 25.457266235336874,
    25.622144902664186, 25.754047836526034, 25.852975036922423, 25.951902237318809, 26.083805171180657,
    26.215708105042506, 26.380586772369817, 26.41356250583528, 26.578441173162592, 26.611416906628055,
    26.776295573955366, 26.809271307420829, 26.908198507817215, 26.941174241282678, 27.040101441679063,
    27.106052908609989, 27.139028642075452, 27.172004375540912, 27.237955842471838, 27.270931575937301,
    27.237955842471838, 27.303907309402764, 27.303907309402764, 27.303907309402764, 27.369858776333686,
    27.336883042868223, 27.402834509799149, 27.402834509799149, 27.336883042868223, 27.402834509799149,
    27.336883042868223, 27.369858776333686, 27.369858776333686, 27.303907309402764, 27.303907309402764,
    27.303907309402764, 27.237955842471838, 27.270931575937301, 27.172004375540912, 27.204980109006375,
    27.172004375540912, 27.172004375540912, 27.106052908609989, 27.073077175144526, 27.040101441679063,
    27.073077175144526, 27.073077175144526, 27.0071257082136, 27.0071257082136, 27.0071257082136, 26.974149974748141,
    27.0071257082136, 27.040101441679063, 27.040101441679063, 27.040101441679063, 27.040101441679063,
    27.040101441679063, 27.106052908609989, 27.040101441679063, 27.139028642075452, 27.106052908609989,
    27.204980109006375, 27.270931575937301, 27.303907309402764, 27.336883042868223, 27.435810243264612,
    27.501761710195535, 27.600688910591924, 27.666640377522846, 27.798543311384694, 27.897470511781084,
    27.930446245246547, 28.029373445642932, 28.194252112970243, 28.326155046832092, 28.45805798069394,
    28.622936648021252, 28.721863848417641, 28.886742515744952, 29.117572650003186, 29.249475583865035,
    29.447329984657809, 29.579232918519658, 29.843038786243358, 30.040893187036129, 30.172796120897981,
    30.403626255156215, 30.60148065594899, 30.865286523672687, 31.129092391396387, 31.392898259120084,
    31.557776926447396, 31.854558527636556, 32.118364395360253, 32.415145996549413, 32.613000397342191,
    32.942757731996814, 33.239539333185974, 33.503345200909671, 33.734175335167905, 34.030956936357065,
    34.360714271011688, 34.624520138735384, 34.954277473390007, 35.251059074579167, 35.547840675768327,
    35.943549477353876, 36.240331078543036, 36.537112679732196, 36.866870014386819, 37.163651615575979,
    37.460433216765139, 37.757214817954299, 38.086972152608922, 38.482680954194471, 38.746486821918168,
    39.043268423107328, 39.373025757761951, 39.735758825882037, 39.999564693605734, 40.329322028260357,
    40.65907936291498, 40.922885230638684, 41.252642565293307, 41.549424166482467, 41.780254300740701,
    42.077035901929861, 42.340841769653558, 42.670599104308181, 42.901429238566415, 43.165235106290112,
    43.494992440944735, 43.725822575202976, 43.989628442926673, 44.187482843719444, 44.418312977977685,
    44.649143112235919, 44.84699751302869, 45.011876180356005, 45.209730581148776, 45.44056071540701,
    45.572463649268862, 45.803293783527096, 45.902220983923485, 46.067099651250793, 46.231978318578108,
    46.363881252439953, 46.429832719370879, 46.561735653232731, 46.66066285362912, 46.726614320560039,
    46.792565787490965, 46.891492987887354, 46.95744445481828, 46.924468721352817, 46.990420188283736,
    47.023395921749199
};
static const double live_stream[LIVE] = { NUMBERS };

static int failures = 0;

static double larger(double a, double b)
{
    return (b <= a) ? a : b; /* this way round NaN counts as larger */
}

static void report(const char *name, double error, double tolerance)
{
    const int good = error <= tolerance;
    printf("%s %s, largest difference %.3g N, at most %.3g N\n", good ? "passes" : "FAILS ", name, error, tolerance);
    if (!good) {
        failures++;
    }
}

static void expect(const char *name, int good)
{
    printf("%s %s\n", good ? "passes" : "FAILS ", name);
    if (!good) {
        failures++;
    }
}

static int is_near(double value, double expected)
{
    return fabs(value - expected) <= (ROUNDING * (1.0 + fabs(expected)));
}

/* Within bounds, but for the rounding of the real type. */
static int is_between(double value, double low, double high)
{
    const double slack = ROUNDING * (1.0 + fabs(value));
    return (value >= (low - slack)) && (value <= (high + slack));
}

/* ---- constants and data ---- */

static uint32_t fnv_byte(uint32_t sum, uint32_t byte)
{
    return (sum ^ (byte & 0xFFu)) * UINT32_C(16777619);
}

static uint32_t fnv_real(uint32_t sum, tff_real value)
{
    uint64_t bits;
    unsigned k;

    memcpy(&bits, &value, sizeof bits);
    for (k = 0u; k < (8u * (unsigned)sizeof bits); k += 8u) {
        sum = fnv_byte(sum, (uint32_t)((bits >> k) & 0xFFu));
    }
    return sum;
}

static void data(void)
{
    uint32_t sum = UINT32_C(2166136261);
    uint32_t k;

    expect("status bits", (TFF_OK == 0u) && (TFF_INPUT_HELD == 1u) && (TFF_FORCE_LIMITED == 2u) && (TFF_RATE_LIMITED == 4u)
           && (TFF_WOULD_PUSH == 8u) && (TFF_FAILED == 16u) && (TFF_ENDED == 32u) && (TFF_RANGE == 1024u));
    expect("limits of the actuator", is_near((double)TFF_FORCE_MIN_N, LEAST_N) && is_near((double)TFF_FORCE_MAX_N, MOST_N)
           && is_near((double)TFF_CHANGE_MAX_N, CHANGE_N));
    expect("accepted references and sample time", is_near((double)TFF_REFERENCE_MIN_N, 0.14023897025398877)
           && is_near((double)TFF_REFERENCE_MAX_N, 106.69761821822065) && is_near((double)TFF_STEP_S, 0.001));
    for (k = 0u; k < (uint32_t)TFF_PROFILE_LENGTH; k++) {
        sum = fnv_real(sum, tff_profile_at(k));
    }
    expect("checksum of the profile", (TFF_PROFILE_LENGTH == 4001) && (sum == UINT32_C(CHECKSUM)));
    sum = UINT32_C(2166136261);
    for (k = 0u; k < (uint32_t)TFF_TABLE_PULL_SHARES; k++) {
        sum = fnv_real(sum, tff_table_pull_share[k]);
    }
    for (k = 0u; k < (uint32_t)(TFF_TABLE_REFERENCES * TFF_TABLE_PULL_SHARES); k++) {
        sum = fnv_real(sum, tff_table_pull_ratio[k]);
    }
    expect("checksum of the pull table", sum == UINT32_C(CHECKSUM));
    sum = UINT32_C(2166136261);
    for (k = 0u; k < (uint32_t)(sizeof tff_table_pull_cell / sizeof tff_table_pull_cell[0]); k++) {
        sum = fnv_byte(sum, (uint32_t)tff_table_pull_cell[k]);
        sum = fnv_byte(sum, ((uint32_t)tff_table_pull_cell[k]) >> 8);
    }
    expect("checksum of its index", sum == UINT32_C(CHECKSUM));
    sum = UINT32_C(2166136261);
    for (k = 0u; k < (uint32_t)TFF_TABLE_RELEASE_SHARES; k++) {
        sum = fnv_real(sum, tff_table_release_share[k]);
    }
    for (k = 0u; k < (uint32_t)(TFF_TABLE_REFERENCES * TFF_TABLE_RELEASE_SHARES); k++) {
        sum = fnv_real(sum, tff_table_release_ratio[k]);
    }
    expect("checksum of the release table", sum == UINT32_C(CHECKSUM));
    sum = UINT32_C(2166136261);
    for (k = 0u; k < (uint32_t)(sizeof tff_table_release_cell / sizeof tff_table_release_cell[0]); k++) {
        sum = fnv_byte(sum, (uint32_t)tff_table_release_cell[k]);
        sum = fnv_byte(sum, ((uint32_t)tff_table_release_cell[k]) >> 8);
    }
    expect("checksum of its index", sum == UINT32_C(CHECKSUM));
    expect("range of the table", is_near((double)TFF_TABLE_MIN_N, 12.375091876668819)
           && is_near((double)TFF_TABLE_MAX_N, 48.648805148730055)
           && is_near((double)TFF_TABLE_FIRST_N, 12.375091876668819)
           && is_near((double)TFF_TABLE_CELLS_PER_N, 0.11027269168720266));
}

/* ---- the limiter ---- */

static void limits(void)
{
    typedef struct {
        tff_real before, wanted, force;
        uint32_t status;
    } limit_case;
    static const limit_case cases[LIMIT_CASES] = {
        { 100.0, 100.0, 100.0, 0u },
        { 100.0, 125.0, 125.0, 0u },
        { 100.0, 75.0, 75.0, 0u },
        { 100.0, (tff_real)NAN, 100.0, 16u },
        { 100.0, (tff_real)INFINITY, 100.0, 16u },
        { 100.0, -(tff_real)INFINITY, 100.0, 16u },
        { 100.0, 2.9999999999999998e+30, 100.0, 16u },
        { 100.0, -2.9999999999999998e+30, 100.0, 16u },
        { 0.0, 125.0, 100.0, 4u },
        { 0.0, 75.0, 75.0, 0u },
        { 0.0, 0.0, 0.0, 0u },
        { 0.0, 200.0, 100.0, 4u },
        { 0.0, -25.0, 0.0, 2u },
        { 0.0, 225.0, 100.0, 6u },
        { 0.0, 9.9999999999999991e+28, 100.0, 6u },
        { 0.0, -9.9999999999999991e+28, 0.0, 2u },
        { 0.0, (tff_real)NAN, 0.0, 16u },
        { 0.0, (tff_real)INFINITY, 0.0, 16u },
        { 0.0, -(tff_real)INFINITY, 0.0, 16u },
        { 0.0, 2.9999999999999998e+30, 0.0, 16u },
        { 0.0, -2.9999999999999998e+30, 0.0, 16u },
        { 200.0, 125.0, 125.0, 0u },
        { 200.0, 75.0, 100.0, 4u },
        { 200.0, 0.0, 100.0, 4u },
        { 200.0, 200.0, 200.0, 0u },
        { 200.0, -25.0, 100.0, 6u },
        { 200.0, 225.0, 200.0, 2u },
        { 200.0, 9.9999999999999991e+28, 200.0, 2u },
        { 200.0, -9.9999999999999991e+28, 100.0, 6u },
        { 200.0, (tff_real)NAN, 200.0, 16u },
        { 200.0, (tff_real)INFINITY, 200.0, 16u },
        { 200.0, -(tff_real)INFINITY, 200.0, 16u },
        { 200.0, 2.9999999999999998e+30, 200.0, 16u },
        { 200.0, -2.9999999999999998e+30, 200.0, 16u },
        { -800.0, 100.0, -700.0, 4u },
        { -800.0, 125.0, -700.0, 4u },
        { -800.0, 75.0, -700.0, 4u },
        { -800.0, 0.0, -700.0, 4u },
        { -800.0, 200.0, -700.0, 4u },
        { -800.0, -25.0, -700.0, 6u },
        { -800.0, 225.0, -700.0, 6u },
        { -800.0, 9.9999999999999991e+28, -700.0, 6u },
        { -800.0, -9.9999999999999991e+28, -700.0, 6u },
        { -800.0, (tff_real)NAN, -800.0, 16u },
        { -800.0, (tff_real)INFINITY, -800.0, 16u },
        { -800.0, -(tff_real)INFINITY, -800.0, 16u },
        { -800.0, 2.9999999999999998e+30, -800.0, 16u },
        { -800.0, -2.9999999999999998e+30, -800.0, 16u },
        { 1000.0, 100.0, 900.0, 4u },
        { 1000.0, 125.0, 900.0, 4u },
        { 1000.0, 75.0, 900.0, 4u },
        { 1000.0, 0.0, 900.0, 4u },
        { 1000.0, 200.0, 900.0, 4u },
        { 1000.0, -25.0, 900.0, 6u },
        { 1000.0, 225.0, 900.0, 6u },
        { 1000.0, 9.9999999999999991e+28, 900.0, 6u },
        { 1000.0, -9.9999999999999991e+28, 900.0, 6u },
        { 1000.0, (tff_real)NAN, 1000.0, 16u },
        { 1000.0, (tff_real)INFINITY, 1000.0, 16u },
        { 1000.0, -(tff_real)INFINITY, 1000.0, 16u },
        { 1000.0, 2.9999999999999998e+30, 1000.0, 16u },
        { 1000.0, -2.9999999999999998e+30, 1000.0, 16u },
    };
    tff_output output;
    int k, good = 1, flagged = 1, gathered = 1, start = 1;

    for (k = 0; k < LIMIT_CASES; k++) {
        tff_real force;
        tff_output_init(&output, cases[k].before);
        start = start && is_between((double)output.force, LEAST_N, MOST_N) && (output.status == TFF_OK) && (output.seen == TFF_OK);
        output.force = cases[k].before;
        force = tff_output_set(&output, cases[k].wanted);
        good = good && is_near((double)force, (double)cases[k].force) && is_near((double)output.force, (double)cases[k].force);
        flagged = flagged && (output.status == cases[k].status);
        force = tff_output_hold(&output, TFF_INPUT_HELD);
        good = good && is_near((double)force, (double)cases[k].force);
        flagged = flagged && (output.status == TFF_INPUT_HELD);
        gathered = gathered && (output.seen == (cases[k].status | TFF_INPUT_HELD));
    }
    expect("limiter: force", good);
    expect("limiter: status bits", flagged);
    expect("limiter: bits seen since init", gathered);
    expect("limiter: start within the limits", start);
}

/* ---- what can be set at run time ---- */

static int is_same(const tff_parameters *one, const tff_parameters *two)
{
    return is_near((double)one->mu_pull, (double)two->mu_pull) && is_near((double)one->mu_release, (double)two->mu_release) && is_near((double)one->adhesion, (double)two->adhesion) && is_near((double)one->force_min, (double)two->force_min) && is_near((double)one->force_max, (double)two->force_max) && is_near((double)one->force_rate_max, (double)two->force_rate_max) && is_near((double)one->reference_min, (double)two->reference_min) && is_near((double)one->reference_max, (double)two->reference_max);
}

static void parameters(void)
{
    const tff_real bad[3] = { (tff_real)NAN, (tff_real)INFINITY, (tff_real)-1 };
    tff_parameters self;
    tff_parameters before;
    tff_output output;
    int k, refused = 1, taken;

    tff_parameters_init(&self);
    expect("parameters: the scenario's", (tff_parameters_are_good(&self) == 1) && is_near((double)self.mu_pull, 0.20000000000000001) && is_near((double)self.mu_release, 0.20000000000000001) && is_near((double)self.adhesion, 0.0) && is_near((double)self.force_min, 0.0) && is_near((double)self.force_max, 200.0) && is_near((double)self.force_rate_max, 100000.0) && is_near((double)self.reference_min, 5.7798712817485942) && is_near((double)self.reference_max, 55.244025743650283));
    before = self;
    for (k = 0; k < 3; k++) {
        refused = refused && (tff_parameters_set_mu(&self, bad[k], self.mu_release) == 0) && (tff_parameters_set_mu(&self, self.mu_pull, bad[k]) == 0);
        refused = refused && (tff_parameters_set_adhesion(&self, bad[k]) == 0);
        refused = refused && (tff_parameters_set_limits(&self, bad[k] - (tff_real)1e3, self.force_max, self.force_rate_max) == 0);
        refused = refused && (tff_parameters_set_limits(&self, self.force_min, bad[k] - (tff_real)1e3, self.force_rate_max) == 0);
        refused = refused && (tff_parameters_set_limits(&self, self.force_min, self.force_max, bad[k]) == 0);
        refused = refused && (tff_parameters_set_references(&self, bad[k] - (tff_real)1e3, self.reference_max) == 0);
        refused = refused && (tff_parameters_set_references(&self, self.reference_min, bad[k] - (tff_real)1e3) == 0);
    }
    refused = refused && (tff_parameters_set_limits(&self, self.force_min, 203.0, self.force_rate_max) == 0);
    refused = refused && (tff_parameters_set_limits(&self, -1.0, self.force_max, self.force_rate_max) == 0);
    refused = refused && (tff_parameters_set_limits(&self, self.force_min, self.force_max, 101000.0) == 0);
    refused = refused && (tff_parameters_set_limits(&self, self.force_max, self.force_min, self.force_rate_max) == 0);
    expect("parameters: what means nothing is refused and changes nothing", refused && is_same(&self, &before));
    taken = (tff_parameters_set_mu(&self, 0.18000000000000002, 0.16000000000000003) == 1)
            && (tff_parameters_set_adhesion(&self, 0.5) == 1)
            && (tff_parameters_set_limits(&self, 50.0, 150.0, (tff_real)0.5 * before.force_rate_max) == 1);
    taken = taken && is_near((double)self.mu_pull, 0.18000000000000002) && is_near((double)self.mu_release, 0.16000000000000003)
            && is_near((double)self.adhesion, 0.5) && is_near((double)self.force_min, 50.0) && is_near((double)self.force_max, 150.0);
    expect("parameters: what means something is taken", taken);
    tff_output_init(&output, 100.0);
    tff_output_use(&output, &self);
    taken = is_near((double)output.low, 50.0) && is_near((double)output.high, 150.0)
            && (fabs((double)output.change - (0.5 * CHANGE_N)) <= (1e-5 * CHANGE_N));
    (void)tff_output_set(&output, (tff_real)MOST_N + (tff_real)1);
    taken = taken && ((double)output.force <= 150.00015099999999) && (output.status != TFF_OK);
    expect("parameters: narrower limits hold", taken);
}

/* ---- modules that follow a reference ---- */

static int is_allowed(double force, double before)
{
    const double slack = ROUNDING * (fabs(force) + fabs(before) + 1.0);
    return (force >= (LEAST_N - slack)) && (force <= (MOST_N + slack)) && (fabs(force - before) <= (CHANGE_N + slack));
}

/* Whether the bits are those of what happened: a rate that binds, a force inside its limits, and no others but `more`. */
static int is_stated(uint32_t status, double force, double before, uint32_t more)
{
    const double slack = ROUNDING * (fabs(force) + fabs(before) + 1.0);
    const double left = CHANGE_N - fabs(force - before);
    const int inside = (force > (LEAST_N + slack)) && (force < (MOST_N - slack));
    int stated = (status & ~(more | TFF_FORCE_LIMITED | TFF_RATE_LIMITED)) == TFF_OK;

    if (fabs(left) > slack) {
        stated = stated && ((status & TFF_RATE_LIMITED) == TFF_OK);
        stated = stated && (!inside || ((status & TFF_FORCE_LIMITED) == TFF_OK));
    }
    return stated;
}

static void test_capstan(void)
{
    const tff_real bad[6] = { (tff_real)NAN, (tff_real)INFINITY, -(tff_real)INFINITY, (tff_real)-1, 0.13743419084890898, 108.83157058258507 };
    tff_capstan self;
    tff_capstan other;
    double error = 0.0;
    double before;
    double first;
    int k, allowed = 1, held = 1, same = 1, started = 1, stated = 1, taken;

    tff_capstan_init(&self, golden_reference[0]);
    before = (double)self.output.force;
    for (k = 0; k < ROWS; k++) {
        const double force = (double)tff_capstan_step(&self, golden_reference[k]);
        error = larger(error, fabs(force - golden_capstan[k]));
        allowed = allowed && is_allowed(force, before) && is_near(force, (double)self.output.force);
        stated = stated && is_stated(self.output.status, force, before, TFF_WOULD_PUSH);
        before = force;
    }
    report("capstan: golden vectors", error, 8.7999999999999994e-08);
    /* not a number, or out of range: the last good output, and as if the call had not been */
    other = self;
    for (k = 0; k < 6; k++) {
        held = held && is_near((double)tff_capstan_step(&self, bad[k]), before) && (self.output.status == ((k < 3) ? TFF_INPUT_HELD : TFF_RANGE));
    }
    held = held && ((self.output.seen & TFF_HELD) == TFF_HELD);
    for (k = 0; k < 20; k++) {
        first = (double)tff_capstan_step(&self, golden_reference[ROWS - 1]);
        same = same && is_near(first, (double)tff_capstan_step(&other, golden_reference[ROWS - 1])) && (self.output.status == other.output.status);
    }
    expect("capstan: bad references hold the last good output and say so", held);
    expect("capstan: bad references leave the state alone", same);
    (void)tff_capstan_step(&self, 0.24679634950195545);
    same = (self.output.status & TFF_HELD) == 0u;
    tff_capstan_init(&self, golden_reference[0]);
    (void)tff_capstan_step(&self, 106.59106083897269);
    same = same && ((self.output.status & TFF_HELD) == 0u);
    expect("capstan: the ends of the accepted range are accepted", same);
    for (k = 0; k < 6; k++) {
        tff_capstan_init(&self, bad[k]);
        started = started && is_allowed((double)self.output.force, (double)self.output.force) && (self.output.status == TFF_INPUT_HELD)
                  && (self.output.seen == TFF_INPUT_HELD);
        started = started && is_between((double)self.output.force, fmin(MOST_N, fmax(LEAST_N, 0.14009873128373479)), fmin(MOST_N, fmax(LEAST_N, 106.80431583643886)));
    }
    expect("capstan: a bad start is replaced and flagged", started);
    {
        const tff_real from = golden_reference[0];
        const tff_real to = 47.0;
        tff_capstan whole; /* that lost nothing */
        double way;
        int way_back = 1, n;
        tff_capstan_init(&whole, from);
        (void)tff_capstan_step(&whole, from);
        (void)tff_capstan_step(&whole, to);
        way = (double)whole.entry.last - (double)from;
        for (n = 0; n < 3; n++) { /* long lost, missed, lost for one sample */
            const int span = (n == 2) ? 2 : 100;
            tff_capstan led;
            int m;
            tff_capstan_init(&led, from);
            (void)tff_capstan_step(&led, from);
            for (m = 0; m < ((n == 0) ? 100 : (n - 1)); m++) {
                (void)tff_capstan_step(&led, (tff_real)NAN);
                way_back = way_back && ((led.output.status & TFF_INPUT_HELD) != 0u);
            }
            if (n == 1) {
                tff_capstan_missed(&led, 100);
            }
            for (m = 0; m <= span; m++) {
                double share;
                (void)tff_capstan_step(&led, to);
                share = ((double)led.entry.last - (double)from) / way;
                way_back = way_back && is_between(share, 0.0, 1.0) && ((m > 0) || (fabs(share) <= (10.0 * ROUNDING))) && ((m < span) || (fabs(share - 1.0) <= (10.0 * ROUNDING)));
            }
        }
        expect("capstan: what was lost or missed is led back", way_back);
    }

    {
        const tff_real from = golden_reference[0];
        const tff_real to = 47.0;
        const tff_real part = (tff_real)0.5 * TFF_STEP_MIN_S;
        tff_capstan usual;
        tff_capstan own;
        int alike = 1, m;
        tff_real force;
        tff_capstan_init(&usual, from);
        tff_capstan_init(&own, from);
        for (m = 0; m < 40; m++) {
            const tff_real target = from + ((to - from) * ((tff_real)m / (tff_real)400));
            force = tff_capstan_step(&usual, target);
            if ((m % 3) == 1) {
                (void)tff_capstan_step_dt(&own, part, target);
                alike = alike && (own.output.status == TFF_OK);
            }
            alike = alike && is_near((double)tff_capstan_step_dt(&own, ((m % 3) == 1) ? (TFF_STEP_S - part) : TFF_STEP_S, target), (double)force);
        }
        expect("capstan: parts of a sample are one", alike);
        alike = is_near((double)tff_capstan_step_dt(&own, (tff_real)NAN, to), (double)force) && (own.output.status == TFF_INPUT_HELD);
        alike = alike && is_near((double)tff_capstan_step_dt(&own, -TFF_STEP_S, to), (double)force) && (own.output.status == TFF_INPUT_HELD);
        expect("capstan: no time, no change", alike);
        force = own.entry.last;
        (void)tff_capstan_step_dt(&own, (tff_real)0.5, to);
        expect("capstan: the way back after a pause", is_near((double)own.entry.last, (double)force));
        tff_capstan_init(&usual, from);
        tff_capstan_init(&own, from);
        alike = 1;
        for (m = 0; m < 60; m++) { /* now and then the time is left out, while parts of a sample wait */
            const tff_real target = from + ((to - from) * ((tff_real)m / (tff_real)400));
            const int whole = ((m % 7) < 3) ? 1 : 0;
            const tff_real time = (whole != 0) ? TFF_STEP_S : ((m % 7) == 6) ? part : (((tff_real)0.25 * (tff_real)(m % 7)) * TFF_STEP_S);
            force = tff_capstan_step_dt(&usual, time, target);
            alike = alike && is_near((whole != 0) ? (double)tff_capstan_step(&own, target) : (double)tff_capstan_step_dt(&own, time, target), (double)force)
                && (own.output.status == usual.output.status) && (own.output.seen == usual.output.seen);
        }
        expect("capstan: steps without a time are of one sample, among others too", alike);
        {
            const double narrow = 1e-3 * fabs((double)to - (double)from);
            double force_before;
            tff_capstan_init(&own, from);
            (void)tff_capstan_step(&own, from);
            own.output.change = (tff_real)narrow;
            force_before = (double)own.output.force;
            (void)tff_capstan_step_dt(&own, (tff_real)1.5 * TFF_STEP_S, to);
            alike = fabs((double)own.output.force - force_before) <= ((1.5 * narrow) + (ROUNDING * (1.0 + fabs(force_before))));
            alike = alike && (fabs((double)own.output.change - narrow) <= (1e-6 * narrow));
            expect("capstan: a longer step has its share of the rate limit, the next one that of a sample", alike);
        }
    }

    error = 0.0;
    tff_capstan_init(&self, jump_reference[0]);
    before = (double)self.output.force;
    for (k = 0; k < JUMPS; k++) {
        const double force = (double)tff_capstan_step(&self, jump_reference[k]);
        error = larger(error, fabs(force - jump_capstan[k]));
        allowed = allowed && is_allowed(force, before);
        stated = stated && is_stated(self.output.status, force, before, TFF_WOULD_PUSH);
        before = force;
    }
    expect("capstan: the status is what happened, and nothing else", stated);
    report("capstan: golden vectors of jumps", error, 8.7999999999999994e-08);
    expect("capstan: every force within the limits", allowed);
    expect("capstan: limits that bind are flagged", (self.output.seen & 0u) == 0u);
    expect("capstan: what did not happen is not flagged", (self.output.seen & (TFF_HELD | TFF_FAILED | TFF_ENDED)) == 0u);
    {
        const tff_real forces[3] = { (tff_real)NAN, -1000000000.0, 1000000000.0 };
        const tff_real force = 100.0;
        same = 1;
        for (k = 0; k < 3; k++) {
            tff_capstan_init_at(&other, golden_reference[0], forces[k]);
            same = same && is_allowed((double)other.output.force, (double)other.output.force) && (((other.output.status & TFF_INPUT_HELD) != 0u));
        }
        expect("capstan: a start in motion with a force that means nothing is flagged", same);
        tff_capstan_init_at(&other, golden_reference[0], force);
        same = is_near((double)other.output.force, (double)force) && (other.output.status == TFF_OK);
        same = same && is_near((double)tff_capstan_step(&other, golden_reference[0]), (double)force) && (other.entry.left > 0.0);
        expect("capstan: a start in motion goes on from its force", same);
    }
    {
        tff_parameters given;
        tff_parameters_init(&given);
        /* what init holds as numbers and what is worked out of the scenario's parameters is the same */
        tff_capstan_init(&self, golden_reference[0]);
        same = (tff_capstan_use(&self, &given) == 1);
        tff_capstan_init(&other, golden_reference[0]);
        same = same && is_near((double)self.pull, (double)other.pull);
        same = same && is_near((double)self.release, (double)other.release);
        same = same && is_near((double)self.adhesion, (double)other.adhesion);
        expect("capstan: the scenario's parameters are those of init", same);
        given.force_max = 150.0;
        taken = (tff_capstan_use(&other, &given) == 1) && is_near((double)other.output.high, 150.0);
        given.force_max = (tff_real)NAN;
        given.adhesion += 1.0;
        self = other;
        taken = taken && (tff_capstan_use(&other, &given) == 0) && (memcmp(&self, &other, sizeof self) == 0);
    }
    expect("capstan: valid parameters are accepted, others refused", taken);
    {
        tff_parameters given;
        tff_parameters_init(&given);
        given.mu_release = 0.18000000000000002;
        given.adhesion = 1.5361751440791798;
        tff_capstan_init(&self, golden_reference[ROWS - OTHER]);
        taken = (tff_capstan_use(&self, &given) == 1);
        error = 0.0;
        for (k = 0; k < OTHER; k++) {
            error = larger(error, fabs((double)tff_capstan_step(&self, golden_reference[(ROWS - OTHER) + k]) - other_capstan[k]));
        }
        expect("capstan: other friction is taken", taken);
        report("capstan: golden vectors of other friction", error, 4.1000000000000003e-08);
    }
}

static void test_inverse(void)
{
    const tff_real bad[6] = { (tff_real)NAN, (tff_real)INFINITY, -(tff_real)INFINITY, (tff_real)-1, 0.13743419084890898, 108.83157058258507 };
    tff_inverse self;
    tff_inverse other;
    double error = 0.0;
    double before;
    double first;
    int k, allowed = 1, held = 1, same = 1, started = 1, stated = 1, taken;

    tff_inverse_init(&self, golden_reference[0]);
    before = (double)self.output.force;
    for (k = 0; k < ROWS; k++) {
        const double force = (double)tff_inverse_step(&self, golden_reference[k]);
        error = larger(error, fabs(force - golden_inverse[k]));
        allowed = allowed && is_allowed(force, before) && is_near(force, (double)self.output.force);
        stated = stated && is_stated(self.output.status, force, before, TFF_WOULD_PUSH);
        before = force;
    }
    report("inverse: golden vectors", error, 8.4999999999999994e-08);
    /* not a number, or out of range: the last good output, and as if the call had not been */
    other = self;
    for (k = 0; k < 6; k++) {
        held = held && is_near((double)tff_inverse_step(&self, bad[k]), before) && (self.output.status == ((k < 3) ? TFF_INPUT_HELD : TFF_RANGE));
    }
    held = held && ((self.output.seen & TFF_HELD) == TFF_HELD);
    for (k = 0; k < 20; k++) {
        first = (double)tff_inverse_step(&self, golden_reference[ROWS - 1]);
        same = same && is_near(first, (double)tff_inverse_step(&other, golden_reference[ROWS - 1])) && (self.output.status == other.output.status);
    }
    expect("inverse: bad references hold the last good output and say so", held);
    expect("inverse: bad references leave the state alone", same);
    (void)tff_inverse_step(&self, 0.24679634950195545);
    same = (self.output.status & TFF_HELD) == 0u;
    tff_inverse_init(&self, golden_reference[0]);
    (void)tff_inverse_step(&self, 106.59106083897269);
    same = same && ((self.output.status & TFF_HELD) == 0u);
    expect("inverse: the ends of the accepted range are accepted", same);
    for (k = 0; k < 6; k++) {
        tff_inverse_init(&self, bad[k]);
        started = started && is_allowed((double)self.output.force, (double)self.output.force) && (self.output.status == TFF_INPUT_HELD)
                  && (self.output.seen == TFF_INPUT_HELD);
        started = started && is_between((double)self.output.force, fmin(MOST_N, fmax(LEAST_N, 0.14009873128373479)), fmin(MOST_N, fmax(LEAST_N, 106.80431583643886)));
    }
    expect("inverse: a bad start is replaced and flagged", started);
    {
        const tff_real from = golden_reference[0];
        const tff_real to = 47.0;
        tff_inverse whole; /* that lost nothing */
        double way;
        int way_back = 1, n;
        tff_inverse_init(&whole, from);
        (void)tff_inverse_step(&whole, from);
        (void)tff_inverse_step(&whole, to);
        way = (double)whole.entry.last - (double)from;
        for (n = 0; n < 3; n++) { /* long lost, missed, lost for one sample */
            const int span = (n == 2) ? 2 : 100;
            tff_inverse led;
            int m;
            tff_inverse_init(&led, from);
            (void)tff_inverse_step(&led, from);
            for (m = 0; m < ((n == 0) ? 100 : (n - 1)); m++) {
                (void)tff_inverse_step(&led, (tff_real)NAN);
                way_back = way_back && ((led.output.status & TFF_INPUT_HELD) != 0u);
            }
            if (n == 1) {
                tff_inverse_missed(&led, 100);
            }
            for (m = 0; m <= span; m++) {
                double share;
                (void)tff_inverse_step(&led, to);
                share = ((double)led.entry.last - (double)from) / way;
                way_back = way_back && is_between(share, 0.0, 1.0) && ((m > 0) || (fabs(share) <= (10.0 * ROUNDING))) && ((m < span) || (fabs(share - 1.0) <= (10.0 * ROUNDING)));
            }
        }
        expect("inverse: what was lost or missed is led back", way_back);
    }

    {
        const tff_real from = golden_reference[0];
        const tff_real to = 47.0;
        const tff_real part = (tff_real)0.5 * TFF_STEP_MIN_S;
        tff_inverse usual;
        tff_inverse own;
        int alike = 1, m;
        tff_real force;
        tff_inverse_init(&usual, from);
        tff_inverse_init(&own, from);
        for (m = 0; m < 40; m++) {
            const tff_real target = from + ((to - from) * ((tff_real)m / (tff_real)400));
            force = tff_inverse_step(&usual, target);
            if ((m % 3) == 1) {
                (void)tff_inverse_step_dt(&own, part, target);
                alike = alike && (own.output.status == TFF_OK);
            }
            alike = alike && is_near((double)tff_inverse_step_dt(&own, ((m % 3) == 1) ? (TFF_STEP_S - part) : TFF_STEP_S, target), (double)force);
        }
        expect("inverse: parts of a sample are one", alike);
        alike = is_near((double)tff_inverse_step_dt(&own, (tff_real)NAN, to), (double)force) && (own.output.status == TFF_INPUT_HELD);
        alike = alike && is_near((double)tff_inverse_step_dt(&own, -TFF_STEP_S, to), (double)force) && (own.output.status == TFF_INPUT_HELD);
        expect("inverse: no time, no change", alike);
        force = own.entry.last;
        (void)tff_inverse_step_dt(&own, (tff_real)0.5, to);
        expect("inverse: the way back after a pause", is_near((double)own.entry.last, (double)force));
        tff_inverse_init(&usual, from);
        tff_inverse_init(&own, from);
        alike = 1;
        for (m = 0; m < 60; m++) { /* now and then the time is left out, while parts of a sample wait */
            const tff_real target = from + ((to - from) * ((tff_real)m / (tff_real)400));
            const int whole = ((m % 7) < 3) ? 1 : 0;
            const tff_real time = (whole != 0) ? TFF_STEP_S : ((m % 7) == 6) ? part : (((tff_real)0.25 * (tff_real)(m % 7)) * TFF_STEP_S);
            force = tff_inverse_step_dt(&usual, time, target);
            alike = alike && is_near((whole != 0) ? (double)tff_inverse_step(&own, target) : (double)tff_inverse_step_dt(&own, time, target), (double)force)
                && (own.output.status == usual.output.status) && (own.output.seen == usual.output.seen);
        }
        expect("inverse: steps without a time are of one sample, among others too", alike);
        {
            const double narrow = 1e-3 * fabs((double)to - (double)from);
            double force_before;
            tff_inverse_init(&own, from);
            (void)tff_inverse_step(&own, from);
            own.output.change = (tff_real)narrow;
            force_before = (double)own.output.force;
            (void)tff_inverse_step_dt(&own, (tff_real)1.5 * TFF_STEP_S, to);
            alike = fabs((double)own.output.force - force_before) <= ((1.5 * narrow) + (ROUNDING * (1.0 + fabs(force_before))));
            alike = alike && (fabs((double)own.output.change - narrow) <= (1e-6 * narrow));
            expect("inverse: a longer step has its share of the rate limit, the next one that of a sample", alike);
        }
    }

    error = 0.0;
    tff_inverse_init(&self, jump_reference[0]);
    before = (double)self.output.force;
    for (k = 0; k < JUMPS; k++) {
        const double force = (double)tff_inverse_step(&self, jump_reference[k]);
        error = larger(error, fabs(force - jump_inverse[k]));
        allowed = allowed && is_allowed(force, before);
        stated = stated && is_stated(self.output.status, force, before, TFF_WOULD_PUSH);
        before = force;
    }
    expect("inverse: the status is what happened, and nothing else", stated);
    report("inverse: golden vectors of jumps", error, 1.1000000000000001e-06);
    expect("inverse: every force within the limits", allowed);
    expect("inverse: limits that bind are flagged", (self.output.seen & 6u) == 6u);
    {
        uint32_t bits = TFF_OK;
        tff_inverse_init(&other, 47.0);
        for (k = 0; k < 2; k++) {
            (void)tff_inverse_step(&other, 0.14304374965906855);
            bits |= other.output.status;
        }
        expect("inverse: a fall that no tendon follows is flagged", ((bits & TFF_WOULD_PUSH) != 0u) && (other.output.seen == bits));
    }
    error = 0.0;
    tff_inverse_init(&other, golden_reference[0]);
    for (k = 0; k < LONGER; k++) {
        error = larger(error, fabs((double)tff_inverse_step_dt(&other, 1.5 * TFF_STEP_S, golden_reference[k]) - longer_inverse[k]));
    }
    report("inverse: golden vectors of longer steps", error, 7.0000000000000005e-08);
    expect("inverse: what did not happen is not flagged", (self.output.seen & (TFF_HELD | TFF_FAILED | TFF_ENDED)) == 0u);
    {
        double friction = 0.0;
        double stretched = 0.0;
        tff_inverse_init_at(&other, 30.0, 43.116841313780071);
        same = is_near((double)other.output.force, 43.116841313780071) && (other.output.status == TFF_OK);
        same = same && is_near((double)other.start, 30.0);
        for (k = 0; k < TFF_INVERSE_COUNT; k++) {
            friction += (double)other.chain.x[22 + k];
        }
        same = same && (fabs(friction - (13.116841313780071)) <= (1e2 * ROUNDING * 44.116841313780071));
        for (k = 0; k <= TFF_INVERSE_COUNT; k++) {
            stretched += other.chain.x[8 + k];
        }
        same = same && (fabs((other.chain.x[28] - other.chain.x[29]) - stretched) <= (1e2 * ROUNDING * stretched));
        for (k = 0; k < TFF_INVERSE_REALS; k++) {
            same = same && is_near((double)other.chain.x[k], (double)other.chain.x_old[k]);
        }
        expect("inverse: a start in motion takes force less tension for friction, and the tendon hangs together", same);
        tff_inverse_init_at(&other, 30.0, 30.0);
        tff_inverse_init(&self, 30.0);
        same = 1;
        for (k = 0; k < TFF_INVERSE_REALS; k++) {
            same = same && is_near((double)self.chain.x[k], (double)other.chain.x[k]);
        }
        expect("inverse: a start in motion without friction is one at rest", same && (other.entry.lost == 0));
    }
    {
        tff_parameters given;
        const tff_real forces[3] = { (tff_real)NAN, -1000000000.0, 1000000000.0 };
        same = 1;
        for (k = 0; k < 3; k++) {
            tff_inverse_init_at(&other, golden_reference[0], forces[k]);
            same = same && is_allowed((double)other.output.force, (double)other.output.force) && (((other.output.status & TFF_INPUT_HELD) != 0u));
        }
        expect("inverse: a start in motion with a force that means nothing is flagged", same);
        tff_parameters_init(&given);
        given.adhesion += 0.5;
        given.force_max = 150.0;
        tff_inverse_init(&other, golden_reference[0]);
        same = (tff_inverse_use(&other, &given) == 1);
        tff_inverse_set_mu(&other, 0.18000000000000002);
        same = same && is_near((double)tff_inverse_mu(&other), 0.18000000000000002);
        same = same && is_near((double)other.adhesion, (double)given.adhesion) && is_near((double)other.output.high, (double)given.force_max);
        given.mu_pull = 0.18000000000000002;
        given.mu_release = 0.18000000000000002;
        tff_inverse_init(&self, golden_reference[0]);
        same = same && (tff_inverse_use(&self, &given) == 1);
        same = same && is_near((double)self.mu, (double)other.mu);
        same = same && is_near((double)self.adhesion, (double)other.adhesion);
        same = same && is_near((double)self.own.piece_adhesion_N, (double)other.own.piece_adhesion_N);
        same = same && is_near((double)self.own.friction_mu_dynamic_pull, (double)other.own.friction_mu_dynamic_pull);
        same = same && is_near((double)self.own.friction_mu_dynamic_release, (double)other.own.friction_mu_dynamic_release);
        tff_inverse_set_mu(&other, (tff_real)NAN);
        same = same && is_near((double)tff_inverse_mu(&other), 0.18000000000000002);
        expect("inverse: another mu scales friction both ways and leaves the other parameters", same);
    }
    {
        tff_parameters given;
        tff_parameters_init(&given);
        /* what init holds as numbers and what is worked out of the scenario's parameters is the same */
        tff_inverse_init(&self, golden_reference[0]);
        same = (tff_inverse_use(&self, &given) == 1);
        tff_inverse_init(&other, golden_reference[0]);
        same = same && is_near((double)self.mu, (double)other.mu);
        same = same && is_near((double)self.adhesion, (double)other.adhesion);
        same = same && is_near((double)self.own.piece_adhesion_N, (double)other.own.piece_adhesion_N);
        same = same && is_near((double)self.own.friction_mu_dynamic_pull, (double)other.own.friction_mu_dynamic_pull);
        same = same && is_near((double)self.own.friction_mu_dynamic_release, (double)other.own.friction_mu_dynamic_release);
        expect("inverse: the scenario's parameters are those of init", same);
        given.force_max = 150.0;
        taken = (tff_inverse_use(&other, &given) == 1) && is_near((double)other.output.high, 150.0);
        given.force_max = (tff_real)NAN;
        given.adhesion += 1.0;
        self = other;
        taken = taken && (tff_inverse_use(&other, &given) == 0) && (memcmp(&self, &other, sizeof self) == 0);
    }
    expect("inverse: valid parameters are accepted, others refused", taken);
    {
        tff_parameters given;
        tff_parameters_init(&given);
        given.mu_release = 0.18000000000000002;
        given.adhesion = 1.5361751440791798;
        tff_inverse_init(&self, golden_reference[ROWS - OTHER]);
        taken = (tff_inverse_use(&self, &given) == 1);
        error = 0.0;
        for (k = 0; k < OTHER; k++) {
            error = larger(error, fabs((double)tff_inverse_step(&self, golden_reference[(ROWS - OTHER) + k]) - other_inverse[k]));
        }
        expect("inverse: other friction is taken", taken);
        report("inverse: golden vectors of other friction", error, 4.0000000000000001e-08);
    }
}

static void test_table(void)
{
    const tff_real bad[6] = { (tff_real)NAN, (tff_real)INFINITY, -(tff_real)INFINITY, (tff_real)-1, 12.127590039135443, 49.621781251704654 };
    tff_table self;
    tff_table other;
    double error = 0.0;
    double before;
    double first;
    int k, allowed = 1, held = 1, same = 1, started = 1, stated = 1, taken;

    tff_table_init(&self, golden_reference[0]);
    before = (double)self.output.force;
    for (k = 0; k < ROWS; k++) {
        const double force = (double)tff_table_step(&self, golden_reference[k]);
        error = larger(error, fabs(force - golden_table[k]));
        allowed = allowed && is_allowed(force, before) && is_near(force, (double)self.output.force);
        stated = stated && is_stated(self.output.status, force, before, TFF_WOULD_PUSH);
        before = force;
    }
    report("table: golden vectors", error, 8.6000000000000002e-08);
    /* not a number, or out of range: the last good output, and as if the call had not been */
    other = self;
    for (k = 0; k < 6; k++) {
        held = held && is_near((double)tff_table_step(&self, bad[k]), before) && (self.output.status == ((k < 3) ? TFF_INPUT_HELD : TFF_RANGE));
    }
    held = held && ((self.output.seen & TFF_HELD) == TFF_HELD);
    for (k = 0; k < 20; k++) {
        first = (double)tff_table_step(&self, golden_reference[ROWS - 1]);
        same = same && is_near(first, (double)tff_table_step(&other, golden_reference[ROWS - 1])) && (self.output.status == other.output.status);
    }
    expect("table: bad references hold the last good output and say so", held);
    expect("table: bad references leave the state alone", same);
    (void)tff_table_step(&self, 12.41136558994088);
    same = (self.output.status & TFF_HELD) == 0u;
    tff_table_init(&self, golden_reference[0]);
    (void)tff_table_step(&self, 48.612531435457996);
    same = same && ((self.output.status & TFF_HELD) == 0u);
    expect("table: the ends of the accepted range are accepted", same);
    for (k = 0; k < 6; k++) {
        tff_table_init(&self, bad[k]);
        started = started && is_allowed((double)self.output.force, (double)self.output.force) && (self.output.status == TFF_INPUT_HELD)
                  && (self.output.seen == TFF_INPUT_HELD);
        started = started && is_between((double)self.output.force, fmin(MOST_N, fmax(LEAST_N, 12.36271678479215)), fmin(MOST_N, fmax(LEAST_N, 48.697453953878778)));
    }
    expect("table: a bad start is replaced and flagged", started);
    {
        const tff_real from = golden_reference[0];
        const tff_real to = 47.0;
        tff_table whole; /* that lost nothing */
        double way;
        int way_back = 1, n;
        tff_table_init(&whole, from);
        (void)tff_table_step(&whole, from);
        (void)tff_table_step(&whole, to);
        way = (double)whole.entry.last - (double)from;
        for (n = 0; n < 3; n++) { /* long lost, missed, lost for one sample */
            const int span = (n == 2) ? 2 : 100;
            tff_table led;
            int m;
            tff_table_init(&led, from);
            (void)tff_table_step(&led, from);
            for (m = 0; m < ((n == 0) ? 100 : (n - 1)); m++) {
                (void)tff_table_step(&led, (tff_real)NAN);
                way_back = way_back && ((led.output.status & TFF_INPUT_HELD) != 0u);
            }
            if (n == 1) {
                tff_table_missed(&led, 100);
            }
            for (m = 0; m <= span; m++) {
                double share;
                (void)tff_table_step(&led, to);
                share = ((double)led.entry.last - (double)from) / way;
                way_back = way_back && is_between(share, 0.0, 1.0) && ((m > 0) || (fabs(share) <= (10.0 * ROUNDING))) && ((m < span) || (fabs(share - 1.0) <= (10.0 * ROUNDING)));
            }
        }
        expect("table: what was lost or missed is led back", way_back);
    }

    {
        const tff_real from = golden_reference[0];
        const tff_real to = 47.0;
        const tff_real part = (tff_real)0.5 * TFF_STEP_MIN_S;
        tff_table usual;
        tff_table own;
        int alike = 1, m;
        tff_real force;
        tff_table_init(&usual, from);
        tff_table_init(&own, from);
        for (m = 0; m < 40; m++) {
            const tff_real target = from + ((to - from) * ((tff_real)m / (tff_real)400));
            force = tff_table_step(&usual, target);
            if ((m % 3) == 1) {
                (void)tff_table_step_dt(&own, part, target);
                alike = alike && (own.output.status == TFF_OK);
            }
            alike = alike && is_near((double)tff_table_step_dt(&own, ((m % 3) == 1) ? (TFF_STEP_S - part) : TFF_STEP_S, target), (double)force);
        }
        expect("table: parts of a sample are one", alike);
        alike = is_near((double)tff_table_step_dt(&own, (tff_real)NAN, to), (double)force) && (own.output.status == TFF_INPUT_HELD);
        alike = alike && is_near((double)tff_table_step_dt(&own, -TFF_STEP_S, to), (double)force) && (own.output.status == TFF_INPUT_HELD);
        expect("table: no time, no change", alike);
        force = own.entry.last;
        (void)tff_table_step_dt(&own, (tff_real)0.5, to);
        expect("table: the way back after a pause", is_near((double)own.entry.last, (double)force));
        tff_table_init(&usual, from);
        tff_table_init(&own, from);
        alike = 1;
        for (m = 0; m < 60; m++) { /* now and then the time is left out, while parts of a sample wait */
            const tff_real target = from + ((to - from) * ((tff_real)m / (tff_real)400));
            const int whole = ((m % 7) < 3) ? 1 : 0;
            const tff_real time = (whole != 0) ? TFF_STEP_S : ((m % 7) == 6) ? part : (((tff_real)0.25 * (tff_real)(m % 7)) * TFF_STEP_S);
            force = tff_table_step_dt(&usual, time, target);
            alike = alike && is_near((whole != 0) ? (double)tff_table_step(&own, target) : (double)tff_table_step_dt(&own, time, target), (double)force)
                && (own.output.status == usual.output.status) && (own.output.seen == usual.output.seen);
        }
        expect("table: steps without a time are of one sample, among others too", alike);
        {
            const double narrow = 1e-3 * fabs((double)to - (double)from);
            double force_before;
            tff_table_init(&own, from);
            (void)tff_table_step(&own, from);
            own.output.change = (tff_real)narrow;
            force_before = (double)own.output.force;
            (void)tff_table_step_dt(&own, (tff_real)1.5 * TFF_STEP_S, to);
            alike = fabs((double)own.output.force - force_before) <= ((1.5 * narrow) + (ROUNDING * (1.0 + fabs(force_before))));
            alike = alike && (fabs((double)own.output.change - narrow) <= (1e-6 * narrow));
            expect("table: a longer step has its share of the rate limit, the next one that of a sample", alike);
        }
    }

    error = 0.0;
    tff_table_init(&self, jump_reference[0]);
    before = (double)self.output.force;
    for (k = 0; k < JUMPS; k++) {
        const double force = (double)tff_table_step(&self, jump_reference[k]);
        error = larger(error, fabs(force - jump_table[k]));
        allowed = allowed && is_allowed(force, before);
        stated = stated && is_stated(self.output.status, force, before, TFF_WOULD_PUSH);
        before = force;
    }
    expect("table: the status is what happened, and nothing else", stated);
    report("table: golden vectors of jumps", error, 8.6000000000000002e-08);
    expect("table: every force within the limits", allowed);
    expect("table: limits that bind are flagged", (self.output.seen & 0u) == 0u);
    expect("table: what did not happen is not flagged", (self.output.seen & (TFF_HELD | TFF_FAILED | TFF_ENDED)) == 0u);
    {
        const tff_real forces[3] = { (tff_real)NAN, -1000000000.0, 1000000000.0 };
        const tff_real force = 100.0;
        same = 1;
        for (k = 0; k < 3; k++) {
            tff_table_init_at(&other, golden_reference[0], forces[k]);
            same = same && is_allowed((double)other.output.force, (double)other.output.force) && (((other.output.status & TFF_INPUT_HELD) != 0u));
        }
        expect("table: a start in motion with a force that means nothing is flagged", same);
        other.branch = 1;
        tff_table_init_at(&other, golden_reference[0], force);
        same = is_near((double)other.output.force, (double)force) && (other.output.status == TFF_OK) && (other.branch == 0);
        same = same && is_near((double)tff_table_step(&other, golden_reference[0]), (double)force) && (other.entry.left > 0.0);
        expect("table: a start in motion goes on from its force", same);
    }
    {
        tff_parameters given;
        tff_parameters_init(&given);
        given.force_max = 150.0;
        taken = (tff_table_use(&other, &given) == 1) && is_near((double)other.output.high, 150.0);
        given.force_max = (tff_real)NAN;
        given.adhesion += 1.0;
        self = other;
        taken = taken && (tff_table_use(&other, &given) == 0) && (memcmp(&self, &other, sizeof self) == 0);
    }
    expect("table: valid parameters are accepted, others refused", taken);
}

static void test_stream(void)
{
    tff_stream self;
    double error = 0.0;
    double before;
    int k, allowed = 1, flagged = 1, clamped = 1;

    tff_stream_init(&self, live_reference[0]);
    before = (double)self.output.force;
    for (k = 0; k < LIVE; k++) {
        const double force = (double)tff_stream_step(&self, live_reference[k]);
        error = larger(error, fabs(force - live_stream[k]));
        allowed = allowed && is_allowed(force, before) && is_near(force, (double)self.output.force);
        flagged = flagged && (((self.output.status & TFF_HELD) != 0u) == !((double)live_reference[k] > 0.0));
        before = force;
    }
    report("stream: golden vectors of a live reference", error, 8.3999999999999998e-08);
    expect("stream: a reference that is not a number is flagged", flagged && ((self.output.seen & TFF_INPUT_HELD) != 0u));
    tff_stream_init(&self, live_reference[0]); /* not on the way back to a reference that was lost */
    before = (double)self.output.force;
    for (k = 0; k < 4; k++) {
        const double force = (double)tff_stream_step(&self, 160.04642732733097);
        allowed = allowed && is_allowed(force, before);
        before = force;
        clamped = clamped && is_near((double)self.entry.last, 55.244025743650283) && ((self.output.status & TFF_HELD) == TFF_RANGE);
    }
    for (k = 0; k < 4; k++) {
        const double force = (double)tff_stream_step(&self, (tff_real)-1);
        allowed = allowed && is_allowed(force, before);
        before = force;
        clamped = clamped && is_near((double)self.entry.last, 5.7798712817485942) && ((self.output.status & TFF_HELD) == TFF_RANGE);
    }
    expect("stream: references out of range are clamped and flagged", clamped);
    expect("stream: every force within the limits", allowed);
    tff_stream_init(&self, (tff_real)NAN);
    expect("stream: a bad start is replaced and flagged", (self.output.status == TFF_INPUT_HELD) && is_allowed((double)self.output.force, (double)self.output.force));
    {
        const tff_real from = golden_reference[0];
        const tff_real to = 47.0;
        tff_stream whole; /* that lost nothing */
        double way;
        int way_back = 1, n;
        tff_stream_init(&whole, from);
        (void)tff_stream_step(&whole, from);
        (void)tff_stream_step(&whole, to);
        way = (double)whole.entry.last - (double)from;
        for (n = 0; n < 3; n++) { /* long lost, missed, lost for one sample */
            const int span = (n == 2) ? 2 : 100;
            tff_stream led;
            int m;
            tff_stream_init(&led, from);
            (void)tff_stream_step(&led, from);
            for (m = 0; m < ((n == 0) ? 100 : (n - 1)); m++) {
                (void)tff_stream_step(&led, (tff_real)NAN);
                way_back = way_back && ((led.output.status & TFF_INPUT_HELD) != 0u);
            }
            if (n == 1) {
                tff_stream_missed(&led, 100);
            }
            for (m = 0; m <= span; m++) {
                double share;
                (void)tff_stream_step(&led, to);
                share = ((double)led.entry.last - (double)from) / way;
                way_back = way_back && is_between(share, 0.0, 1.0) && ((m > 0) || (fabs(share) <= (10.0 * ROUNDING))) && ((m < span) || (fabs(share - 1.0) <= (10.0 * ROUNDING)));
            }
        }
        expect("stream: what was lost or missed is led back", way_back);
    }

    {
        const tff_real from = golden_reference[0];
        const tff_real to = 47.0;
        const tff_real part = (tff_real)0.5 * TFF_STEP_MIN_S;
        tff_stream usual;
        tff_stream own;
        int alike = 1, m;
        tff_real force;
        tff_stream_init(&usual, from);
        tff_stream_init(&own, from);
        for (m = 0; m < 40; m++) {
            const tff_real target = from + ((to - from) * ((tff_real)m / (tff_real)400));
            force = tff_stream_step(&usual, target);
            if ((m % 3) == 1) {
                (void)tff_stream_step_dt(&own, part, target);
            }
            alike = alike && is_near((double)tff_stream_step_dt(&own, ((m % 3) == 1) ? (TFF_STEP_S - part) : TFF_STEP_S, target), (double)force);
        }
        expect("stream: parts of a sample are one", alike);
        alike = is_near((double)tff_stream_step_dt(&own, (tff_real)NAN, to), (double)force) && (own.output.status == TFF_INPUT_HELD);
        alike = alike && is_near((double)tff_stream_step_dt(&own, -TFF_STEP_S, to), (double)force) && (own.output.status == TFF_INPUT_HELD);
        expect("stream: no time, no change", alike);
        force = own.entry.last;
        (void)tff_stream_step_dt(&own, (tff_real)0.5, to);
        expect("stream: the way back after a pause", is_near((double)own.entry.last, (double)force));
        tff_stream_init(&usual, from);
        tff_stream_init(&own, from);
        alike = 1;
        for (m = 0; m < 60; m++) { /* now and then the time is left out, while parts of a sample wait */
            const tff_real target = from + ((to - from) * ((tff_real)m / (tff_real)400));
            const int whole = ((m % 7) < 3) ? 1 : 0;
            const tff_real time = (whole != 0) ? TFF_STEP_S : ((m % 7) == 6) ? part : (((tff_real)0.25 * (tff_real)(m % 7)) * TFF_STEP_S);
            force = tff_stream_step_dt(&usual, time, target);
            alike = alike && is_near((whole != 0) ? (double)tff_stream_step(&own, target) : (double)tff_stream_step_dt(&own, time, target), (double)force)
                && (own.output.status == usual.output.status) && (own.output.seen == usual.output.seen);
        }
        expect("stream: steps without a time are of one sample, among others too", alike);
        tff_stream_init(&usual, from);
        tff_stream_init(&own, from);
        alike = 1;
        for (m = 1; m <= 40; m++) { /* two and a half samples a call: those on the straight line between two references */
            const tff_real slope = (to - from) * (tff_real)0.0025;
            const int last = (5 * m) / 2;
            int at = (5 * (m - 1)) / 2;
            while (at < last) {
                at++;
                (void)tff_stream_step(&usual, from + (slope * (tff_real)at));
            }
            (void)tff_stream_step_dt(&own, (tff_real)2.5 * TFF_STEP_S, from + (slope * (tff_real)2.5 * (tff_real)m));
            alike = alike && (fabs((double)own.entry.last - (double)usual.entry.last) <= (1e2 * ROUNDING * (1.0 + fabs((double)usual.entry.last))));
        }
        expect("stream: samples between two calls are on the straight line", alike);
    }

    {
        tff_parameters given;
        int taken;
        tff_parameters_init(&given);
        given.force_max = 150.0;
        given.adhesion += 0.5;
        tff_stream_init(&self, live_reference[0]);
        taken = (tff_stream_use(&self, &given) == 1) && is_near((double)self.inverse.adhesion, (double)given.adhesion);
        (void)tff_stream_step(&self, live_reference[0]);
        taken = taken && is_near((double)self.output.high, (double)given.force_max);
        taken = taken && (tff_parameters_set_references(&given, 0.14023897025398877, 106.69761821822065) == 1);
        taken = taken && (tff_parameters_set_references(&given, 106.69761821822065, 0.14023897025398877) == 0);
        taken = taken && (tff_stream_use(&self, &given) == 1) && is_near((double)self.high, 106.69761821822065) && is_near((double)self.low, 0.14023897025398877);
        given.reference_min = 30.511948512699441;
        given.reference_max = 55.244025743650283;
        self.entry.last = 5.7798712817485942;
        self.entry.lost = 0;
        taken = taken && (tff_stream_use(&self, &given) == 1) && (self.entry.lost == 100); /* led inside */
        tff_parameters_init(&given);
        given.force_max = (tff_real)NAN;
        taken = taken && (tff_stream_use(&self, &given) == 0) && ((double)self.low > 5.7856511530303418);
        expect("stream: valid parameters are accepted, others refused", taken);
        tff_stream_init_at(&self, live_reference[0], 100.0);
        taken = is_near((double)self.output.force, 100.0) && is_near((double)self.entry.last, (double)live_reference[0]);
        expect("stream: a start in motion keeps the force and is led to the reference", taken && (self.entry.lost == 100));
    }
    expect("stream: stated lag", is_near((double)TFF_STREAM_LAG_S, 0.012));
}

static void test_profile(void)
{
    tff_profile profile;
    double error = 0.0;
    double last;
    int k, good = 1;

    tff_profile_init(&profile);
    good = is_near((double)profile.output.force, (double)tff_profile_at(0u)) && (profile.output.seen == TFF_OK);
    for (k = 0; k < TFF_PROFILE_LENGTH; k++) {
        const double stepped = (double)tff_profile_step(&profile);
        error = larger(error, fabs(stepped - (double)tff_profile_at((uint32_t)k)));
        good = good && (profile.output.status == TFF_OK) && is_near((double)profile.output.force, stepped);
    }
    last = (double)tff_profile_at((uint32_t)(TFF_PROFILE_LENGTH - 1));
    report("profile: gives its samples", error, 0.0);
    for (k = 0; k < 3; k++) {
        good = good && is_near((double)tff_profile_step(&profile), last) && (profile.output.status == TFF_ENDED);
    }
    good = good && ((profile.output.seen & TFF_ENDED) != 0u) && is_near((double)tff_profile_at(UINT32_C(4294967295)), last);
    expect("profile: holds its last sample and reports its end", good);
}

/* ---- the chain ---- */

static void test_plant(void)
{
    tff_plant plant;
    tff_real tension;
    double error = 0.0;
    int k, good;

    tff_plant_init(&plant, golden_reference[0]);
    for (k = 0; k < PLANT_ROWS; k++) {
        const double given = (double)tff_plant_step(&plant, golden_plant_force[k]);
        error = larger(error, fabs(given - golden_plant[k]));
    }
    report("plant: golden vectors", error, 8.4999999999999994e-08);
    expect("plant: positions of the ends", (fabs((double)tff_plant_actuator_position(&plant) - (0.0055105114350797908)) <= 2.8333333333333332e-11)
           && (fabs((double)tff_plant_load_position(&plant) - (0.0047204494570784461)) <= 2.8333333333333332e-11));
    tension = plant.tension;
    good = is_near((double)tff_plant_step(&plant, (tff_real)NAN), (double)tension) && (plant.status == TFF_INPUT_HELD);
    good = good && is_near((double)tff_plant_step(&plant, (tff_real)INFINITY), (double)tension) && (plant.status == TFF_INPUT_HELD);
    expect("plant: bad forces hold the last tension and say so", good && ((plant.seen & TFF_INPUT_HELD) != 0u));
    plant.chain.x[0] = (tff_real)NAN; /* no step can be solved from here */
    good = is_near((double)tff_plant_step(&plant, golden_plant_force[0]), (double)tension) && (plant.status == TFF_FAILED) && (plant.evaluations == 22);
    expect("plant: a step without a solution holds the last tension and says so", good);
    tff_plant_init(&plant, (tff_real)NAN);
    expect("plant: a bad start is replaced and flagged", (plant.status == TFF_INPUT_HELD) && is_near((double)plant.tension, 0.14023897025398877));
    tff_plant_init(&plant, golden_reference[0]);
    for (k = 0; k < 200; k++) {
        (void)tff_plant_step(&plant, -golden_reference[0]);
    }
    expect("plant: a slack tendon is flagged, or that it was not reached", (plant.seen & (TFF_WOULD_PUSH | TFF_FAILED)) != 0u);
}

static int encloses(const tff_observed *output, double tension)
{
    return (output->low <= output->high) && is_between(tension, (double)output->low, (double)output->high);
}

static void test_observer(void)
{
    const tff_real bad[4] = { (tff_real)NAN, (tff_real)INFINITY, -(tff_real)INFINITY, 462.63151835881439 };
    tff_observer self;
    tff_observer other;
    tff_observer whole;
    double error = 0.0;
    double of_bounds = 0.0;
    double before;
    int k, held = 1, same = 1, wide = 1, mixed = 1;

    tff_observer_init(&self, seen_input[0]);
    tff_observer_init(&other, seen_input[0]);
    for (k = 0; k < SEEN; k++) {
        error = larger(error, fabs((double)tff_observer_step(&self, seen_input[k], (tff_real)NAN) - seen_output[k]));
        of_bounds = larger(of_bounds, fabs((double)self.output.low - seen_low[k]));
        of_bounds = larger(of_bounds, fabs((double)self.output.high - seen_high[k]));
        if (k < 40) { /* the same in parts of a sample */
            if ((k % 3) == 1) {
                (void)tff_observer_step_dt(&other, (tff_real)0.5 * TFF_STEP_MIN_S, seen_input[k], (tff_real)NAN);
            }
            same = same && is_near((double)tff_observer_step_dt(&other, ((k % 3) == 1) ? (TFF_STEP_S - ((tff_real)0.5 * TFF_STEP_MIN_S)) : TFF_STEP_S, seen_input[k], (tff_real)NAN), (double)self.output.tension);
        }
    }
    whole = self;
    tff_observer_init(&self, seen_input[0]);
    tff_observer_init(&other, seen_input[0]);
    for (k = 0; (k < 40) && (k < SEEN); k++) { /* now and then the time is left out, while parts of a sample wait */
        const tff_real time = ((k % 3) == 1) ? ((tff_real)0.25 * TFF_STEP_S) : TFF_STEP_S;
        before = (double)tff_observer_step_dt(&other, time, seen_input[k], (tff_real)NAN);
        mixed = mixed && is_near(((k % 3) == 2) ? (double)tff_observer_step(&self, seen_input[k], (tff_real)NAN) : (double)tff_observer_step_dt(&self, time, seen_input[k], (tff_real)NAN), before)
            && (self.output.status == other.output.status);
    }
    tff_observer_init(&self, seen_input[0]);
    tff_observer_init(&other, seen_input[0]);
    for (k = 1; (k <= 20) && mixed; k++) { /* two samples a call: the one between is on the straight line */
        const tff_real slope = (tff_real)5e-4 * seen_input[0];
        (void)tff_observer_step(&self, seen_input[0] + (slope * ((tff_real)(2 * k) - 1.0)), (tff_real)NAN);
        before = (double)tff_observer_step(&self, seen_input[0] + (slope * (tff_real)(2 * k)), (tff_real)NAN);
        mixed = fabs((double)tff_observer_step_dt(&other, (tff_real)2 * TFF_STEP_S, seen_input[0] + (slope * (tff_real)(2 * k)), (tff_real)NAN) - before) <= (1e3 * ROUNDING * (1.0 + before));
    }
    tff_observer_init(&other, seen_input[0]); /* nothing waits */
    (void)tff_observer_step_dt(&other, (tff_real)2.25 * TFF_STEP_S, seen_input[0], (tff_real)NAN);
    mixed = mixed && (fabs((double)other.entry.waiting - (0.25 * (double)TFF_STEP_S)) <= (1e-4 * (double)TFF_STEP_S));
    self = whole;
    expect("observer: steps without a time are of one sample, among others too", mixed);
    report("observer: golden vectors", error, 8.6000000000000002e-08);
    report("observer: golden bounds", of_bounds, 2.5800000000000001e-07);
    expect("observer: parts of a sample are one", same);
    expect("observer: nothing to say of a good course", (self.output.seen & ~TFF_WOULD_PUSH) == TFF_OK);
    /* not a number, or out of range: the last good output, and nothing is known */
    before = (double)self.output.tension;
    for (k = 0; k < 4; k++) {
        held = held && is_near((double)tff_observer_step(&self, bad[k], (tff_real)NAN), before) && (self.output.status == TFF_INPUT_HELD);
        wide = wide && ((double)self.output.low <= 0.0) && ((double)self.output.high >= 444.48910587415497);
    }
    held = held && is_near((double)tff_observer_step_dt(&self, (tff_real)NAN, seen_input[0], (tff_real)NAN), before) && (self.output.status == TFF_INPUT_HELD);
    held = held && is_near((double)tff_observer_step_dt(&self, -TFF_STEP_S, seen_input[0], (tff_real)NAN), before) && (self.output.status == TFF_INPUT_HELD);
    expect("observer: bad inputs hold the last good output and say so", held && ((self.output.seen & TFF_INPUT_HELD) != 0u));
    expect("observer: while inputs are lost nothing is known", wide);
    (void)tff_observer_step(&self, seen_input[SEEN - 1], (tff_real)NAN);
    for (k = 0; (k < 10) && (self.output.status == TFF_FAILED); k++) { /* a step without a solution: nothing is known then either */
        (void)tff_observer_step(&self, seen_input[SEEN - 1], (tff_real)NAN);
    }
    expect("observer: after lost inputs any history is admitted", is_near((double)self.low_memory, (double)(0.47048921771981794 * (seen_input[SEEN - 1] + 0.0)))
           && is_near((double)self.high_memory, (double)(2.1254472203346269 * (seen_input[SEEN - 1] + 0.0))) && encloses(&self.output, (double)self.output.tension));
    held = 1;
    for (k = 0; k < 4; k++) {
        tff_observer_init(&self, bad[k]);
        held = held && is_near((double)self.output.tension, 0.14023897025398877) && (self.output.status == TFF_INPUT_HELD) && (self.output.seen == TFF_INPUT_HELD);
        tff_observer_init_at(&self, seen_input[0], bad[k]);
        held = held && (self.output.status == TFF_INPUT_HELD) && ((double)self.output.low <= 0.0);
    }
    expect("observer: a bad start is replaced and flagged", held);
    tff_observer_init_at(&self, (tff_real)NAN, seen_input[0]);
    same = is_near((double)self.low_memory, (double)(0.47048921771981794 * (seen_input[0] + 0.0))) && (self.output.status == TFF_OK);
    tff_observer_init_at(&self, seen_input[0], seen_input[0]);
    tff_observer_init(&other, seen_input[0]);
    same = same && is_near((double)self.output.low, (double)other.output.low) && is_near((double)self.output.high, (double)other.output.high) && is_near((double)self.output.tension, (double)other.output.tension);
    expect("observer: a start in motion takes what is known", same);
    tff_observer_init_at(&self, 30.0, 43.116841313780071);
    before = 0.0;
    for (k = 0; k < TFF_OBSERVER_COUNT; k++) {
        before += (double)self.chain.x[22 + k];
    }
    expect("observer: a start in motion takes the difference for friction", (fabs(before - (13.116841313780071)) <= (1e2 * ROUNDING * 44.116841313780071)) && encloses(&self.output, 30.0));
    {
        const tff_real from = seen_input[0];
        const tff_real to = 15.0;
        int way_back = 1;
        tff_observer_init(&self, from);
        (void)tff_observer_step(&self, from, (tff_real)NAN);
        tff_observer_missed(&self, 100);
        for (k = 0; k <= 100; k++) {
            double share;
            (void)tff_observer_step(&self, to, (tff_real)NAN);
            share = ((double)self.entry.last - (double)from) / ((double)to - (double)from);
            way_back = way_back && is_between(share, 0.0, 1.0) && ((k > 0) || (fabs(share) <= (10.0 * ROUNDING))) && ((k < 100) || (fabs(share - 1.0) <= (10.0 * ROUNDING)));
        }
        (void)tff_observer_step_dt(&self, (tff_real)0.5, from, (tff_real)NAN);
        way_back = way_back && is_near((double)self.entry.last, (double)to);
        way_back = way_back || ((self.output.seen & TFF_FAILED) != 0u); /* a step without a solution begins it anew */
        expect("observer: what was lost or missed is led back", way_back);
    }
    tff_observer_init(&self, seen_input[0]);
    error = 0.0;
    wide = 1;
    for (k = 0; k < SEEN_FAR; k++) {
        error = larger(error, fabs((double)tff_observer_step(&self, seen_input[k], seen_position[k]) - seen_far_output[k]));
        if ((self.output.status & TFF_OBSERVER_FAR_MOVED) != 0u) {
            wide = wide && is_near((double)self.low_memory, (double)(0.47048921771981794 * (seen_input[k] + 0.0)));
        }
    }
    report("observer: golden vectors of a far end that is moved", error, 8.6000000000000002e-07);
    expect("observer: a far end that is moved is flagged, and any history admitted", wide && ((self.output.seen & TFF_OBSERVER_FAR_MOVED) != 0u));
    before = (double)self.output.tension;
    self.chain.x[0] = (tff_real)NAN; /* no step can be solved from here */
    held = is_near((double)tff_observer_step(&self, seen_input[0], (tff_real)NAN), before) && (self.output.status == TFF_FAILED) && (self.evaluations == 22);
    expect("observer: a step without a solution holds the last tension and says so", held && ((double)self.output.low <= 0.0));
    held = 0; /* a start that is far from the tension before may fail once more */
    for (k = 0; k < 8; k++) {
        (void)tff_observer_step(&self, seen_input[0], (tff_real)NAN);
        held = ((self.output.status & TFF_FAILED) == 0u) && encloses(&self.output, (double)self.output.tension);
    }
    expect("observer: it starts over after a step without a solution", held && ((double)self.output.low > 0.0));
}

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

int main(void)
{
    data();
    limits();
    parameters();
    test_capstan();
    test_inverse();
    test_table();
    test_stream();
    test_profile();
    test_plant();
    test_observer();
    drive();
    expect("calls at random", drive_failures == 0);
    printf("%s\n", (failures == 0) ? "self test passed" : "SELF TEST FAILED");
    return (failures == 0) ? 0 : 1;
}

#endif
