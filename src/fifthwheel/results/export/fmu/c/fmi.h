/* What FMI 2.0 and 3.0 have in common. fmi2.c and fmi3.c include it after they have defined

   component                    an instance: fmu_instance fmu, and what reports an error
   log_error(c, message)        reports one
   FMI(name)                    a type, a constant or a function of the version: fmi2##name
   FMI_OF_STATE(before, after)  a function of the state: fmi2##before##FMUstate##after
   FMI_STATE                    the name of a state, for messages
   FMI_DESERIALIZE              the function whose spelling follows no rule
   FMI_INTEGER                  the type of an integer
   FMI_PREFIX                   goes before the names of all functions

   Instances and states are pointers to void in both versions. */

#ifndef FMI_H
#define FMI_H

#include <stdlib.h>

#if defined(__GNUC__) /* the standard passes more than this FMU uses */
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

#if defined(_WIN32)
#define FMU_EXPORT __declspec(dllexport)
#elif defined(__GNUC__)
#define FMU_EXPORT __attribute__((visibility("default")))
#else
#define FMU_EXPORT
#endif

#define FMU_JOIN_EXPANDED(prefix, name) prefix##name
#define FMU_JOIN(prefix, name) FMU_JOIN_EXPANDED(prefix, name)
#define FMI_EXPORT(type, name) FMU_EXPORT type FMU_JOIN(FMI_PREFIX, name)
#define FMI_FUNCTION(name) FMI_EXPORT(FMI(Status), name)

/* Functions that the standard requires in every library, and this FMU does not have. */
#define UNUSED(name, ...) \
    FMI_FUNCTION(name)(void *instance, __VA_ARGS__) \
    { \
        return refuse(instance); \
    }
#define UNUSED_MODE(name) \
    FMI_FUNCTION(name)(void *instance) \
    { \
        return refuse(instance); \
    }

static FMI(Status) report(const component *c, const char *message)
{
    if (message == NULL) {
        return FMI(OK);
    }
    log_error(c, message);
    return FMI(Error);
}

static FMI(Status) refuse(const void *instance)
{
    return report(instance, "this function is not part of this FMU; see modelDescription.xml for what it supports");
}

/* A new instance that reports its errors as the caller does, or NULL. */
static component *instantiated(const component *caller)
{
    component *c = calloc(1, sizeof(component));
    if (c == NULL) {
        (void)report(caller, "memory: none left for another instance");
        return NULL;
    }
    *c = *caller;
    fmu_reset(&c->fmu);
    return c;
}

static FMI(Status) get_reals(void *instance, const FMI(ValueReference) references[], size_t count, double values[])
{
    component *c = instance;
    const char *message = NULL;
    for (size_t i = 0; (message == NULL) && (i < count); i++) {
        message = fmu_get(&c->fmu, references[i], 0, &values[i]);
    }
    return report(c, message);
}

static FMI(Status) get_integers(void *instance, const FMI(ValueReference) references[], size_t count,
                                FMI_INTEGER values[])
{
    component *c = instance;
    const char *message = NULL;
    for (size_t i = 0; (message == NULL) && (i < count); i++) {
        double value = 0.0;
        message = fmu_get(&c->fmu, references[i], 1, &value);
        values[i] = (FMI_INTEGER)value;
    }
    return report(c, message);
}

static FMI(Status) set_reals(void *instance, const FMI(ValueReference) references[], size_t count,
                             const double values[])
{
    component *c = instance;
    const char *message = NULL;
    for (size_t i = 0; (message == NULL) && (i < count); i++) {
        message = fmu_set(&c->fmu, references[i], values[i]);
    }
    return report(c, message);
}

FMI_FUNCTION(FMI(SetDebugLogging))(void *instance, FMI(Boolean) loggingOn, size_t nCategories,
                                   const FMI(String) categories[])
{
    return FMI(OK); /* errors are always reported, and there is nothing else to report */
}

FMI_EXPORT(void, FMI(FreeInstance))(void *instance)
{
    free(instance);
}

FMI_FUNCTION(FMI(ExitInitializationMode))(void *instance)
{
    component *c = instance;
    return report(c, fmu_finish_initialization(&c->fmu));
}

FMI_FUNCTION(FMI(Terminate))(void *instance)
{
    component *c = instance;
    c->fmu.mode = FMU_TERMINATED;
    return FMI(OK);
}

FMI_FUNCTION(FMI(Reset))(void *instance)
{
    component *c = instance;
    fmu_reset(&c->fmu);
    return FMI(OK);
}

FMI_FUNCTION(FMI_OF_STATE(Get, ))(void *instance, void **state)
{
    component *c = instance;
    return report(c, fmu_save(&c->fmu, state));
}

FMI_FUNCTION(FMI_OF_STATE(Set, ))(void *instance, void *state)
{
    component *c = instance;
    const fmu_instance *saved = state;
    if (saved == NULL) {
        return report(c, FMI_STATE ": expected one of this FMU, got none");
    }
    c->fmu = *saved;
    return FMI(OK);
}

FMI_FUNCTION(FMI_OF_STATE(Free, ))(void *instance, void **state)
{
    fmu_discard(state);
    return FMI(OK);
}

FMI_FUNCTION(FMI_OF_STATE(Serialized, Size))(void *instance, void *state, size_t *size)
{
    *size = sizeof(fmu_instance);
    return FMI(OK);
}

FMI_FUNCTION(FMI_OF_STATE(Serialize, ))(void *instance, void *state, FMI(Byte) bytes[], size_t size)
{
    return report(instance, fmu_serialize(state, bytes, size));
}

FMI_FUNCTION(FMI_DESERIALIZE)(void *instance, const FMI(Byte) bytes[], size_t size, void **state)
{
    return report(instance, fmu_deserialize(bytes, size, state));
}

#endif
