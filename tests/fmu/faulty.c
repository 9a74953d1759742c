/* A model that follows its input until its step `at`, and then does what an FMU should not. */
#include <math.h>
#include <stdlib.h>

#include "names.h"

static double steps_ever; /* survives a reset, which is one of the faults */

int model_begin(Model *m) {
    m->state = 0;
    y = u;
    return GOOD;
}

int model_step(Model *m, double period) {
    (void)period;
    y = u;
    steps_ever += 1;
    if (++m->state < at) return GOOD;
    switch ((int)fault) {
        case 1: return BROKEN;
        case 2: return DISCARD;
        case 3: y = NAN; break;
        case 4: y = 7; break;
        case 5: *(volatile int *)0 = 1; break;
        case 6: for (;;) period += 1e-9;
        case 7: y = u + 1e-3 * steps_ever / (1 + steps_ever); break;
        case 8: exit(3);
    }
    return GOOD;
}
