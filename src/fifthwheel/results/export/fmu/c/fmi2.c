/* The functions of FMI 2.0 for co-simulation. */

#include "fmi2.h"

#include "fmu.h"
#include "fmu_export.h"

#include <stdlib.h>

#if defined(__GNUC__) /* the standard passes more than this FMU uses */
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

#if defined(FMI2_FUNCTION_PREFIX) && !defined(FMI2_OVERRIDE_FUNCTION_PREFIX)
#define FMI2(type, name) FMU_EXPORT type FMU_JOIN(FMI2_FUNCTION_PREFIX, name)
#else
#define FMI2(type, name) FMU_EXPORT type name
#endif

typedef struct {
    fmu_instance fmu;
    const fmi2CallbackFunctions *functions; /* exist as long as the instance */
    char name[64];
} component;

static fmi2Status report(const component *c, const char *message)
{
    if (message == NULL) {
        return fmi2OK;
    }
    if ((c->functions != NULL) && (c->functions->logger != NULL)) {
        c->functions->logger(c->functions->componentEnvironment, c->name, fmi2Error, "logStatusError", message);
    }
    return fmi2Error;
}

static fmi2Status refuse(fmi2Component instance)
{
    return report(instance, "this function is not part of this FMU; see modelDescription.xml for what it supports");
}

FMI2(const char *, fmi2GetTypesPlatform)(void)
{
    return "default";
}

FMI2(const char *, fmi2GetVersion)(void)
{
    return "2.0";
}

FMI2(fmi2Status, fmi2SetDebugLogging)(fmi2Component c, fmi2Boolean loggingOn, size_t nCategories,
                                      const fmi2String categories[])
{
    return fmi2OK; /* errors are always reported, and there is nothing else to report */
}

FMI2(fmi2Component, fmi2Instantiate)(fmi2String instanceName, fmi2Type fmuType, fmi2String fmuGUID,
                                     fmi2String fmuResourceLocation, const fmi2CallbackFunctions *functions,
                                     fmi2Boolean visible, fmi2Boolean loggingOn)
{
    component caller = {.functions = functions};
    component *c;
    for (size_t i = 0; (instanceName != NULL) && (instanceName[i] != '\0') && (i < (sizeof(caller.name) - 1U)); i++) {
        caller.name[i] = instanceName[i];
    }
    if (fmuType != fmi2CoSimulation) {
        (void)report(&caller, "model exchange: not supported; import the FMU for co-simulation");
        return NULL;
    }
    if (fmu_accepts(fmuGUID) == 0) {
        (void)report(&caller, "guid: not that of this binary; import the whole FMU again");
        return NULL;
    }
    c = calloc(1, sizeof(component));
    if (c == NULL) {
        (void)report(&caller, "memory: none left for another instance");
        return NULL;
    }
    *c = caller;
    fmu_reset(&c->fmu);
    return c;
}

FMI2(void, fmi2FreeInstance)(fmi2Component c)
{
    free(c);
}

FMI2(fmi2Status, fmi2SetupExperiment)(fmi2Component instance, fmi2Boolean toleranceDefined, fmi2Real tolerance,
                                      fmi2Real startTime, fmi2Boolean stopTimeDefined, fmi2Real stopTime)
{
    component *c = instance;
    c->fmu.state.value[0] = startTime;
    return fmi2OK;
}

FMI2(fmi2Status, fmi2EnterInitializationMode)(fmi2Component instance)
{
    component *c = instance;
    return report(c, fmu_initialize(&c->fmu));
}

FMI2(fmi2Status, fmi2ExitInitializationMode)(fmi2Component instance)
{
    component *c = instance;
    return report(c, fmu_finish_initialization(&c->fmu));
}

FMI2(fmi2Status, fmi2Terminate)(fmi2Component instance)
{
    component *c = instance;
    c->fmu.mode = FMU_TERMINATED;
    return fmi2OK;
}

FMI2(fmi2Status, fmi2Reset)(fmi2Component instance)
{
    component *c = instance;
    fmu_reset(&c->fmu);
    return fmi2OK;
}

FMI2(fmi2Status, fmi2GetReal)(fmi2Component instance, const fmi2ValueReference vr[], size_t nvr, fmi2Real value[])
{
    component *c = instance;
    const char *message = NULL;
    for (size_t i = 0; (message == NULL) && (i < nvr); i++) {
        message = fmu_get(&c->fmu, vr[i], 0, &value[i]);
    }
    return report(c, message);
}

FMI2(fmi2Status, fmi2GetInteger)(fmi2Component instance, const fmi2ValueReference vr[], size_t nvr,
                                 fmi2Integer value[])
{
    component *c = instance;
    const char *message = NULL;
    for (size_t i = 0; (message == NULL) && (i < nvr); i++) {
        double number = 0.0;
        message = fmu_get(&c->fmu, vr[i], 1, &number);
        value[i] = (fmi2Integer)number;
    }
    return report(c, message);
}

FMI2(fmi2Status, fmi2SetReal)(fmi2Component instance, const fmi2ValueReference vr[], size_t nvr,
                              const fmi2Real value[])
{
    component *c = instance;
    const char *message = NULL;
    for (size_t i = 0; (message == NULL) && (i < nvr); i++) {
        message = fmu_set(&c->fmu, vr[i], value[i]);
    }
    return report(c, message);
}

FMI2(fmi2Status, fmi2SetRealInputDerivatives)(fmi2Component instance, const fmi2ValueReference vr[], size_t nvr,
                                              const fmi2Integer order[], const fmi2Real value[])
{
    component *c = instance;
    const char *message = NULL;
    for (size_t i = 0; (message == NULL) && (i < nvr); i++) {
        message = fmu_set_slope(&c->fmu, vr[i], order[i], value[i]);
    }
    return report(c, message);
}

FMI2(fmi2Status, fmi2DoStep)(fmi2Component instance, fmi2Real currentCommunicationPoint,
                             fmi2Real communicationStepSize, fmi2Boolean noSetFMUStatePriorToCurrentPoint)
{
    component *c = instance;
    return report(c, fmu_do_step(&c->fmu, currentCommunicationPoint, communicationStepSize));
}

FMI2(fmi2Status, fmi2GetRealStatus)(fmi2Component instance, const fmi2StatusKind s, fmi2Real *value)
{
    component *c = instance;
    if (s != fmi2LastSuccessfulTime) {
        return refuse(c);
    }
    *value = c->fmu.state.value[0];
    return fmi2OK;
}

FMI2(fmi2Status, fmi2GetBooleanStatus)(fmi2Component instance, const fmi2StatusKind s, fmi2Boolean *value)
{
    if (s != fmi2Terminated) {
        return refuse(instance);
    }
    *value = 0;
    return fmi2OK;
}

FMI2(fmi2Status, fmi2GetFMUstate)(fmi2Component instance, fmi2FMUstate *FMUstate)
{
    component *c = instance;
    return report(c, fmu_save(&c->fmu, FMUstate));
}

FMI2(fmi2Status, fmi2SetFMUstate)(fmi2Component instance, fmi2FMUstate FMUstate)
{
    component *c = instance;
    const fmu_instance *saved = FMUstate;
    if (saved == NULL) {
        return report(c, "FMUstate: expected one of this FMU, got none");
    }
    c->fmu = *saved;
    return fmi2OK;
}

FMI2(fmi2Status, fmi2FreeFMUstate)(fmi2Component instance, fmi2FMUstate *FMUstate)
{
    fmu_discard(FMUstate);
    return fmi2OK;
}

FMI2(fmi2Status, fmi2SerializedFMUstateSize)(fmi2Component instance, fmi2FMUstate FMUstate, size_t *size)
{
    *size = sizeof(fmu_instance);
    return fmi2OK;
}

FMI2(fmi2Status, fmi2SerializeFMUstate)(fmi2Component instance, fmi2FMUstate FMUstate, fmi2Byte serializedState[],
                                        size_t size)
{
    return report(instance, fmu_serialize(FMUstate, serializedState, size));
}

FMI2(fmi2Status, fmi2DeSerializeFMUstate)(fmi2Component instance, const fmi2Byte serializedState[], size_t size,
                                          fmi2FMUstate *FMUstate)
{
    return report(instance, fmu_deserialize(serializedState, size, FMUstate));
}

/* What the standard requires in every library for co-simulation, and this FMU does not have. */

#define UNUSED(name, ...) \
    FMI2(fmi2Status, name)(fmi2Component c, __VA_ARGS__) \
    { \
        return refuse(c); \
    }

UNUSED(fmi2GetBoolean, const fmi2ValueReference vr[], size_t nvr, fmi2Boolean value[])
UNUSED(fmi2GetString, const fmi2ValueReference vr[], size_t nvr, fmi2String value[])
UNUSED(fmi2SetInteger, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer value[])
UNUSED(fmi2SetBoolean, const fmi2ValueReference vr[], size_t nvr, const fmi2Boolean value[])
UNUSED(fmi2SetString, const fmi2ValueReference vr[], size_t nvr, const fmi2String value[])
UNUSED(fmi2GetDirectionalDerivative, const fmi2ValueReference unknowns[], size_t nUnknowns,
       const fmi2ValueReference knowns[], size_t nKnowns, const fmi2Real seed[], fmi2Real sensitivity[])
UNUSED(fmi2GetRealOutputDerivatives, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer order[],
       fmi2Real value[])
UNUSED(fmi2GetStatus, const fmi2StatusKind s, fmi2Status *value)
UNUSED(fmi2GetIntegerStatus, const fmi2StatusKind s, fmi2Integer *value)
UNUSED(fmi2GetStringStatus, const fmi2StatusKind s, fmi2String *value)

FMI2(fmi2Status, fmi2CancelStep)(fmi2Component c)
{
    return refuse(c);
}
