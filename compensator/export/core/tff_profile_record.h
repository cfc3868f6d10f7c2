#include "tff_profile.h"

typedef struct {
    uint32_t rows;
    int32_t motors;
    int32_t loops; /* 1: after the last row comes the first */
    const tff_real *command_rad; /* by row, then by motor */
} tff_profile_record;
