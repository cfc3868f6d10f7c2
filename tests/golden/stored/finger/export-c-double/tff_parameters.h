/* tff_parameters.h: what can be changed while the controller runs.
 *
 * Scenario "robot finger: polymer tendon on six 30 degree arcs", hash 6b567c7d1473e421, level presliding.
 * Written by tendonff VERSION export-c --precision double --prefix tff.
 * The licence of tendonff does not cover what it writes: this file is yours.
 * Fill a record with the scenario's values, change it by the setters or by a calibration tool (tff_parameters.a2l), and
 * hand it to a module: `tff_inverse_use(&inverse, &parameters)`. A record that is not good changes nothing.
 */
#ifndef TFF_PARAMETERS_H
#define TFF_PARAMETERS_H

#include "tff_types.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
    tff_real mu_pull; /* mu_dynamic, tendon moving towards the actuator [-], 0 to 2 */
    tff_real mu_release; /* mu_dynamic, tendon moving towards the load [-], 0 to 2 */
    tff_real adhesion; /* tension-independent part of the normal force [N], 0 to 1000 */
    tff_real force_min; /* least force of the actuator [N], 0 to 200 */
    tff_real force_max; /* largest force of the actuator [N], 0 to 200 */
    tff_real force_rate_max; /* largest change of the force per second [N/s], 0 to 100000 */
    tff_real reference_min; /* least reference that is followed live [N], 0.140239 to 106.698 */
    tff_real reference_max; /* largest reference that is followed live [N], 0.140239 to 106.698 */
} tff_parameters;

/* The scenario's own values. */
void tff_parameters_init(tff_parameters *self);

/* 1 where every member is in its range and no least value is above its largest, 0 elsewhere. */
int32_t tff_parameters_are_good(const tff_parameters *self);

/* Setters: 1 where the values were taken, 0 where they mean nothing and the record stays as it was. */
int32_t tff_parameters_set_mu(tff_parameters *self, tff_real mu_pull, tff_real mu_release);
int32_t tff_parameters_set_adhesion(tff_parameters *self, tff_real adhesion);
int32_t tff_parameters_set_limits(tff_parameters *self, tff_real force_min, tff_real force_max, tff_real force_rate_max);
int32_t tff_parameters_set_references(tff_parameters *self, tff_real reference_min, tff_real reference_max);

#ifdef __cplusplus
}
#endif

#endif
