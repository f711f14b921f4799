/* The loader of one control: values, steps and saved states of an instance. */

#include "instance.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define NEAR 1e-6 /* of a frame, by which a time may differ from the instance's own */

/* numba's convention: the result and an error object come first; 0 is without error. */
extern int32_t coupled_frame(double *command, void **fault, int64_t control, int64_t nodes,
                             int64_t row, int64_t first, double pressure_Pa, double load_factor,
                             double alpha_rad);
extern int32_t coupled_number(double *value, void **fault, int64_t law, double factor, double a,
                              double b, double c, double d, double e);

/* numba refers to this for arrays that it allocated; the stages allocate none. */
#ifndef _WIN32
__attribute__((visibility("hidden")))
#endif
void NRT_MemInfo_call_dtor(void *information) { (void)information; }

static int64_t address(void *place) { return (int64_t)(intptr_t)place; }

Status fail(Instance *one, const char *format, ...) {
    char message[400];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(message, sizeof message, format, arguments);
    va_end(arguments);
    one->send(one, ERROR, message);
    return ERROR;
}

static void set_initial_state(State *state) {
    memset(state, 0, sizeof *state);
    for (size_t i = 0; i < VARIABLES; i++) state->values[i] = VARIABLE[i].start;
    memcpy(state->control, CONTROL, sizeof CONTROL);
}

Instance *create(const char *name, const char *token, void *environment,
                 void (*send)(Instance *, Status, const char *), void (*logger)(void)) {
    Instance *one = calloc(1, sizeof *one);
    if (one == NULL) return NULL;
    name = name == NULL ? "" : name;
    one->environment = environment;
    one->send = send;
    one->logger = logger;
    one->name = malloc(strlen(name) + 1);
    if (one->name != NULL) strcpy(one->name, name);
    if (one->name != NULL && token != NULL && strcmp(token, TOKEN) == 0) {
        set_initial_state(&one->state);
        return one;
    }
    if (one->name != NULL) fail(one, "the token is not that of this FMU, %s", TOKEN);
    destroy(one);
    return NULL;
}

void destroy(Instance *one) {
    if (one == NULL) return;
    free(one->name);
    free(one);
}

/* Parameters */

static double argument(const State *state, int variable) {
    return variable < VARIABLES ? state->values[variable] : CONSTANT[variable - VARIABLES];
}

/* Write the rig file's numbers into the control, as `pack` does. */
static Status apply_parameters(Instance *one, State *state) {
    const double *v = state->values;
    if (!state->parameters_changed) return OK;
    for (size_t i = 1; i < VARIABLES; i++)
        if (VARIABLE[i].rises && v[i] <= v[i - 1])
            return fail(one, "%s = %g is not above %s = %g", VARIABLE[i].name, v[i],
                        VARIABLE[i - 1].name, v[i - 1]);
    for (size_t i = 0; i < GRADIENTS; i++) {
        const Gradient *of = &GRADIENT[i];
        double first = v[of->first], gradient = first + v[SLOPE] * (v[of->row] - first);
        if (gradient < 0.0 || v[BEND] * gradient >= 1.0)
            return fail(one, "%s: the gradient is %g, should be 0 or more, and below 1/%s = %g",
                        VARIABLE[of->row].name, gradient, VARIABLE[BEND].name, 1.0 / v[BEND]);
    }
    for (size_t i = 0; i < NUMBERS; i++) {
        const Number *of = &NUMBER[i];
        void *fault = NULL;
        double value = 0.0, a[5];
        for (int j = 0; j < 5; j++) a[j] = argument(state, of->arguments[j]);
        if (coupled_number(&value, &fault, of->law, of->factor, a[0], a[1], a[2], a[3], a[4]) != 0
            || !isfinite(value))
            return fail(one, "the parameters give no finite number of the control");
        int64_t whole = (int64_t)value;
        memcpy(&state->control[of->word], of->whole ? (void *)&whole : (void *)&value, 8);
    }
    state->parameters_changed = 0;
    return OK;
}

/* Frames */

static Status run_frame(Instance *one, State *state) {
    double *v = state->values, row[ROW] = {0.0}, command = 0.0;
    void *fault = NULL;
    for (int i = 0; i <= SUBSTEPS; i++)
        one->nodes[i] = v[FORCE] + v[FORCE_RATE] * (i * SUBSTEP_s);
    double alpha_rad = ALPHA < 0 ? 0.0 : v[ALPHA < 0 ? 0 : ALPHA];
    int32_t raised = coupled_frame(&command, &fault, address(state->control), address(one->nodes),
                                   address(row), state->started == 0, v[PRESSURE], v[LOAD_FACTOR],
                                   alpha_rad);
    if (raised != 0) return fail(one, "at %g s: division by zero in the loader", state->time_s);
    for (int i = 0; i < OUTPUTS; i++) {
        v[OUTPUT + i] = row[state == &one->trial ? STARTS_AT[i] : ENDS_AT[i]];
        if (!isfinite(v[OUTPUT + i]))
            return fail(one, "at %g s: %s is not finite", state->time_s, VARIABLE[OUTPUT + i].name);
    }
    state->started = 1;
    state->time_s += FRAME_s;
    return OK;
}

/* Compute the outputs at the start: those of a frame of a copy. */
static Status compute_first_outputs(Instance *one) {
    one->trial = one->state;
    if (apply_parameters(one, &one->trial) != OK) return ERROR;
    if (run_frame(one, &one->trial) != OK) return ERROR;
    memcpy(one->state.values + OUTPUT, one->trial.values + OUTPUT, OUTPUTS * sizeof(double));
    return OK;
}

/* The importer's times count, so that the rounding of its steps adds up in both alike. */
Status step(Instance *one, double time_s, double step_s) {
    State *state = &one->state;
    if (state->mode == FAILED)
        return fail(one, "the last step failed; reset the instance, or set a saved state");
    if (state->mode == TERMINATED)
        return fail(one, "the instance is terminated; reset it, or set a saved state");
    if (state->mode != STEPPING) return fail(one, "a step before the initialization is finished");
    double near_s = NEAR * FRAME_s + 1e-12 * fabs(state->time_s);
    if (!(fabs(time_s - state->time_s) <= near_s))
        return fail(one, "a step from %.9g s; the instance is at %.9g s", time_s, state->time_s);
    double frames = floor(step_s / FRAME_s + 0.5);
    if (!(fabs(step_s - frames * FRAME_s) <= near_s && frames >= 1.0 && frames <= MOST_FRAMES))
        return fail(one, "a step of %.9g s; should be a positive multiple of the frame, %.17g s",
                    step_s, FRAME_s);
    if (apply_parameters(one, state) != OK) return ERROR;
    double force = state->values[FORCE], rate = state->values[FORCE_RATE];
    state->time_s = time_s;
    for (int64_t i = 0; i < (int64_t)frames; i++) {
        state->values[FORCE] = force + rate * (i * FRAME_s);
        if (run_frame(one, state) != OK) {
            state->mode = FAILED;
            break;
        }
    }
    state->values[FORCE] = force;
    if (state->mode != FAILED) state->time_s = time_s + step_s;
    state->values[TIME] = state->time_s;
    return state->mode == FAILED ? ERROR : OK;
}

/* Modes */

Status start(Instance *one, double time_s) {
    if (one->state.mode != INSTANTIATED) return fail(one, "the instance is initialized already");
    if (!isfinite(time_s)) return fail(one, "the start time is not finite");
    one->state.time_s = one->state.values[TIME] = time_s;
    one->state.mode = INITIALIZING;
    return OK;
}

Status finish_start(Instance *one) {
    if (one->state.mode != INITIALIZING) return fail(one, "the initialization is not begun");
    if (compute_first_outputs(one) != OK) return ERROR;
    one->state.mode = STEPPING;
    return OK;
}

Status terminate(Instance *one) {
    one->state.mode = TERMINATED;
    return OK;
}

Status reset(Instance *one) {
    set_initial_state(&one->state);
    return OK;
}

/* Values */

static Status check_references(Instance *one, const uint32_t *references, size_t count) {
    for (size_t i = 0; i < count; i++)
        if (references[i] >= VARIABLES)
            return fail(one, "value reference %u is unknown; the last is %d", references[i],
                        VARIABLES - 1);
    return OK;
}

Status get(Instance *one, const uint32_t *references, size_t count, double *values) {
    if (check_references(one, references, count) != OK) return ERROR;
    if (one->state.mode == INITIALIZING && compute_first_outputs(one) != OK) return ERROR;
    for (size_t i = 0; i < count; i++) values[i] = one->state.values[references[i]];
    return OK;
}

/* Set all values, or none. */
Status set(Instance *one, const uint32_t *references, size_t count, const double *values) {
    if (check_references(one, references, count) != OK) return ERROR;
    if (one->state.mode == TERMINATED) return fail(one, "the instance is terminated");
    for (size_t i = 0; i < count; i++) {
        const Variable *of = &VARIABLE[references[i]];
        double x = values[i];
        if (of->role != INPUT && of->role != PARAMETER) return fail(one, "%s is no input or parameter", of->name);
        if (!isfinite(x)) return fail(one, "%s is not finite", of->name);
        if (of->whole && x != 0.0 && x != 1.0)
            return fail(one, "%s = %g; should be 0 or 1", of->name, x);
        if (x < of->least || x > of->most || (of->above && x <= of->least))
            return fail(one, "%s = %g is outside its range, %s%g to %g", of->name, x,
                        of->above ? "above " : "", of->least, of->most);
    }
    for (size_t i = 0; i < count; i++) {
        one->state.values[references[i]] = values[i];
        if (VARIABLE[references[i]].role == PARAMETER) one->state.parameters_changed = 1;
    }
    return OK;
}

Status none_of_type(Instance *one, size_t count) {
    return count == 0 ? OK : fail(one, "a variable of another type than a real number");
}

Status unsupported(Instance *one, const char *function) {
    return fail(one, "%s is not supported", function);
}

/* Saved states */

static const size_t SAVED = sizeof TOKEN + sizeof(State);

Status save(Instance *one, void **saved) {
    if (*saved == NULL) *saved = malloc(SAVED);
    if (*saved == NULL) return fail(one, "no memory for a state");
    memcpy(*saved, TOKEN, sizeof TOKEN);
    memcpy((char *)*saved + sizeof TOKEN, &one->state, sizeof(State));
    return OK;
}

Status restore(Instance *one, const void *saved) {
    if (saved == NULL) return fail(one, "no state is given");
    memcpy(&one->state, (const char *)saved + sizeof TOKEN, sizeof(State));
    return OK;
}

Status discard(Instance *one, void **saved) {
    (void)one;
    if (saved != NULL) {
        free(*saved);
        *saved = NULL;
    }
    return OK;
}

Status serialized_size(Instance *one, const void *saved, size_t *size) {
    if (saved == NULL) return fail(one, "no state is given");
    *size = SAVED;
    return OK;
}

Status serialize(Instance *one, const void *saved, uint8_t *bytes, size_t size) {
    if (saved == NULL) return fail(one, "no state is given");
    if (size < SAVED) return fail(one, "a state needs %zu bytes, given are %zu", SAVED, size);
    memcpy(bytes, saved, SAVED);
    return OK;
}

Status deserialize(Instance *one, const uint8_t *bytes, size_t size, void **saved) {
    if (size != SAVED || memcmp(bytes, TOKEN, sizeof TOKEN) != 0)
        return fail(one, "the bytes are no state of this FMU");
    if (*saved == NULL) *saved = malloc(SAVED);
    if (*saved == NULL) return fail(one, "no memory for a state");
    memcpy(*saved, bytes, SAVED);
    return OK;
}
