
typedef int fmi2Status; /* 0 OK, 3 error */
typedef struct {
    void (*logger)(void *environment, const char *name, fmi2Status status, const char *category, const char *text, ...);
    void *(*allocate)(size_t count, size_t size);
    void (*free)(void *memory);
    void (*finished)(void *environment, fmi2Status status);
    void *environment;
} fmi2CallbackFunctions;

#define CHECKED(done) ((done) ? 0 : 3)
#ifdef _WIN32
#define API __declspec(dllexport)
#else
#define API
#endif

static void tell(unit *u, const char *message) {
    const fmi2CallbackFunctions *callbacks = u->log;
    if (callbacks != NULL && callbacks->logger != NULL) {
        callbacks->logger(callbacks->environment, "drive", 3, "logStatusError", message);
    }
}

API const char *fmi2GetTypesPlatform(void) { return "default"; }
API const char *fmi2GetVersion(void) { return "2.0"; }
API fmi2Status fmi2SetDebugLogging(void *u, int on, size_t count, const char *const categories[]) {
    (void)u, (void)on, (void)count, (void)categories;
    return 0;
}
API void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources,
                          const fmi2CallbackFunctions *callbacks, int visible, int logging) {
    (void)name, (void)resources, (void)visible, (void)logging;
    return type == 1 ? unit_new(guid, NULL, (void *)(uintptr_t)callbacks) : NULL;
}
API void fmi2FreeInstance(void *u) { free(u); }
API fmi2Status fmi2SetupExperiment(void *u, int tolerant, double tolerance, double start, int stops, double stop) {
    (void)u, (void)tolerant, (void)tolerance, (void)start, (void)stops, (void)stop;
    return 0;
}
API fmi2Status fmi2EnterInitializationMode(void *u) {
    (void)u;
    return 0;
}
API fmi2Status fmi2ExitInitializationMode(void *u) { return CHECKED(unit_begin(u)); }
API fmi2Status fmi2Terminate(void *u) {
    (void)u;
    return 0;
}
API fmi2Status fmi2Reset(void *u) {
    begin_anew(u);
    return 0;
}
API fmi2Status fmi2GetReal(void *u, const unsigned references[], size_t count, double values[]) {
    int done = 1;
    for (size_t k = 0; k < count; k++) {
        done &= unit_get(u, references[k], &values[k]);
    }
    return CHECKED(done);
}
API fmi2Status fmi2SetReal(void *u, const unsigned references[], size_t count, const double values[]) {
    int done = 1;
    for (size_t k = 0; k < count; k++) {
        done &= unit_set(u, references[k], values[k]);
    }
    return CHECKED(done);
}
API fmi2Status fmi2GetInteger(void *u, const unsigned references[], size_t count, int values[]) {
    int done = 1;
    for (size_t k = 0; k < count; k++) {
        done &= unit_get_whole(u, references[k], &values[k]);
    }
    return CHECKED(done);
}
API fmi2Status fmi2SetInteger(void *u, const unsigned references[], size_t count, const int values[]) {
    int done = 1;
    for (size_t k = 0; k < count; k++) {
        done &= unit_set_whole(u, references[k], values[k]);
    }
    return CHECKED(done);
}
API fmi2Status fmi2DoStep(void *u, double now, double step, int keep) {
    (void)now, (void)keep;
    return CHECKED(unit_step(u, step));
}
API fmi2Status fmi2GetFMUstate(void *u, void **state) { return CHECKED(unit_keep(u, state)); }
API fmi2Status fmi2SetFMUstate(void *u, void *state) { return CHECKED(unit_restore(u, state)); }
API fmi2Status fmi2FreeFMUstate(void *u, void **state) {
    (void)u;
    return CHECKED(state_forget(state));
}
API fmi2Status fmi2SerializedFMUstateSize(void *u, void *state, size_t *size) {
    (void)u, (void)state;
    *size = sizeof(unit_state);
    return 0;
}
API fmi2Status fmi2SerializeFMUstate(void *u, void *state, char bytes[], size_t size) {
    (void)u;
    return CHECKED(state_to_bytes(state, bytes, size));
}
API fmi2Status fmi2DeSerializeFMUstate(void *u, const char bytes[], size_t size, void **state) {
    (void)u;
    return CHECKED(state_from_bytes(bytes, size, state));
}

/* Of the interface, but of no use here: each says that it is refused. */
#define REFUSED(name) \
    API fmi2Status name(void) { return 3; }
REFUSED(fmi2GetBoolean)
REFUSED(fmi2SetBoolean)
REFUSED(fmi2GetString)
REFUSED(fmi2SetString)
REFUSED(fmi2GetDirectionalDerivative)
REFUSED(fmi2SetRealInputDerivatives)
REFUSED(fmi2GetRealOutputDerivatives)
REFUSED(fmi2CancelStep)
REFUSED(fmi2GetStatus)
REFUSED(fmi2GetRealStatus)
REFUSED(fmi2GetIntegerStatus)
REFUSED(fmi2GetBooleanStatus)
REFUSED(fmi2GetStringStatus)
