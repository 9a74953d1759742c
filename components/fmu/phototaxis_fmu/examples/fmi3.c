/* Wraps a model (see model.h) as an FMI 3.0 co-simulation. */
#include <stdlib.h>
#include <string.h>

#include "fmi3Functions.h"
#include "model.h"

static const double starts[VARIABLES] = STARTS;
static const size_t sizes[VARIABLES] = SIZES; /* number of values of a value reference; 0: not a reference */

static void begin(Model *m) {
    memset(m, 0, sizeof *m);
    memcpy(m->v, starts, sizeof starts);
}

const char *fmi3GetVersion(void) { return fmi3Version; }

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                         fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early,
                                         const fmi3ValueReference required[], size_t n,
                                         fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                         fmi3IntermediateUpdateCallback update) {
    Model *m;
    (void)name, (void)resources, (void)visible, (void)logging, (void)events, (void)early;
    (void)required, (void)n, (void)update;
    if (strcmp(token, TOKEN)) {
        log(environment, fmi3Error, "logStatusError", "the instantiation token is not that of this library");
        return NULL;
    }
    m = malloc(sizeof *m);
    if (m) begin(m);
    return m;
}

void fmi3FreeInstance(fmi3Instance i) { free(i); }

fmi3Status fmi3EnterInitializationMode(fmi3Instance i, fmi3Boolean toleranceDefined, fmi3Float64 tolerance,
                                       fmi3Float64 start, fmi3Boolean stopDefined, fmi3Float64 stop) {
    (void)toleranceDefined, (void)tolerance, (void)stopDefined, (void)stop;
    ((Model *)i)->v[0] = start;
    return fmi3OK;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance i) { return model_begin(i); }
fmi3Status fmi3Terminate(fmi3Instance i) { return (void)i, fmi3OK; }
fmi3Status fmi3Reset(fmi3Instance i) { return begin(i), fmi3OK; }

fmi3Status fmi3GetFloat64(fmi3Instance i, const fmi3ValueReference r[], size_t n, fmi3Float64 values[], size_t count) {
    size_t k;
    for (k = 0; k < n; k++) {
        if (r[k] >= VARIABLES || !sizes[r[k]] || sizes[r[k]] > count) return fmi3Error;
        memcpy(values, ((Model *)i)->v + r[k], sizes[r[k]] * sizeof *values);
        values += sizes[r[k]], count -= sizes[r[k]];
    }
    return fmi3OK;
}

fmi3Status fmi3SetFloat64(fmi3Instance i, const fmi3ValueReference r[], size_t n, const fmi3Float64 values[],
                          size_t count) {
    size_t k;
    for (k = 0; k < n; k++) {
        if (r[k] >= VARIABLES || !sizes[r[k]] || sizes[r[k]] > count) return fmi3Error;
        memcpy(((Model *)i)->v + r[k], values, sizes[r[k]] * sizeof *values);
        values += sizes[r[k]], count -= sizes[r[k]];
    }
    return fmi3OK;
}

fmi3Status fmi3DoStep(fmi3Instance i, fmi3Float64 now, fmi3Float64 period, fmi3Boolean final, fmi3Boolean *event,
                      fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *last) {
    Model *m = i;
    (void)final;
    *event = *terminate = *early = fmi3False;
    *last = m->v[0] = now + period;
    return model_step(m, period);
}

fmi3Status fmi3GetFMUState(fmi3Instance i, fmi3FMUState *state) {
    if (!*state) *state = malloc(sizeof(Model));
    if (!*state) return fmi3Error;
    memcpy(*state, i, sizeof(Model));
    return fmi3OK;
}

fmi3Status fmi3SetFMUState(fmi3Instance i, fmi3FMUState state) {
    memcpy(i, state, sizeof(Model));
    return fmi3OK;
}

fmi3Status fmi3FreeFMUState(fmi3Instance i, fmi3FMUState *state) {
    (void)i;
    free(*state);
    *state = NULL;
    return fmi3OK;
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance i, fmi3FMUState state, size_t *size) {
    (void)i, (void)state;
    *size = sizeof(Model);
    return fmi3OK;
}

fmi3Status fmi3SerializeFMUState(fmi3Instance i, fmi3FMUState state, fmi3Byte bytes[], size_t size) {
    (void)i;
    if (size < sizeof(Model)) return fmi3Error;
    memcpy(bytes, state, sizeof(Model));
    return fmi3OK;
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance i, const fmi3Byte bytes[], size_t size, fmi3FMUState *state) {
    if (size != sizeof(Model) || fmi3GetFMUState(i, state)) return fmi3Error;
    memcpy(*state, bytes, size);
    return fmi3OK;
}

fmi3Status fmi3SetDebugLogging(fmi3Instance i, fmi3Boolean on, size_t n, const fmi3String categories[]) {
    return (void)i, (void)on, (void)n, (void)categories, fmi3OK;
}

/* There are no variables of other types, no events, clocks, derivatives or other interfaces. */
fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                          fmi3Boolean logging, fmi3InstanceEnvironment environment,
                                          fmi3LogMessageCallback log) {
    (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)environment, (void)log;
    return NULL;
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources,
                                               fmi3Boolean visible, fmi3Boolean logging,
                                               fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                               fmi3ClockUpdateCallback update, fmi3LockPreemptionCallback lock,
                                               fmi3UnlockPreemptionCallback unlock) {
    (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)environment, (void)log;
    (void)update, (void)lock, (void)unlock;
    return NULL;
}

#define NOT_HERE(name, ...) \
    fmi3Status name(fmi3Instance i, __VA_ARGS__) { return (void)i, fmi3Error; }
#define NEVER(name) \
    fmi3Status name(fmi3Instance i) { return (void)i, fmi3Error; }
#define REFERENCES const fmi3ValueReference r[], size_t n
#define NO_TYPE(type)                                                         \
    NOT_HERE(fmi3Get##type, REFERENCES, fmi3##type values[], size_t count)    \
    NOT_HERE(fmi3Set##type, REFERENCES, const fmi3##type values[], size_t count)

NO_TYPE(Float32)
NO_TYPE(Int8)
NO_TYPE(UInt8)
NO_TYPE(Int16)
NO_TYPE(UInt16)
NO_TYPE(Int32)
NO_TYPE(UInt32)
NO_TYPE(Int64)
NO_TYPE(UInt64)
NO_TYPE(Boolean)
NO_TYPE(String)
NOT_HERE(fmi3GetBinary, REFERENCES, size_t lengths[], fmi3Binary values[], size_t count)
NOT_HERE(fmi3SetBinary, REFERENCES, const size_t lengths[], const fmi3Binary values[], size_t count)
NOT_HERE(fmi3GetClock, REFERENCES, fmi3Clock values[])
NOT_HERE(fmi3SetClock, REFERENCES, const fmi3Clock values[])
NOT_HERE(fmi3GetNumberOfVariableDependencies, fmi3ValueReference r, size_t *n)
NOT_HERE(fmi3GetVariableDependencies, fmi3ValueReference r, size_t element[], fmi3ValueReference on[], size_t at[],
         fmi3DependencyKind kind[], size_t n)
NOT_HERE(fmi3GetDirectionalDerivative, REFERENCES, const fmi3ValueReference k[], size_t nk, const fmi3Float64 s[],
         size_t ns, fmi3Float64 d[], size_t nd)
NOT_HERE(fmi3GetAdjointDerivative, REFERENCES, const fmi3ValueReference k[], size_t nk, const fmi3Float64 s[],
         size_t ns, fmi3Float64 d[], size_t nd)
NOT_HERE(fmi3GetIntervalDecimal, REFERENCES, fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[])
NOT_HERE(fmi3GetIntervalFraction, REFERENCES, fmi3UInt64 counters[], fmi3UInt64 resolutions[],
         fmi3IntervalQualifier qualifiers[])
NOT_HERE(fmi3GetShiftDecimal, REFERENCES, fmi3Float64 shifts[])
NOT_HERE(fmi3GetShiftFraction, REFERENCES, fmi3UInt64 counters[], fmi3UInt64 resolutions[])
NOT_HERE(fmi3SetIntervalDecimal, REFERENCES, const fmi3Float64 intervals[])
NOT_HERE(fmi3SetIntervalFraction, REFERENCES, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
NOT_HERE(fmi3SetShiftDecimal, REFERENCES, const fmi3Float64 shifts[])
NOT_HERE(fmi3SetShiftFraction, REFERENCES, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
NOT_HERE(fmi3UpdateDiscreteStates, fmi3Boolean *more, fmi3Boolean *terminate, fmi3Boolean *nominals, fmi3Boolean *values,
         fmi3Boolean *next, fmi3Float64 *time)
NOT_HERE(fmi3GetOutputDerivatives, REFERENCES, const fmi3Int32 orders[], fmi3Float64 values[], size_t count)
NEVER(fmi3EnterEventMode)
NEVER(fmi3EnterConfigurationMode)
NEVER(fmi3ExitConfigurationMode)
NEVER(fmi3EvaluateDiscreteStates)
NEVER(fmi3EnterStepMode)
NEVER(fmi3EnterContinuousTimeMode)
NOT_HERE(fmi3CompletedIntegratorStep, fmi3Boolean final, fmi3Boolean *event, fmi3Boolean *terminate)
NOT_HERE(fmi3SetTime, fmi3Float64 time)
NOT_HERE(fmi3SetContinuousStates, const fmi3Float64 values[], size_t n)
NOT_HERE(fmi3GetContinuousStateDerivatives, fmi3Float64 values[], size_t n)
NOT_HERE(fmi3GetEventIndicators, fmi3Float64 values[], size_t n)
NOT_HERE(fmi3GetContinuousStates, fmi3Float64 values[], size_t n)
NOT_HERE(fmi3GetNominalsOfContinuousStates, fmi3Float64 values[], size_t n)
NOT_HERE(fmi3GetNumberOfEventIndicators, size_t *n)
NOT_HERE(fmi3GetNumberOfContinuousStates, size_t *n)
NOT_HERE(fmi3ActivateModelPartition, fmi3ValueReference clock, fmi3Float64 time)
