/* The functions of FMI 2.0 for co-simulation (the standard of 2014, sections 2.1 and 4.2.1).

   A function with `...` supports nothing and reads none of its further arguments. */

#include "instance.h"

#include <string.h>

typedef void (*Logger)(void *environment, const char *name, int status, const char *category,
                       const char *message, ...);
typedef struct {
    Logger logger;
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*step_finished)(void *, int);
    void *environment;
} Callbacks;

static void send(Instance *one, Status status, const char *message) {
    Logger logger = (Logger)one->logger;
    if (logger != NULL) logger(one->environment, one->name, status, "logStatusError", message);
}

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }
EXPORT int fmi2SetDebugLogging(Instance *one, ...) { return (void)one, OK; }

EXPORT Instance *fmi2Instantiate(const char *name, int type, const char *token,
                                 const char *resources, const Callbacks *callbacks, int visible,
                                 int logging) {
    (void)resources, (void)visible, (void)logging;
    if (callbacks == NULL || type != 1) return NULL; /* 1: co-simulation */
    return create(name, token, callbacks->environment, send, (void (*)(void))callbacks->logger);
}
EXPORT void fmi2FreeInstance(Instance *one) { destroy(one); }

EXPORT int fmi2SetupExperiment(Instance *one, int tolerance_defined, double tolerance,
                               double start_s, int stop_defined, double stop_s) {
    (void)tolerance_defined, (void)tolerance, (void)stop_defined, (void)stop_s;
    if (one->state.mode != INSTANTIATED) return fail(one, "the instance is initialized already");
    one->state.time_s = start_s;
    return OK;
}
EXPORT int fmi2EnterInitializationMode(Instance *one) { return start(one, one->state.time_s); }
EXPORT int fmi2ExitInitializationMode(Instance *one) { return finish_start(one); }
EXPORT int fmi2Terminate(Instance *one) { return terminate(one); }
EXPORT int fmi2Reset(Instance *one) { return reset(one); }

EXPORT int fmi2GetReal(Instance *one, const unsigned *references, size_t count, double *values) {
    return get(one, references, count, values);
}
EXPORT int fmi2SetReal(Instance *one, const unsigned *references, size_t count,
                       const double *values) {
    return set(one, references, count, values);
}
#define NONE(TYPE)                                                                                \
    EXPORT int fmi2Get##TYPE(Instance *one, const unsigned *references, size_t count, ...) {      \
        return (void)references, none_of_type(one, count);                                        \
    }                                                                                             \
    EXPORT int fmi2Set##TYPE(Instance *one, const unsigned *references, size_t count, ...) {      \
        return (void)references, none_of_type(one, count);                                        \
    }
NONE(Integer) NONE(Boolean) NONE(String)

EXPORT int fmi2GetFMUstate(Instance *one, void **saved) { return save(one, saved); }
EXPORT int fmi2SetFMUstate(Instance *one, void *saved) { return restore(one, saved); }
EXPORT int fmi2FreeFMUstate(Instance *one, void **saved) { return discard(one, saved); }
EXPORT int fmi2SerializedFMUstateSize(Instance *one, void *saved, size_t *size) {
    return serialized_size(one, saved, size);
}
EXPORT int fmi2SerializeFMUstate(Instance *one, void *saved, uint8_t *bytes, size_t size) {
    return serialize(one, saved, bytes, size);
}
EXPORT int fmi2DeSerializeFMUstate(Instance *one, const uint8_t *bytes, size_t size,
                                   void **saved) {
    return deserialize(one, bytes, size, saved);
}

/* The rate of the force is an input of its own. Other inputs are read at the start of a step only,
   where their rates do nothing. */
EXPORT int fmi2SetRealInputDerivatives(Instance *one, const unsigned *references, size_t count,
                                       const int *orders, const double *values) {
    for (size_t i = 0; i < count; i++) {
        if (references[i] >= VARIABLES || VARIABLE[references[i]].role != INPUT)
            return fail(one, "value reference %u is no input", references[i]);
        if (orders[i] != 1) return fail(one, "a derivative of order %d; should be 1", orders[i]);
        const unsigned rate = FORCE_RATE;
        if (references[i] == FORCE && set(one, &rate, 1, &values[i]) != OK) return ERROR;
    }
    return OK;
}
EXPORT int fmi2DoStep(Instance *one, double time_s, double step_s, int no_step_back) {
    return (void)no_step_back, step(one, time_s, step_s);
}
EXPORT int fmi2GetRealStatus(Instance *one, int kind, double *value) {
    if (kind != 2) return DISCARD; /* 2: the last successful time */
    *value = one->state.time_s;
    return OK;
}
EXPORT int fmi2GetBooleanStatus(Instance *one, int kind, int *value) {
    (void)one;
    if (kind != 3) return DISCARD; /* 3: terminated */
    *value = 0;
    return OK;
}

#define UNSUPPORTED(NAME) EXPORT int NAME(Instance *one, ...) { return unsupported(one, #NAME); }
UNSUPPORTED(fmi2GetDirectionalDerivative)
UNSUPPORTED(fmi2GetRealOutputDerivatives)
UNSUPPORTED(fmi2CancelStep)
UNSUPPORTED(fmi2GetStatus)
UNSUPPORTED(fmi2GetIntegerStatus)
UNSUPPORTED(fmi2GetStringStatus)
