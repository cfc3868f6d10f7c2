/* tff_table_data.h: feedforward force over reference tension, branch and tension since the last reversal.
 *
 * Scenario "robot finger: polymer tendon on six 30 degree arcs", hash 6b567c7d1473e421, level presliding.
 * Written by tendonff VERSION export-c --precision double --prefix tff.
 * The licence of tendonff does not cover what it writes: this file is yours.
 * Interpolation error at most 0.164 N (bound 0.165 N); made for a reference that
 * moves at 29.7 N/s. Bilinear in the reference and in the share.
 */
#ifndef TFF_TABLE_DATA_6B567C7D1473E421_H
#define TFF_TABLE_DATA_6B567C7D1473E421_H

#include <stdint.h>

#define TFF_TABLE_ADHESION_N 0.0
#define TFF_TABLE_REFERENCES 5
#define TFF_TABLE_PULL_SHARES 20
#define TFF_TABLE_RELEASE_SHARES 17

/* References [N]: the first node, the last, and cells per newton; nodes are equally far apart. */
#define TFF_TABLE_FIRST_N 12.375091876668819
#define TFF_TABLE_LAST_N 48.648805148730055
#define TFF_TABLE_CELLS_PER_N 0.11027269168720266

/* pull: nodes of (tension since the reversal)/(reference + p) [-], and (force + p)/(reference + p)
 * [-], one row per reference node. */
static const double tff_table_pull_share[TFF_TABLE_PULL_SHARES] = { NUMBERS };
static const double tff_table_pull_ratio[TFF_TABLE_REFERENCES * TFF_TABLE_PULL_SHARES] = { NUMBERS };
/* pull: last cell of the share that begins in each of 128 equal bins, and in the one of the last share. */
#define TFF_TABLE_PULL_BINS_PER_SHARE 378.89240573333342
static const uint8_t tff_table_pull_cell[129] = {
    1u, 2u, 3u, 3u, 4u, 4u, 5u, 5u, 5u, 6u, 6u, 6u, 7u, 7u, 7u, 8u, 8u, 8u, 8u, 9u, 9u, 9u, 9u, 9u, 10u, 10u, 10u,
    10u, 10u, 11u, 11u, 11u, 11u, 11u, 12u, 12u, 12u, 12u, 12u, 12u, 12u, 13u, 13u, 13u, 13u, 13u, 13u, 13u, 13u,
    14u, 14u, 14u, 14u, 14u, 14u, 14u, 14u, 14u, 15u, 15u, 15u, 15u, 15u, 15u, 15u, 15u, 15u, 15u, 15u, 15u, 16u,
    16u, 16u, 16u, 16u, 16u, 16u, 16u, 16u, 16u, 16u, 16u, 16u, 16u, 16u, 16u, 16u, 17u, 17u, 17u, 17u, 17u, 17u,
    17u, 17u, 17u, 17u, 17u, 17u, 17u, 17u, 17u, 17u, 17u, 17u, 17u, 17u, 17u, 17u, 17u, 17u, 17u, 17u, 17u, 17u,
    17u, 17u, 17u, 17u, 18u, 18u, 18u, 18u, 18u, 18u, 18u, 18u, 18u, 18u
};

/* release: nodes of (tension since the reversal)/(reference + p) [-], and (force + p)/(reference + p)
 * [-], one row per reference node. */
static const double tff_table_release_share[TFF_TABLE_RELEASE_SHARES] = { NUMBERS };
static const double tff_table_release_ratio[TFF_TABLE_REFERENCES * TFF_TABLE_RELEASE_SHARES] = { NUMBERS };
/* release: last cell of the share that begins in each of 64 equal bins, and in the one of the last share. */
#define TFF_TABLE_RELEASE_BINS_PER_SHARE 374.09340392227898
static const uint8_t tff_table_release_cell[65] = {
    1u, 2u, 3u, 3u, 4u, 4u, 4u, 5u, 5u, 6u, 6u, 7u, 7u, 8u, 8u, 8u, 9u, 9u, 9u, 10u, 10u, 10u, 11u, 11u, 11u, 11u,
    12u, 12u, 12u, 12u, 12u, 13u, 13u, 13u, 13u, 13u, 13u, 14u, 14u, 14u, 14u, 14u, 14u, 14u, 14u, 14u, 14u, 14u,
    15u, 15u, 15u, 15u, 15u, 15u, 15u, 15u, 15u, 15u, 15u, 15u, 15u, 15u, 15u, 15u, 15u
};

#endif
