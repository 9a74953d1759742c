/* Wraps a model (see model.h) as an FMI 2.0 co-simulation. */
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"
#include "model.h"

static const double starts[VARIABLES] = STARTS;

static void begin(Model *m) {
    memset(m, 0, sizeof *m);
    memcpy(m->v, starts, sizeof starts);
}

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String token, fmi2String resources,
                              const fmi2CallbackFunctions *call, fmi2Boolean visible, fmi2Boolean logging) {
    Model *m;
    (void)resources, (void)visible, (void)logging;
    if (type != fmi2CoSimulation || strcmp(token, TOKEN)) {
        call->logger(call->componentEnvironment, name, fmi2Error, "logStatusError",
                     type == fmi2CoSimulation ? "the GUID is not that of this library" : "only co-simulation");
        return NULL;
    }
    m = malloc(sizeof *m);
    if (m) begin(m);
    return m;
}

void fmi2FreeInstance(fmi2Component c) { free(c); }

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean toleranceDefined, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean stopDefined, fmi2Real stop) {
    (void)c, (void)toleranceDefined, (void)tolerance, (void)start, (void)stopDefined, (void)stop;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return (void)c, fmi2OK; }
fmi2Status fmi2ExitInitializationMode(fmi2Component c) { return model_begin(c); }
fmi2Status fmi2Terminate(fmi2Component c) { return (void)c, fmi2OK; }
fmi2Status fmi2Reset(fmi2Component c) { return begin(c), fmi2OK; }

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, fmi2Real values[]) {
    size_t i;
    for (i = 0; i < n; i++) {
        if (r[i] >= VARIABLES) return fmi2Error;
        values[i] = ((Model *)c)->v[r[i]];
    }
    return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference r[], size_t n, const fmi2Real values[]) {
    size_t i;
    for (i = 0; i < n; i++) {
        if (r[i] >= VARIABLES) return fmi2Error;
        ((Model *)c)->v[r[i]] = values[i];
    }
    return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real now, fmi2Real period, fmi2Boolean final) {
    (void)now, (void)final;
    return model_step(c, period);
}

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) {
    if (!*state) *state = malloc(sizeof(Model));
    if (!*state) return fmi2Error;
    memcpy(*state, c, sizeof(Model));
    return fmi2OK;
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
    memcpy(c, state, sizeof(Model));
    return fmi2OK;
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state) {
    (void)c;
    free(*state);
    *state = NULL;
    return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size) {
    (void)c, (void)state;
    *size = sizeof(Model);
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size) {
    (void)c;
    if (size < sizeof(Model)) return fmi2Error;
    memcpy(bytes, state, sizeof(Model));
    return fmi2OK;
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state) {
    if (size != sizeof(Model) || fmi2GetFMUstate(c, state)) return fmi2Error;
    memcpy(*state, bytes, size);
    return fmi2OK;
}

/* There are no variables of other types, and no derivatives. */
#define NOT_HERE(name, ...) \
    fmi2Status name(fmi2Component c, __VA_ARGS__) { return (void)c, fmi2Error; }
#define REFERENCES const fmi2ValueReference r[], size_t n
fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[]) {
    return (void)c, (void)on, (void)n, (void)categories, fmi2OK;
}
fmi2Status fmi2CancelStep(fmi2Component c) { return (void)c, fmi2Error; }
NOT_HERE(fmi2GetInteger, REFERENCES, fmi2Integer v[])
NOT_HERE(fmi2GetBoolean, REFERENCES, fmi2Boolean v[])
NOT_HERE(fmi2GetString, REFERENCES, fmi2String v[])
NOT_HERE(fmi2SetInteger, REFERENCES, const fmi2Integer v[])
NOT_HERE(fmi2SetBoolean, REFERENCES, const fmi2Boolean v[])
NOT_HERE(fmi2SetString, REFERENCES, const fmi2String v[])
NOT_HERE(fmi2GetDirectionalDerivative, REFERENCES, const fmi2ValueReference k[], size_t nk, const fmi2Real dk[],
         fmi2Real dv[])
NOT_HERE(fmi2SetRealInputDerivatives, REFERENCES, const fmi2Integer order[], const fmi2Real v[])
NOT_HERE(fmi2GetRealOutputDerivatives, REFERENCES, const fmi2Integer order[], fmi2Real v[])
NOT_HERE(fmi2GetStatus, const fmi2StatusKind kind, fmi2Status *v)
NOT_HERE(fmi2GetRealStatus, const fmi2StatusKind kind, fmi2Real *v)
NOT_HERE(fmi2GetIntegerStatus, const fmi2StatusKind kind, fmi2Integer *v)
NOT_HERE(fmi2GetBooleanStatus, const fmi2StatusKind kind, fmi2Boolean *v)
NOT_HERE(fmi2GetStringStatus, const fmi2StatusKind kind, fmi2String *v)
