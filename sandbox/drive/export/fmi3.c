
#include <stdbool.h>

typedef int fmi3Status; /* 0 OK, 3 error */
typedef void (*fmi3LogMessage)(void *environment, fmi3Status status, const char *category, const char *message);

#define CHECKED(done) ((done) ? 0 : 3)
#ifdef _WIN32
#define API __declspec(dllexport)
#else
#define API
#endif

static void tell(unit *u, const char *message) {
    fmi3LogMessage log;
    memcpy(&log, &u->log, sizeof(log)); /* a pointer to a function, kept as one to an object */
    if (log != NULL) {
        log(u->environment, 3, "logStatusError", message);
    }
}

API const char *fmi3GetVersion(void) { return "3.0"; }
API fmi3Status fmi3SetDebugLogging(void *u, bool on, size_t count, const char *const categories[]) {
    (void)u, (void)on, (void)count, (void)categories;
    return 0;
}
API void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible,
                                      bool logging, bool events, bool early, const uint32_t required[], size_t count,
                                      void *environment, fmi3LogMessage log, void (*update)(void)) {
    void *kept = NULL;
    (void)name, (void)resources, (void)visible, (void)logging, (void)events, (void)early;
    (void)required, (void)count, (void)update;
    memcpy(&kept, &log, sizeof(kept));
    return unit_new(token, environment, kept);
}
API void *fmi3InstantiateModelExchange(void) { return NULL; }
API void *fmi3InstantiateScheduledExecution(void) { return NULL; }
API void fmi3FreeInstance(void *u) { free(u); }
API fmi3Status fmi3EnterInitializationMode(void *u, bool tolerant, double tolerance, double start, bool stops,
                                           double stop) {
    (void)u, (void)tolerant, (void)tolerance, (void)start, (void)stops, (void)stop;
    return 0;
}
API fmi3Status fmi3ExitInitializationMode(void *u) { return CHECKED(unit_begin(u)); }
API fmi3Status fmi3Terminate(void *u) {
    (void)u;
    return 0;
}
API fmi3Status fmi3Reset(void *u) {
    begin_anew(u);
    return 0;
}
API fmi3Status fmi3GetFloat64(void *u, const uint32_t references[], size_t count, double values[], size_t room) {
    int done = room >= count;
    for (size_t k = 0; done && k < count; k++) {
        done = unit_get(u, references[k], &values[k]);
    }
    return CHECKED(done);
}
API fmi3Status fmi3SetFloat64(void *u, const uint32_t references[], size_t count, const double values[], size_t room) {
    int done = room >= count;
    for (size_t k = 0; done && k < count; k++) {
        done = unit_set(u, references[k], values[k]);
    }
    return CHECKED(done);
}
API fmi3Status fmi3GetInt32(void *u, const uint32_t references[], size_t count, int32_t values[], size_t room) {
    int done = room >= count;
    for (size_t k = 0; done && k < count; k++) {
        done = unit_get_whole(u, references[k], &values[k]);
    }
    return CHECKED(done);
}
API fmi3Status fmi3SetInt32(void *u, const uint32_t references[], size_t count, const int32_t values[], size_t room) {
    int done = room >= count;
    for (size_t k = 0; done && k < count; k++) {
        done = unit_set_whole(u, references[k], values[k]);
    }
    return CHECKED(done);
}
API fmi3Status fmi3DoStep(void *u, double now, double step, bool keep, bool *event, bool *ends, bool *early,
                          double *reached) {
    const int done = unit_step(u, step);
    (void)keep;
    *event = *ends = *early = false;
    *reached = done ? now + step : now;
    return CHECKED(done);
}
API fmi3Status fmi3GetFMUState(void *u, void **state) { return CHECKED(unit_keep(u, state)); }
API fmi3Status fmi3SetFMUState(void *u, void *state) { return CHECKED(unit_restore(u, state)); }
API fmi3Status fmi3FreeFMUState(void *u, void **state) {
    (void)u;
    return CHECKED(state_forget(state));
}
API fmi3Status fmi3SerializedFMUStateSize(void *u, void *state, size_t *size) {
    (void)u, (void)state;
    *size = sizeof(unit_state);
    return 0;
}
API fmi3Status fmi3SerializeFMUState(void *u, void *state, uint8_t bytes[], size_t size) {
    (void)u;
    return CHECKED(state_to_bytes(state, bytes, size));
}
API fmi3Status fmi3DeserializeFMUState(void *u, const uint8_t bytes[], size_t size, void **state) {
    (void)u;
    return CHECKED(state_from_bytes(bytes, size, state));
}

/* Of the interface, but of no use here: each says that it is refused. */
#define REFUSED(name) \
    API fmi3Status name(void) { return 3; }
#define REFUSED_KIND(kind) REFUSED(fmi3Get##kind) REFUSED(fmi3Set##kind)
REFUSED_KIND(Float32)
REFUSED_KIND(Int8)
REFUSED_KIND(UInt8)
REFUSED_KIND(Int16)
REFUSED_KIND(UInt16)
REFUSED_KIND(UInt32)
REFUSED_KIND(Int64)
REFUSED_KIND(UInt64)
REFUSED_KIND(Boolean)
REFUSED_KIND(String)
REFUSED_KIND(Binary)
REFUSED_KIND(Clock)
REFUSED_KIND(IntervalDecimal)
REFUSED_KIND(IntervalFraction)
REFUSED_KIND(ShiftDecimal)
REFUSED_KIND(ShiftFraction)
REFUSED(fmi3EnterEventMode)
REFUSED(fmi3EnterStepMode)
REFUSED(fmi3EnterConfigurationMode)
REFUSED(fmi3ExitConfigurationMode)
REFUSED(fmi3GetNumberOfVariableDependencies)
REFUSED(fmi3GetVariableDependencies)
REFUSED(fmi3GetDirectionalDerivative)
REFUSED(fmi3GetAdjointDerivative)
REFUSED(fmi3EvaluateDiscreteStates)
REFUSED(fmi3UpdateDiscreteStates)
REFUSED(fmi3EnterContinuousTimeMode)
REFUSED(fmi3CompletedIntegratorStep)
REFUSED(fmi3SetTime)
REFUSED(fmi3SetContinuousStates)
REFUSED(fmi3GetContinuousStateDerivatives)
REFUSED(fmi3GetEventIndicators)
REFUSED(fmi3GetContinuousStates)
REFUSED(fmi3GetNominalsOfContinuousStates)
REFUSED(fmi3GetNumberOfEventIndicators)
REFUSED(fmi3GetNumberOfContinuousStates)
REFUSED(fmi3GetOutputDerivatives)
REFUSED(fmi3ActivateModelPartition)
