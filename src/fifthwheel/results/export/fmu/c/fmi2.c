/* The functions of FMI 2.0 for co-simulation. FMI2_FUNCTION_PREFIX, defined for the compiler, goes before each name, so
   that several models can be linked statically. */

#include "fmi2.h"

#include "fmu.h"

typedef struct {
    fmu_instance fmu;
    const fmi2CallbackFunctions *functions; /* exist as long as the instance */
    char name[64];
} component;

static void log_error(const component *c, const char *message)
{
    if ((c->functions != NULL) && (c->functions->logger != NULL)) {
        c->functions->logger(c->functions->componentEnvironment, c->name, fmi2Error, "logStatusError", message);
    }
}

#if defined(FMI2_FUNCTION_PREFIX) && !defined(FMI2_OVERRIDE_FUNCTION_PREFIX)
#define FMI_PREFIX FMI2_FUNCTION_PREFIX
#else
#define FMI_PREFIX
#endif
#define FMI(name) fmi2##name
#define FMI_OF_STATE(before, after) fmi2##before##FMUstate##after
#define FMI_STATE "FMUstate"
#define FMI_DESERIALIZE fmi2DeSerializeFMUstate
#define FMI_INTEGER fmi2Integer
#include "fmi.h"

FMI_EXPORT(const char *, fmi2GetTypesPlatform)(void)
{
    return "default";
}

FMI_EXPORT(const char *, fmi2GetVersion)(void)
{
    return "2.0";
}

FMI_EXPORT(fmi2Component, fmi2Instantiate)(fmi2String instanceName, fmi2Type fmuType, fmi2String fmuGUID,
                                           fmi2String fmuResourceLocation, const fmi2CallbackFunctions *functions,
                                           fmi2Boolean visible, fmi2Boolean loggingOn)
{
    component caller = {.functions = functions};
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
    return instantiated(&caller);
}

FMI_FUNCTION(fmi2SetupExperiment)(fmi2Component instance, fmi2Boolean toleranceDefined, fmi2Real tolerance,
                                  fmi2Real startTime, fmi2Boolean stopTimeDefined, fmi2Real stopTime)
{
    component *c = instance;
    c->fmu.state.value[0] = startTime;
    return fmi2OK;
}

FMI_FUNCTION(fmi2EnterInitializationMode)(fmi2Component instance)
{
    component *c = instance;
    return report(c, fmu_initialize(&c->fmu));
}

FMI_FUNCTION(fmi2GetReal)(fmi2Component instance, const fmi2ValueReference vr[], size_t nvr, fmi2Real value[])
{
    return get_reals(instance, vr, nvr, value);
}

FMI_FUNCTION(fmi2GetInteger)(fmi2Component instance, const fmi2ValueReference vr[], size_t nvr,
                             fmi2Integer value[])
{
    return get_integers(instance, vr, nvr, value);
}

FMI_FUNCTION(fmi2SetReal)(fmi2Component instance, const fmi2ValueReference vr[], size_t nvr,
                          const fmi2Real value[])
{
    return set_reals(instance, vr, nvr, value);
}

FMI_FUNCTION(fmi2SetRealInputDerivatives)(fmi2Component instance, const fmi2ValueReference vr[], size_t nvr,
                                          const fmi2Integer order[], const fmi2Real value[])
{
    component *c = instance;
    const char *message = NULL;
    for (size_t i = 0; (message == NULL) && (i < nvr); i++) {
        message = fmu_set_slope(&c->fmu, vr[i], order[i], value[i]);
    }
    return report(c, message);
}

FMI_FUNCTION(fmi2DoStep)(fmi2Component instance, fmi2Real currentCommunicationPoint,
                         fmi2Real communicationStepSize, fmi2Boolean noSetFMUStatePriorToCurrentPoint)
{
    component *c = instance;
    return report(c, fmu_do_step(&c->fmu, currentCommunicationPoint, communicationStepSize));
}

FMI_FUNCTION(fmi2GetRealStatus)(fmi2Component instance, const fmi2StatusKind s, fmi2Real *value)
{
    component *c = instance;
    if (s != fmi2LastSuccessfulTime) {
        return refuse(c);
    }
    *value = c->fmu.state.value[0];
    return fmi2OK;
}

FMI_FUNCTION(fmi2GetBooleanStatus)(fmi2Component instance, const fmi2StatusKind s, fmi2Boolean *value)
{
    if (s != fmi2Terminated) {
        return refuse(instance);
    }
    *value = 0;
    return fmi2OK;
}

/* What the standard requires in every library for co-simulation, and this FMU does not have. */

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
UNUSED_MODE(fmi2CancelStep)
