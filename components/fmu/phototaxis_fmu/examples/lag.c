/* A first-order lag: the output follows the input with the time constant `tau`. */
#include <math.h>

#include "names.h"

int model_begin(Model *m) {
    y = m->state = u;
    return GOOD;
}

int model_step(Model *m, double period) {
    double follow = tau > 0 ? 1 - exp(-period / tau) : 1;
    y = m->state += follow * (u - m->state);
    return GOOD;
}
