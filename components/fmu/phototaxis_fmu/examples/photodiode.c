/* A photodiode that is most sensitive straight ahead, and saturates. `half` irradiance gives half the full current. */
#include <math.h>

#include "names.h"

int model_begin(Model *m) { return model_step(m, 0); }

int model_step(Model *m, double period) {
    double ahead = cos(bearing) > 0 ? cos(bearing) : 0;
    double near = distance < 0.1 ? 0.1 : distance;
    double irradiance = visibility * brightness / (near * near) * (1 - directivity + directivity * ahead);
    (void)period;
    reading = (1 + half) * irradiance / (irradiance + half);
    if (reading > 1) reading = 1;
    return GOOD;
}
