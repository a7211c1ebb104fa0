/* What fmi2.c and fmi3.c need of a model: its variables, its state, and three functions. */

#ifndef FMU_H
#define FMU_H

#include <stddef.h>

typedef enum {
    FMU_TIME,
    FMU_INPUT,
    FMU_FIXED,   /* parameter, set before the initialization ends */
    FMU_TUNABLE, /* parameter */
    FMU_OUTPUT,
    FMU_INTEGER_OUTPUT
} fmu_kind;

typedef struct {
    fmu_kind kind;
    double start;
    double least; /* inputs of a truck, and parameters, must be from least to most */
    double most;
    const char *expected; /* message for a value outside of this range; NULL where every value is accepted */
} fmu_variable;

#include "fmu_model.h" /* generated: FMU_COUNT, FMU_TOKEN, fmu_variables and fmu_model */

/* All that changes during a simulation. It has no pointers, so it may be copied, stored and restored. */
typedef struct {
    double value[FMU_COUNT]; /* by value reference; the first is the time */
    double slope[FMU_COUNT]; /* derivatives of the inputs during the next step */
    fmu_model model;
} fmu_state;

/* Starts a model; all values are those of fmu_variables, except those that the importer has set. */
void fmu_start(fmu_state *state);

/* Computes the outputs at the time of the state. */
void fmu_outputs(fmu_state *state);

/* Advances by `step` seconds and computes the outputs. Returns NULL, or a message if it is not possible; then nothing
   has changed. */
const char *fmu_step(fmu_state *state, double step);

/* What is the same for all versions of the standard, in fmu.c. A function that fails returns its message, otherwise
   NULL. */
typedef enum { FMU_INSTANTIATED, FMU_INITIALIZATION, FMU_STEPPING, FMU_TERMINATED } fmu_mode;

typedef struct {
    fmu_state state;
    fmu_mode mode;
    int evaluated; /* whether the outputs are up to date */
} fmu_instance;

int fmu_accepts(const char *token); /* whether it is that of this model */
void fmu_reset(fmu_instance *instance);
const char *fmu_initialize(fmu_instance *instance);
const char *fmu_finish_initialization(fmu_instance *instance);
const char *fmu_get(fmu_instance *instance, size_t reference, int integer, double *value);
const char *fmu_set(fmu_instance *instance, size_t reference, double value);
const char *fmu_set_slope(fmu_instance *instance, size_t reference, int order, double value);
const char *fmu_do_step(fmu_instance *instance, double time, double step);

/* A saved state, or its bytes, is a copy of an instance; `*saved` is allocated if it is NULL. */
const char *fmu_save(const void *instance, void **saved);
void fmu_discard(void **saved);
const char *fmu_serialize(const void *saved, void *bytes, size_t size);
const char *fmu_deserialize(const void *bytes, size_t size, void **saved);

#endif
