/* Sixteen cheap ultrasonic rangers: no reading is below `blind`, and readings are multiples of `resolution`. */
#include <math.h>

#include "names.h"

int model_begin(Model *m) { return model_step(m, 0); }

int model_step(Model *m, double period) {
    int i;
    (void)period;
    for (i = 0; i < 16; i++) {
        reading[i] = resolution * floor(range[i] / resolution + 0.5);
        if (reading[i] < blind) reading[i] = blind;
    }
    return GOOD;
}
