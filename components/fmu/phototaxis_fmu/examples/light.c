/* The built-in light law: inverse square of the distance, constant within 1 m; or linear up to `range`. */
#include "names.h"

int model_begin(Model *m) { return model_step(m, 0); }

int model_step(Model *m, double period) {
    double falloff;
    (void)period;
    if (range > 0)
        falloff = distance < range ? 1 - distance / range : 0;
    else
        falloff = distance <= 1 ? 1 : 1 / (distance * distance);
    reading = visibility > 0 ? brightness * falloff : 0;
    return GOOD;
}
