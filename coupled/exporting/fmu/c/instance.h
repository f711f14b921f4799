/* An instance of the FMU, without the FMI's names: fmi2.c and fmi3.c give it those.

   One physics: `coupled_frame` and `coupled_number` are the machine code of coupled's compiled
   stages (coupled/exporting/fmu/kernel.py). `model.h` is generated from the rig. */

#ifndef INSTANCE_H
#define INSTANCE_H

#include <stddef.h>
#include <stdint.h>

#include "model.h"

#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

typedef enum { OK, WARNING, DISCARD, ERROR, FATAL } Status; /* the same in FMI 2 and 3 */
typedef enum { INSTANTIATED, INITIALIZING, STEPPING, FAILED, TERMINATED } Mode;

/* All that a step changes: copying it saves the instance. */
typedef struct {
    int64_t mode, started;          /* started: a frame is done */
    int64_t parameters_changed;     /* since they were last written into the control */
    double time_s;                  /* by the importer's clock */
    double values[VARIABLES];       /* by value reference */
    int64_t control[CONTROL_WORDS]; /* parameters and state of all stages */
} State;

typedef struct Instance Instance;
struct Instance {
    State state;
    State trial;                      /* for the outputs at the start */
    double nodes[2 * (SUBSTEPS + 1)]; /* the hand's force and held deflection over a frame */
    char *name;
    void *environment;                /* of the importer */
    void (*send)(Instance *, Status, const char *message);
    void (*logger)(void);             /* the importer's function, called by `send` */
};

Instance *create(const char *name, const char *token, void *environment,
                 void (*send)(Instance *, Status, const char *), void (*logger)(void));
void destroy(Instance *one);
Status fail(Instance *one, const char *format, ...);
Status start(Instance *one, double time_s);
Status finish_start(Instance *one);
Status terminate(Instance *one);
Status reset(Instance *one);
Status get(Instance *one, const uint32_t *references, size_t count, double *values);
Status set(Instance *one, const uint32_t *references, size_t count, const double *values);
Status step(Instance *one, double time_s, double step_s);
Status none_of_type(Instance *one, size_t count);
Status unsupported(Instance *one, const char *function);
Status save(Instance *one, void **saved);
Status restore(Instance *one, const void *saved);
Status discard(Instance *one, void **saved);
Status serialized_size(Instance *one, const void *saved, size_t *size);
Status serialize(Instance *one, const void *saved, uint8_t *bytes, size_t size);
Status deserialize(Instance *one, const uint8_t *bytes, size_t size, void **saved);

#endif
