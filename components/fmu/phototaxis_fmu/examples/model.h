/* What a model is to fmi2.c and fmi3.c: all its variables in one array, and two functions.
 * The model itself includes names.h, which is generated too and names each variable. */
#ifndef MODEL_H
#define MODEL_H

#include "variables.h" /* generated: TOKEN, VARIABLES, STARTS, SIZES */

typedef struct {
    double v[VARIABLES];
    double state;
} Model;

enum { GOOD = 0, DISCARD = 2, BROKEN = 3 }; /* as fmi2Status and fmi3Status */

int model_begin(Model *m); /* from the parameters and the first inputs */

int model_step(Model *m, double period); /* from the inputs to the outputs, `period` seconds on */

#endif
