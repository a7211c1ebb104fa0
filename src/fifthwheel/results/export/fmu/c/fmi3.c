/* The functions of FMI 3.0 for co-simulation. FMI3_FUNCTION_PREFIX, defined for the compiler, goes before each name, so
   that several models can be linked statically. */

#include "fmi3.h"

#include "fmu.h"

typedef struct {
    fmu_instance fmu;
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
} component;

static void log_error(const component *c, const char *message)
{
    if (c->log != NULL) {
        c->log(c->environment, fmi3Error, "logStatusError", message);
    }
}

#if defined(FMI3_FUNCTION_PREFIX) && !defined(FMI3_OVERRIDE_FUNCTION_PREFIX)
#define FMI_PREFIX FMI3_FUNCTION_PREFIX
#else
#define FMI_PREFIX
#endif
#define FMI(name) fmi3##name
#define FMI_OF_STATE(before, after) fmi3##before##FMUState##after
#define FMI_STATE "FMUState"
#define FMI_DESERIALIZE fmi3DeserializeFMUState
#define FMI_INTEGER fmi3Int32
#include "fmi.h"

#define MISMATCH "values: expected one for each value reference"

FMI_EXPORT(const char *, fmi3GetVersion)(void)
{
    return "3.0";
}

FMI_EXPORT(fmi3Instance, fmi3InstantiateCoSimulation)(
    fmi3String instanceName, fmi3String instantiationToken, fmi3String resourcePath, fmi3Boolean visible,
    fmi3Boolean loggingOn, fmi3Boolean eventModeUsed, fmi3Boolean earlyReturnAllowed,
    const fmi3ValueReference requiredIntermediateVariables[], size_t nRequiredIntermediateVariables,
    fmi3InstanceEnvironment instanceEnvironment, fmi3LogMessageCallback logMessage,
    fmi3IntermediateUpdateCallback intermediateUpdate)
{
    const component caller = {.environment = instanceEnvironment, .log = logMessage};
    if (fmu_accepts(instantiationToken) == 0) {
        (void)report(&caller, "instantiationToken: not that of this binary; import the whole FMU again");
        return NULL;
    }
    if (nRequiredIntermediateVariables > 0U) {
        (void)report(&caller, "requiredIntermediateVariables: expected none; this FMU has no intermediate update");
        return NULL;
    }
    return instantiated(&caller);
}

FMI_FUNCTION(fmi3EnterInitializationMode)(fmi3Instance instance, fmi3Boolean toleranceDefined,
                                          fmi3Float64 tolerance, fmi3Float64 startTime,
                                          fmi3Boolean stopTimeDefined, fmi3Float64 stopTime)
{
    component *c = instance;
    c->fmu.state.value[0] = startTime;
    return report(c, fmu_initialize(&c->fmu));
}

FMI_FUNCTION(fmi3GetFloat64)(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                             size_t nValueReferences, fmi3Float64 values[], size_t nValues)
{
    return (nValues == nValueReferences) ? get_reals(instance, valueReferences, nValueReferences, values)
                                         : report(instance, MISMATCH);
}

FMI_FUNCTION(fmi3GetInt32)(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                           size_t nValueReferences, fmi3Int32 values[], size_t nValues)
{
    return (nValues == nValueReferences) ? get_integers(instance, valueReferences, nValueReferences, values)
                                         : report(instance, MISMATCH);
}

FMI_FUNCTION(fmi3SetFloat64)(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                             size_t nValueReferences, const fmi3Float64 values[], size_t nValues)
{
    return (nValues == nValueReferences) ? set_reals(instance, valueReferences, nValueReferences, values)
                                         : report(instance, MISMATCH);
}

FMI_FUNCTION(fmi3DoStep)(fmi3Instance instance, fmi3Float64 currentCommunicationPoint,
                         fmi3Float64 communicationStepSize, fmi3Boolean noSetFMUStatePriorToCurrentPoint,
                         fmi3Boolean *eventHandlingNeeded, fmi3Boolean *terminateSimulation,
                         fmi3Boolean *earlyReturn, fmi3Float64 *lastSuccessfulTime)
{
    component *c = instance;
    const char *message = fmu_do_step(&c->fmu, currentCommunicationPoint, communicationStepSize);
    *eventHandlingNeeded = false;
    *terminateSimulation = false;
    *earlyReturn = false;
    *lastSuccessfulTime = c->fmu.state.value[0];
    return report(c, message);
}

/* What the standard requires in every library, and this FMU does not have. */

#define NO_SET(type) \
    UNUSED(fmi3Set##type, const fmi3ValueReference r[], size_t n, const fmi3##type values[], size_t m)
#define NO_VARIABLES(type) \
    UNUSED(fmi3Get##type, const fmi3ValueReference r[], size_t n, fmi3##type values[], size_t m) \
    NO_SET(type)

FMI_EXPORT(fmi3Instance, fmi3InstantiateModelExchange)(
    fmi3String instanceName, fmi3String instantiationToken, fmi3String resourcePath, fmi3Boolean visible,
    fmi3Boolean loggingOn, fmi3InstanceEnvironment instanceEnvironment, fmi3LogMessageCallback logMessage)
{
    const component caller = {.environment = instanceEnvironment, .log = logMessage};
    (void)report(&caller, "model exchange: not supported; import the FMU for co-simulation");
    return NULL;
}

FMI_EXPORT(fmi3Instance, fmi3InstantiateScheduledExecution)(
    fmi3String instanceName, fmi3String instantiationToken, fmi3String resourcePath, fmi3Boolean visible,
    fmi3Boolean loggingOn, fmi3InstanceEnvironment instanceEnvironment, fmi3LogMessageCallback logMessage,
    fmi3ClockUpdateCallback clockUpdate, fmi3LockPreemptionCallback lockPreemption,
    fmi3UnlockPreemptionCallback unlockPreemption)
{
    const component caller = {.environment = instanceEnvironment, .log = logMessage};
    (void)report(&caller, "scheduled execution: not supported; import the FMU for co-simulation");
    return NULL;
}

NO_VARIABLES(Float32)
NO_VARIABLES(Int8)
NO_VARIABLES(UInt8)
NO_VARIABLES(Int16)
NO_VARIABLES(UInt16)
NO_VARIABLES(UInt32)
NO_VARIABLES(Int64)
NO_VARIABLES(UInt64)
NO_VARIABLES(Boolean)
NO_VARIABLES(String)
UNUSED(fmi3GetBinary, const fmi3ValueReference r[], size_t n, size_t sizes[], fmi3Binary values[], size_t m)
UNUSED(fmi3GetClock, const fmi3ValueReference r[], size_t n, fmi3Clock values[])
NO_SET(Int32)
UNUSED(fmi3SetBinary, const fmi3ValueReference r[], size_t n, const size_t sizes[], const fmi3Binary values[], size_t m)
UNUSED(fmi3SetClock, const fmi3ValueReference r[], size_t n, const fmi3Clock values[])
UNUSED(fmi3GetNumberOfVariableDependencies, fmi3ValueReference r, size_t *count)
UNUSED(fmi3GetVariableDependencies, fmi3ValueReference dependent, size_t elements[], fmi3ValueReference independents[],
       size_t others[], fmi3DependencyKind kinds[], size_t count)
UNUSED(fmi3GetDirectionalDerivative, const fmi3ValueReference unknowns[], size_t n, const fmi3ValueReference knowns[],
       size_t k, const fmi3Float64 seed[], size_t s, fmi3Float64 sensitivity[], size_t m)
UNUSED(fmi3GetAdjointDerivative, const fmi3ValueReference unknowns[], size_t n, const fmi3ValueReference knowns[],
       size_t k, const fmi3Float64 seed[], size_t s, fmi3Float64 sensitivity[], size_t m)
UNUSED(fmi3GetOutputDerivatives, const fmi3ValueReference r[], size_t n, const fmi3Int32 orders[], fmi3Float64 values[],
       size_t m)
UNUSED(fmi3GetIntervalDecimal, const fmi3ValueReference r[], size_t n, fmi3Float64 intervals[],
       fmi3IntervalQualifier qualifiers[])
UNUSED(fmi3GetIntervalFraction, const fmi3ValueReference r[], size_t n, fmi3UInt64 counters[], fmi3UInt64 resolutions[],
       fmi3IntervalQualifier qualifiers[])
UNUSED(fmi3GetShiftDecimal, const fmi3ValueReference r[], size_t n, fmi3Float64 shifts[])
UNUSED(fmi3GetShiftFraction, const fmi3ValueReference r[], size_t n, fmi3UInt64 counters[], fmi3UInt64 resolutions[])
UNUSED(fmi3SetIntervalDecimal, const fmi3ValueReference r[], size_t n, const fmi3Float64 intervals[])
UNUSED(fmi3SetIntervalFraction, const fmi3ValueReference r[], size_t n, const fmi3UInt64 counters[],
       const fmi3UInt64 resolutions[])
UNUSED(fmi3SetShiftDecimal, const fmi3ValueReference r[], size_t n, const fmi3Float64 shifts[])
UNUSED(fmi3SetShiftFraction, const fmi3ValueReference r[], size_t n, const fmi3UInt64 counters[],
       const fmi3UInt64 resolutions[])
UNUSED_MODE(fmi3EvaluateDiscreteStates)
UNUSED(fmi3UpdateDiscreteStates, fmi3Boolean *again, fmi3Boolean *terminate, fmi3Boolean *nominals, fmi3Boolean *states,
       fmi3Boolean *defined, fmi3Float64 *next)
UNUSED_MODE(fmi3EnterEventMode)
UNUSED_MODE(fmi3EnterStepMode)
UNUSED_MODE(fmi3EnterConfigurationMode)
UNUSED_MODE(fmi3ExitConfigurationMode)
UNUSED_MODE(fmi3EnterContinuousTimeMode)
UNUSED(fmi3CompletedIntegratorStep, fmi3Boolean noSet, fmi3Boolean *enterEventMode, fmi3Boolean *terminate)
UNUSED(fmi3SetTime, fmi3Float64 time)
UNUSED(fmi3SetContinuousStates, const fmi3Float64 states[], size_t n)
UNUSED(fmi3GetContinuousStateDerivatives, fmi3Float64 derivatives[], size_t n)
UNUSED(fmi3GetEventIndicators, fmi3Float64 indicators[], size_t n)
UNUSED(fmi3GetContinuousStates, fmi3Float64 states[], size_t n)
UNUSED(fmi3GetNominalsOfContinuousStates, fmi3Float64 nominals[], size_t n)
UNUSED(fmi3GetNumberOfEventIndicators, size_t *count)
UNUSED(fmi3GetNumberOfContinuousStates, size_t *count)
UNUSED(fmi3ActivateModelPartition, fmi3ValueReference clock, fmi3Float64 time)
