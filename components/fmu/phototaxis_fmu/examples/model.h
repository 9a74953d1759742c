/* The interface between a model and its wrappers fmi2.c and fmi3.c: one array of all variables, and two functions.
 * The model itself includes names.h, which is generated too and names each variable. */
#ifndef MODEL_H
#define MODEL_H

#include "variables.h" /* generated: TOKEN, VARIABLES, STARTS, SIZES */

typedef struct {
    double v[VARIABLES];
    double state;
} Model;

enum { GOOD = 0, DISCARD = 2, BROKEN = 3 }; /* same values as in fmi2Status and fmi3Status */

int model_begin(Model *m); /* computes the outputs at time 0 from the parameters and the first inputs */

int model_step(Model *m, double period); /* computes the outputs `period` seconds later from the inputs */

#endif
