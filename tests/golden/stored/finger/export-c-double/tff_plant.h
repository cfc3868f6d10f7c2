/* tff_plant.h: the tendon chain itself, for hardware-in-the-loop.
 *
 * Scenario "robot finger: polymer tendon on six 30 degree arcs", hash 6b567c7d1473e421, level presliding.
 * Written by tendonff VERSION export-c --precision double --prefix tff.
 * The licence of tendonff does not cover what it writes: this file is yours.
 * presliding chain with 6 masses, 7 links and the end masses.
 */
#ifndef TFF_PLANT_H
#define TFF_PLANT_H

#include "tff_chain.h"

#ifdef __cplusplus
extern "C" {
#endif

#define TFF_PLANT_COUNT TFF_CHAIN_COUNT
#define TFF_PLANT_REALS TFF_CHAIN_REALS

/* State; owned by the caller. */
typedef struct {
    tff_state chain;
    tff_real tension; /* output tension [N], last good one */
    int32_t evaluations;   /* of the balances, in the last step */
    uint32_t status;       /* bits of the last step */
    uint32_t seen;         /* bits since init */
} tff_plant;

/* At rest under a uniform tension [N]. */
void tff_plant_init(tff_plant *self, tff_real initial_tension);

/* Output tension [N] at the end of a sample in which the actuator's force [N] went straight from its last value to this
 * one. The first call may repeat the initial tension as force (the sample at t = 0). */
tff_real tff_plant_step(tff_plant *self, tff_real force);

/* Position of the actuator's end and of the load, positive towards the actuator [m]. */
tff_real tff_plant_actuator_position(const tff_plant *self);
tff_real tff_plant_load_position(const tff_plant *self);

#ifdef __cplusplus
}
#endif

#endif
