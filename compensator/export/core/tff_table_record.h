#include "tff_table.h"

typedef struct {
    int32_t nodes;        /* on a branch, at equal distances */
    int32_t motors;
    tff_real low_rad;     /* angles of the joint: the first node, */
    tff_real high_rad;    /* the last one, */
    tff_real nodes_per_rad;
    tff_real turning_rad; /* and the way back that counts as a reversal */
    tff_real change_rad;  /* largest change of a command in a sample */
    const tff_real *branch_rad[3]; /* down, at rest, up: by node, then by motor */
} tff_table_record;
