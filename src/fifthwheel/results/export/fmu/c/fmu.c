/* What is the same for all versions of the standard: modes, values, steps and states. See fmu.h. */

#include "fmu.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define TOLERANCE 1e-9 /* of the time, relative or in s */

int fmu_accepts(const char *token)
{
    static const char expected[] = FMU_TOKEN;
    size_t i = 0;
    while ((token != NULL) && (expected[i] != '\0') && (token[i] == expected[i])) {
        i++;
    }
    return ((token != NULL) && (token[i] == expected[i])) ? 1 : 0;
}

void fmu_reset(fmu_instance *instance)
{
    static const fmu_instance zero;
    *instance = zero;
    for (size_t i = 0; i < FMU_COUNT; i++) {
        instance->state.value[i] = fmu_variables[i].start;
    }
    instance->mode = FMU_INSTANTIATED;
}

const char *fmu_initialize(fmu_instance *instance)
{
    if (instance->mode != FMU_INSTANTIATED) {
        return "initialization: expected once, after instantiation or reset";
    }
    instance->mode = FMU_INITIALIZATION;
    fmu_start(&instance->state);
    return NULL;
}

const char *fmu_finish_initialization(fmu_instance *instance)
{
    if (instance->mode != FMU_INITIALIZATION) {
        return "initialization: not begun; enter the initialization mode first";
    }
    instance->mode = FMU_STEPPING;
    fmu_outputs(&instance->state);
    instance->evaluated = 1;
    return NULL;
}

const char *fmu_get(fmu_instance *instance, size_t reference, int integer, double *value)
{
    if (reference >= FMU_COUNT) {
        return "value reference: not one of modelDescription.xml; import the FMU again";
    }
    if ((fmu_variables[reference].kind == FMU_INTEGER_OUTPUT) != (integer != 0)) {
        return "value reference: of a variable of another type; see modelDescription.xml";
    }
    if ((instance->mode == FMU_INITIALIZATION) && (instance->evaluated == 0)) {
        fmu_outputs(&instance->state);
        instance->evaluated = 1;
    }
    *value = instance->state.value[reference];
    return NULL;
}

const char *fmu_set(fmu_instance *instance, size_t reference, double value)
{
    const fmu_variable *variable = &fmu_variables[(reference < FMU_COUNT) ? reference : 0];
    if ((variable->kind == FMU_FIXED) && (instance->mode == FMU_STEPPING)) {
        return "fixed parameter: cannot change after the initialization; reset the FMU first";
    }
    if ((variable->kind != FMU_INPUT) && (variable->kind != FMU_FIXED) && (variable->kind != FMU_TUNABLE)) {
        return "value reference: neither an input nor a parameter; only these can be set";
    }
    if ((variable->kind != FMU_INPUT) && !((value >= variable->least) && (value <= variable->most))) {
        return variable->expected;
    }
    instance->state.value[reference] = value;
    instance->state.slope[reference] = 0.0;
    instance->evaluated = 0;
    return NULL;
}

const char *fmu_set_slope(fmu_instance *instance, size_t reference, int order, double value)
{
    if ((reference >= FMU_COUNT) || (fmu_variables[reference].kind != FMU_INPUT)) {
        return "value reference: not an input; only inputs have derivatives";
    }
    if (order != 1) {
        return "derivatives of inputs: only those of order 1 are used; set no higher ones";
    }
    instance->state.slope[reference] = value;
    return NULL;
}

const char *fmu_do_step(fmu_instance *instance, double time, double step)
{
    fmu_state *state = &instance->state;
    const double late = time - state->value[0];
    const double scale = (fabs(time) > 1.0) ? fabs(time) : 1.0;
    const char *message;
    if (instance->mode != FMU_STEPPING) {
        return "step: not initialized; enter and exit the initialization mode first";
    }
    if (!((step > 0.0) && (step < INFINITY))) {
        return "communicationStepSize: expected a number above 0 s";
    }
    if (!(fabs(late) <= (TOLERANCE * scale))) {
        return "currentCommunicationPoint: expected the end of the last step; to repeat a step, restore its state";
    }
    for (size_t i = 0; i < FMU_COUNT; i++) {
        const fmu_variable *variable = &fmu_variables[i];
        const double value = state->value[i];
        if ((variable->kind == FMU_INPUT) && (variable->expected != NULL)
            && !((value >= variable->least) && (value <= variable->most))) {
            return variable->expected;
        }
    }
    state->value[0] = time;
    message = fmu_step(state, step);
    if (message != NULL) {
        return message;
    }
    for (size_t i = 0; i < FMU_COUNT; i++) {
        state->slope[i] = 0.0;
    }
    state->value[0] = time + step;
    instance->evaluated = 1;
    return NULL;
}

const char *fmu_save(const void *instance, void **saved)
{
    if (*saved == NULL) {
        *saved = calloc(1, sizeof(fmu_instance));
    }
    if (*saved == NULL) {
        return "memory: none left for a state";
    }
    (void)memcpy(*saved, instance, sizeof(fmu_instance));
    return NULL;
}

void fmu_discard(void **saved)
{
    if (saved != NULL) {
        free(*saved);
        *saved = NULL;
    }
}

const char *fmu_serialize(const void *saved, void *bytes, size_t size)
{
    if ((saved == NULL) || (size < sizeof(fmu_instance))) {
        return "serializedState: too small; ask for the size first";
    }
    (void)memcpy(bytes, saved, sizeof(fmu_instance));
    return NULL;
}

const char *fmu_deserialize(const void *bytes, size_t size, void **saved)
{
    if (size != sizeof(fmu_instance)) {
        return "serializedState: of another size; expected one of this FMU and platform";
    }
    return fmu_save(bytes, saved);
}
