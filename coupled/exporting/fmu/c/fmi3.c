/* The functions of FMI 3.0 for co-simulation (the standard of 2022, sections 2.2 and 4.2).

   A function with `...` supports nothing and reads none of its further arguments. */

#include "instance.h"

#include <stdbool.h>

typedef void (*Logger)(void *environment, int status, const char *category, const char *message);

static void send(Instance *one, Status status, const char *message) {
    Logger logger = (Logger)one->logger;
    if (logger != NULL) logger(one->environment, status, "logStatusError", message);
}

EXPORT const char *fmi3GetVersion(void) { return "3.0"; }
EXPORT int fmi3SetDebugLogging(Instance *one, ...) { return (void)one, OK; }

EXPORT Instance *fmi3InstantiateCoSimulation(
    const char *name, const char *token, const char *resources, bool visible, bool logging,
    bool event_mode, bool early_return, const uint32_t *intermediate, size_t intermediates,
    void *environment, Logger logger, void (*update)(void)) {
    (void)resources, (void)visible, (void)logging, (void)event_mode, (void)early_return;
    (void)intermediate, (void)intermediates, (void)update;
    return create(name, token, environment, send, (void (*)(void))logger);
}
EXPORT Instance *fmi3InstantiateModelExchange(const char *name, ...) { return (void)name, NULL; }
EXPORT Instance *fmi3InstantiateScheduledExecution(const char *name, ...) {
    return (void)name, NULL;
}
EXPORT void fmi3FreeInstance(Instance *one) { destroy(one); }

EXPORT int fmi3EnterInitializationMode(Instance *one, bool tolerance_defined, double tolerance,
                                       double start_s, bool stop_defined, double stop_s) {
    (void)tolerance_defined, (void)tolerance, (void)stop_defined, (void)stop_s;
    return start(one, start_s);
}
EXPORT int fmi3ExitInitializationMode(Instance *one) { return finish_start(one); }
EXPORT int fmi3Terminate(Instance *one) { return terminate(one); }
EXPORT int fmi3Reset(Instance *one) { return reset(one); }

EXPORT int fmi3GetFloat64(Instance *one, const uint32_t *references, size_t count, double *values,
                          size_t value_count) {
    if (value_count != count) return fail(one, "%zu values for %zu scalars", value_count, count);
    return get(one, references, count, values);
}
EXPORT int fmi3SetFloat64(Instance *one, const uint32_t *references, size_t count,
                          const double *values, size_t value_count) {
    if (value_count != count) return fail(one, "%zu values for %zu scalars", value_count, count);
    return set(one, references, count, values);
}
#define NONE(TYPE)                                                                                \
    EXPORT int fmi3Get##TYPE(Instance *one, const uint32_t *references, size_t count, ...) {      \
        return (void)references, none_of_type(one, count);                                        \
    }                                                                                             \
    EXPORT int fmi3Set##TYPE(Instance *one, const uint32_t *references, size_t count, ...) {      \
        return (void)references, none_of_type(one, count);                                        \
    }
NONE(Float32) NONE(Int8) NONE(UInt8) NONE(Int16) NONE(UInt16) NONE(Int32) NONE(UInt32)
NONE(Int64) NONE(UInt64) NONE(Boolean) NONE(String) NONE(Binary) NONE(Clock)

EXPORT int fmi3GetFMUState(Instance *one, void **saved) { return save(one, saved); }
EXPORT int fmi3SetFMUState(Instance *one, void *saved) { return restore(one, saved); }
EXPORT int fmi3FreeFMUState(Instance *one, void **saved) { return discard(one, saved); }
EXPORT int fmi3SerializedFMUStateSize(Instance *one, void *saved, size_t *size) {
    return serialized_size(one, saved, size);
}
EXPORT int fmi3SerializeFMUState(Instance *one, void *saved, uint8_t *bytes, size_t size) {
    return serialize(one, saved, bytes, size);
}
EXPORT int fmi3DeserializeFMUState(Instance *one, const uint8_t *bytes, size_t size,
                                   void **saved) {
    return deserialize(one, bytes, size, saved);
}

EXPORT int fmi3EnterStepMode(Instance *one) {
    return one->state.mode == STEPPING ? OK : fail(one, "the instance is not initialized");
}
EXPORT int fmi3DoStep(Instance *one, double time_s, double step_s, bool no_step_back,
                      bool *event_needed, bool *terminated, bool *returned_early,
                      double *last_time_s) {
    (void)no_step_back;
    *event_needed = *terminated = *returned_early = false;
    Status status = step(one, time_s, step_s);
    *last_time_s = one->state.time_s;
    return status;
}

#define UNSUPPORTED(NAME) EXPORT int NAME(Instance *one, ...) { return unsupported(one, #NAME); }
UNSUPPORTED(fmi3ActivateModelPartition)
UNSUPPORTED(fmi3CompletedIntegratorStep)
UNSUPPORTED(fmi3EnterConfigurationMode)
UNSUPPORTED(fmi3EnterContinuousTimeMode)
UNSUPPORTED(fmi3EnterEventMode)
UNSUPPORTED(fmi3EvaluateDiscreteStates)
UNSUPPORTED(fmi3ExitConfigurationMode)
UNSUPPORTED(fmi3GetAdjointDerivative)
UNSUPPORTED(fmi3GetContinuousStateDerivatives)
UNSUPPORTED(fmi3GetContinuousStates)
UNSUPPORTED(fmi3GetDirectionalDerivative)
UNSUPPORTED(fmi3GetEventIndicators)
UNSUPPORTED(fmi3GetIntervalDecimal)
UNSUPPORTED(fmi3GetIntervalFraction)
UNSUPPORTED(fmi3GetNominalsOfContinuousStates)
UNSUPPORTED(fmi3GetNumberOfContinuousStates)
UNSUPPORTED(fmi3GetNumberOfEventIndicators)
UNSUPPORTED(fmi3GetNumberOfVariableDependencies)
UNSUPPORTED(fmi3GetOutputDerivatives)
UNSUPPORTED(fmi3GetShiftDecimal)
UNSUPPORTED(fmi3GetShiftFraction)
UNSUPPORTED(fmi3GetVariableDependencies)
UNSUPPORTED(fmi3SetContinuousStates)
UNSUPPORTED(fmi3SetIntervalDecimal)
UNSUPPORTED(fmi3SetIntervalFraction)
UNSUPPORTED(fmi3SetShiftDecimal)
UNSUPPORTED(fmi3SetShiftFraction)
UNSUPPORTED(fmi3SetTime)
UNSUPPORTED(fmi3UpdateDiscreteStates)
