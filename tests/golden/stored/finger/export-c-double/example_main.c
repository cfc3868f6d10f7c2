/* example_main.c: the control loop, 1000 samples a second, with the chain in place of the rig.
 *
 * Scenario "robot finger: polymer tendon on six 30 degree arcs", hash 6b567c7d1473e421, level presliding.
 * Written by tendonff VERSION export-c --precision double --prefix tff.
 * The licence of tendonff does not cover what it writes: this file is yours.
 * On the controller the body of the loop goes into the timer interrupt, and the two lines marked RIG give way to the
 * amplifier and to nothing: the compensators are feedforward and need no measurement.
 */
#ifndef ARDUINO /* whose tools compile every file of a library */
#include <math.h>
#include <stdio.h>

#include "tff_inverse.h"
#include "tff_plant.h"

int main(void)
{
    /* all state is the caller's: here on the stack, on a controller usually static */
    tff_inverse controller;
    tff_plant plant;
    const tff_real rest = 30.0;
    const tff_real amplitude = 7.5;
    int k;

    tff_inverse_init(&controller, rest);
    tff_plant_init(&plant, rest);
    printf("time_s,reference_N,force_N,tension_N,status\n");
    for (k = 0; k <= 2000; k++) {
        const double t = (double)k * 0.001;
        /* up and down once a second, starting gently */
        const double wave = sin(6.283185307179586 * t) * ((t < 0.5) ? (2.0 * t) : 1.0);
        const tff_real reference = rest + (amplitude * (tff_real)wave);
        const tff_real force = tff_inverse_step(&controller, reference); /* this is all that runs in the loop */
        const tff_real tension = tff_plant_step(&plant, force);       /* RIG */
        if ((k % 20) == 0) {
            printf("%.3f,%.4f,%.4f,%.4f,%lu\n", t, (double)reference, (double)force, (double)tension, /* RIG */
                   (unsigned long)controller.output.status);
        }
    }
    return 0;
}

#endif
