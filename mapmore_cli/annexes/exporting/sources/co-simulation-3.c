/* The functions of FMI 3.0 for co-simulation (fmi-standard.org), declared here without the official headers; unit.h says what a step does.
 *
 * The functions have their plain names, as a shared library exports them. If FMI3_FUNCTION_PREFIX is defined, they begin with
 * it, so that the sources of several units can be linked into one program.
 */
#include "unit.h"

#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>

#if defined _WIN32 || defined __CYGWIN__
#define FMI3_EXPORT __declspec(dllexport)
#elif defined __GNUC__
#define FMI3_EXPORT __attribute__((visibility("default")))
#else
#define FMI3_EXPORT
#endif

#ifdef FMI3_FUNCTION_PREFIX
#define FMI3_JOINED(prefix, name) prefix##name
#define FMI3_NAMED(prefix, name) FMI3_JOINED(prefix, name)
#define FMI3(name) FMI3_NAMED(FMI3_FUNCTION_PREFIX, name)
#else
#define FMI3(name) name
#endif

/* Declare a function, and begin its definition. */
#define DEFINED(type, name, ...) \
    FMI3_EXPORT type FMI3(name)(__VA_ARGS__); \
    type FMI3(name)(__VA_ARGS__)

#ifdef __GNUC__
#pragma GCC diagnostic ignored "-Wunused-parameter" /* functions that only refuse a call do not use its arguments */
#endif

typedef void *fmi3Instance;
typedef void *fmi3InstanceEnvironment;
typedef void *fmi3FMUState;
typedef uint32_t fmi3ValueReference;
typedef float fmi3Float32;
typedef double fmi3Float64;
typedef int8_t fmi3Int8;
typedef uint8_t fmi3UInt8;
typedef int16_t fmi3Int16;
typedef uint16_t fmi3UInt16;
typedef int32_t fmi3Int32;
typedef uint32_t fmi3UInt32;
typedef int64_t fmi3Int64;
typedef uint64_t fmi3UInt64;
typedef bool fmi3Boolean;
typedef const char *fmi3String;
typedef uint8_t fmi3Byte;
typedef const fmi3Byte *fmi3Binary;
typedef bool fmi3Clock;

typedef enum { fmi3OK, fmi3Warning, fmi3Discard, fmi3Error, fmi3Fatal } fmi3Status;
typedef enum { fmi3Independent, fmi3Constant, fmi3Fixed, fmi3Tunable, fmi3Discrete, fmi3Dependent } fmi3DependencyKind;
typedef enum { fmi3IntervalNotYetKnown, fmi3IntervalUnchanged, fmi3IntervalChanged } fmi3IntervalQualifier;

typedef void (*fmi3LogMessageCallback)(fmi3InstanceEnvironment, fmi3Status, fmi3String category, fmi3String message);
typedef void (*fmi3ClockUpdateCallback)(fmi3InstanceEnvironment);
typedef void (*fmi3IntermediateUpdateCallback)(fmi3InstanceEnvironment, fmi3Float64, fmi3Boolean, fmi3Boolean, fmi3Boolean, fmi3Boolean,
                                               fmi3Boolean *, fmi3Float64 *);
typedef void (*fmi3PreemptionCallback)(void);

typedef struct {
    values now;
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
} instance_of_3;

static fmi3Status refused(fmi3Instance instance, fmi3String why)
{
    const instance_of_3 *one = instance;
    if (one->log) one->log(one->environment, fmi3Error, "logStatusError", why);
    return fmi3Error;
}

/* A function that this unit does not support. */
#define REFUSED(why, name, ...) \
    DEFINED(fmi3Status, name, fmi3Instance instance, __VA_ARGS__) { return refused(instance, why); }

/* The functions for a type of which this unit has no variables. */
#define NONE_OF(type) \
    DEFINED(fmi3Status, fmi3Get##type, fmi3Instance instance, const fmi3ValueReference places[], size_t count, fmi3##type found[], size_t n) \
    { return count ? refused(instance, "there is no variable of type " #type) : fmi3OK; } \
    DEFINED(fmi3Status, fmi3Set##type, fmi3Instance instance, const fmi3ValueReference places[], size_t count, const fmi3##type given[], size_t n) \
    { return count ? refused(instance, "only inputs can be set, which are Float64") : fmi3OK; }

DEFINED(const char *, fmi3GetVersion, void)
{
    return "3.0";
}

DEFINED(fmi3Status, fmi3SetDebugLogging, fmi3Instance instance, fmi3Boolean on, size_t count, const fmi3String categories[])
{
    return fmi3OK;
}

DEFINED(fmi3Instance, fmi3InstantiateCoSimulation, fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
        fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early, const fmi3ValueReference intermediate[], size_t count,
        fmi3InstanceEnvironment environment, fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update)
{
    instance_of_3 *one;
    if (!token || strcmp(token, MODEL_GUID) != 0) {
        if (log) log(environment, fmi3Error, "logStatusError", "modelDescription.xml and the binary are of different units: the token differs");
        return NULL;
    }
    one = calloc(1, sizeof *one);
    if (!one) return NULL;
    begin(&one->now);
    one->environment = environment;
    one->log = log;
    return one;
}

static fmi3Instance only_co_simulation(fmi3InstanceEnvironment environment, fmi3LogMessageCallback log)
{
    if (log) log(environment, fmi3Error, "logStatusError", "this unit is for co-simulation");
    return NULL;
}

DEFINED(fmi3Instance, fmi3InstantiateModelExchange, fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
        fmi3Boolean logging, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log)
{
    return only_co_simulation(environment, log);
}

DEFINED(fmi3Instance, fmi3InstantiateScheduledExecution, fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
        fmi3Boolean logging, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log, fmi3ClockUpdateCallback clock,
        fmi3PreemptionCallback lock, fmi3PreemptionCallback unlock)
{
    return only_co_simulation(environment, log);
}

DEFINED(void, fmi3FreeInstance, fmi3Instance instance)
{
    free(instance);
}

DEFINED(fmi3Status, fmi3EnterInitializationMode, fmi3Instance instance, fmi3Boolean has_tolerance, fmi3Float64 tolerance, fmi3Float64 start,
        fmi3Boolean has_stop, fmi3Float64 stop)
{
    values *now = &((instance_of_3 *)instance)->now;
    if (now->at != INSTANTIATED) return refused(instance, "it is initialized already: call fmi3Reset first");
    now->at = INITIALIZING;
    now->time = start;
    return fmi3OK;
}

DEFINED(fmi3Status, fmi3ExitInitializationMode, fmi3Instance instance)
{
    values *now = &((instance_of_3 *)instance)->now;
    if (now->at != INITIALIZING) return refused(instance, "fmi3EnterInitializationMode comes first");
    now->at = STEPPING;
    return fmi3OK;
}

DEFINED(fmi3Status, fmi3Terminate, fmi3Instance instance)
{
    values *now = &((instance_of_3 *)instance)->now;
    if (now->at != STEPPING) return refused(instance, "it is not initialized");
    now->at = TERMINATED;
    return fmi3OK;
}

DEFINED(fmi3Status, fmi3Reset, fmi3Instance instance)
{
    begin(&((instance_of_3 *)instance)->now);
    return fmi3OK;
}

DEFINED(fmi3Status, fmi3GetFloat64, fmi3Instance instance, const fmi3ValueReference places[], size_t count, fmi3Float64 found[], size_t n)
{
    values *now = &((instance_of_3 *)instance)->now;
    if (n != count) return refused(instance, "every variable is one number");
    for (size_t i = 0; i < count; i++) {
        if (places[i] > OUTPUT && places[i] != TIME) return refused(instance, "there is no such Float64 variable");
        if (places[i] == OUTPUT) answer(now);
        found[i] = places[i] == OUTPUT ? now->output : places[i] == TIME ? now->time : now->given[places[i]];
    }
    return fmi3OK;
}

DEFINED(fmi3Status, fmi3SetFloat64, fmi3Instance instance, const fmi3ValueReference places[], size_t count, const fmi3Float64 given[], size_t n)
{
    values *now = &((instance_of_3 *)instance)->now;
    if (n != count) return refused(instance, "every variable is one number");
    for (size_t i = 0; i < count; i++)
        if (places[i] >= GIVEN) return refused(instance, "only inputs can be set");
    for (size_t i = 0; i < count; i++) now->given[places[i]] = given[i];
    return fmi3OK;
}

DEFINED(fmi3Status, fmi3GetInt32, fmi3Instance instance, const fmi3ValueReference places[], size_t count, fmi3Int32 found[], size_t n)
{
    values *now = &((instance_of_3 *)instance)->now;
    if (n != count) return refused(instance, "every variable is one number");
    for (size_t i = 0; i < count; i++) {
        if (places[i] != OUTSIDE_RANGE) return refused(instance, "there is no such Int32 variable");
        answer(now);
        found[i] = now->bits;
    }
    return fmi3OK;
}

DEFINED(fmi3Status, fmi3SetInt32, fmi3Instance instance, const fmi3ValueReference places[], size_t count, const fmi3Int32 given[], size_t n)
{
    return count ? refused(instance, "only inputs can be set, which are Float64") : fmi3OK;
}

NONE_OF(Float32)
NONE_OF(Int8)
NONE_OF(UInt8)
NONE_OF(Int16)
NONE_OF(UInt16)
NONE_OF(UInt32)
NONE_OF(Int64)
NONE_OF(UInt64)
NONE_OF(Boolean)
NONE_OF(String)

DEFINED(fmi3Status, fmi3GetBinary, fmi3Instance instance, const fmi3ValueReference places[], size_t count, size_t sizes[], fmi3Binary found[],
        size_t n)
{
    return count ? refused(instance, "there is no binary variable") : fmi3OK;
}

DEFINED(fmi3Status, fmi3SetBinary, fmi3Instance instance, const fmi3ValueReference places[], size_t count, const size_t sizes[],
        const fmi3Binary given[], size_t n)
{
    return count ? refused(instance, "there is no binary variable") : fmi3OK;
}

DEFINED(fmi3Status, fmi3GetClock, fmi3Instance instance, const fmi3ValueReference places[], size_t count, fmi3Clock found[])
{
    return count ? refused(instance, "there is no clock") : fmi3OK;
}

DEFINED(fmi3Status, fmi3SetClock, fmi3Instance instance, const fmi3ValueReference places[], size_t count, const fmi3Clock given[])
{
    return count ? refused(instance, "there is no clock") : fmi3OK;
}

DEFINED(fmi3Status, fmi3GetFMUState, fmi3Instance instance, fmi3FMUState *state)
{
    if (!*state) *state = calloc(1, sizeof(values));
    if (!*state) return refused(instance, "there is no memory for a state");
    memcpy(*state, &((instance_of_3 *)instance)->now, sizeof(values));
    return fmi3OK;
}

DEFINED(fmi3Status, fmi3SetFMUState, fmi3Instance instance, fmi3FMUState state)
{
    if (!state) return refused(instance, "there is no state to go back to");
    memcpy(&((instance_of_3 *)instance)->now, state, sizeof(values));
    return fmi3OK;
}

DEFINED(fmi3Status, fmi3FreeFMUState, fmi3Instance instance, fmi3FMUState *state)
{
    if (state) {
        free(*state);
        *state = NULL;
    }
    return fmi3OK;
}

DEFINED(fmi3Status, fmi3SerializedFMUStateSize, fmi3Instance instance, fmi3FMUState state, size_t *size)
{
    *size = sizeof(values);
    return fmi3OK;
}

DEFINED(fmi3Status, fmi3SerializeFMUState, fmi3Instance instance, fmi3FMUState state, fmi3Byte bytes[], size_t size)
{
    if (!state || size < sizeof(values)) return refused(instance, "there is no state, or no room for it");
    memcpy(bytes, state, sizeof(values));
    return fmi3OK;
}

DEFINED(fmi3Status, fmi3DeserializeFMUState, fmi3Instance instance, const fmi3Byte bytes[], size_t size, fmi3FMUState *state)
{
    if (size != sizeof(values)) return refused(instance, "these bytes are no state of this unit");
    if (!*state) *state = calloc(1, sizeof(values));
    if (!*state) return refused(instance, "there is no memory for a state");
    memcpy(*state, bytes, sizeof(values));
    return fmi3OK;
}

DEFINED(fmi3Status, fmi3EnterStepMode, fmi3Instance instance)
{
    return ((instance_of_3 *)instance)->now.at == STEPPING ? fmi3OK : refused(instance, "it is not initialized");
}

DEFINED(fmi3Status, fmi3DoStep, fmi3Instance instance, fmi3Float64 time, fmi3Float64 step, fmi3Boolean no_way_back, fmi3Boolean *event,
        fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *reached)
{
    values *now = &((instance_of_3 *)instance)->now;
    const char *why = stepped(now, time, step);
    *event = *terminate = *early = false;
    *reached = now->time;
    return why ? refused(instance, why) : fmi3OK;
}

#define PLACES const fmi3ValueReference places[], size_t count
#define SEEDED PLACES, const fmi3ValueReference known[], size_t knowns, const fmi3Float64 seed[], size_t seeds, fmi3Float64 found[], size_t n
REFUSED("directional derivatives are not provided", fmi3GetDirectionalDerivative, SEEDED)
REFUSED("adjoint derivatives are not provided", fmi3GetAdjointDerivative, SEEDED)
REFUSED("maxOutputDerivativeOrder is 0", fmi3GetOutputDerivatives, PLACES, const fmi3Int32 orders[], fmi3Float64 found[], size_t n)
REFUSED("dependencies are in modelDescription.xml", fmi3GetNumberOfVariableDependencies, fmi3ValueReference place, size_t *count)
REFUSED("dependencies are in modelDescription.xml", fmi3GetVariableDependencies, fmi3ValueReference place, size_t elements[],
        fmi3ValueReference on[], size_t of[], fmi3DependencyKind kinds[], size_t count)
REFUSED("there is no clock", fmi3GetIntervalDecimal, PLACES, fmi3Float64 found[], fmi3IntervalQualifier qualifiers[])
REFUSED("there is no clock", fmi3GetIntervalFraction, PLACES, fmi3UInt64 counters[], fmi3UInt64 parts[], fmi3IntervalQualifier qualifiers[])
REFUSED("there is no clock", fmi3GetShiftDecimal, PLACES, fmi3Float64 found[])
REFUSED("there is no clock", fmi3GetShiftFraction, PLACES, fmi3UInt64 counters[], fmi3UInt64 parts[])
REFUSED("there is no clock", fmi3SetIntervalDecimal, PLACES, const fmi3Float64 given[])
REFUSED("there is no clock", fmi3SetIntervalFraction, PLACES, const fmi3UInt64 counters[], const fmi3UInt64 parts[])
REFUSED("there is no clock", fmi3SetShiftDecimal, PLACES, const fmi3Float64 given[])
REFUSED("there is no clock", fmi3SetShiftFraction, PLACES, const fmi3UInt64 counters[], const fmi3UInt64 parts[])
REFUSED("there is no clock", fmi3ActivateModelPartition, fmi3ValueReference clock, fmi3Float64 time)
REFUSED("hasEventMode is false", fmi3UpdateDiscreteStates, fmi3Boolean *update, fmi3Boolean *terminate, fmi3Boolean *nominals,
        fmi3Boolean *changed, fmi3Boolean *defined, fmi3Float64 *next)

#define REFUSED_ALONE(why, name) \
    DEFINED(fmi3Status, name, fmi3Instance instance) { return refused(instance, why); }
REFUSED_ALONE("hasEventMode is false", fmi3EnterEventMode)
REFUSED_ALONE("hasEventMode is false", fmi3EvaluateDiscreteStates)
REFUSED_ALONE("there are no structural parameters", fmi3EnterConfigurationMode)
REFUSED_ALONE("there are no structural parameters", fmi3ExitConfigurationMode)

/* Functions of model exchange; some tools look for these names in every unit. */
REFUSED_ALONE("this unit is for co-simulation", fmi3EnterContinuousTimeMode)
REFUSED("this unit is for co-simulation", fmi3CompletedIntegratorStep, fmi3Boolean no_way_back, fmi3Boolean *event, fmi3Boolean *terminate)
REFUSED("this unit is for co-simulation", fmi3SetTime, fmi3Float64 time)
REFUSED("this unit is for co-simulation", fmi3SetContinuousStates, const fmi3Float64 given[], size_t n)
REFUSED("this unit is for co-simulation", fmi3GetContinuousStates, fmi3Float64 found[], size_t n)
REFUSED("this unit is for co-simulation", fmi3GetContinuousStateDerivatives, fmi3Float64 found[], size_t n)
REFUSED("this unit is for co-simulation", fmi3GetEventIndicators, fmi3Float64 found[], size_t n)
REFUSED("this unit is for co-simulation", fmi3GetNominalsOfContinuousStates, fmi3Float64 found[], size_t n)
REFUSED("this unit is for co-simulation", fmi3GetNumberOfEventIndicators, size_t *n)
REFUSED("this unit is for co-simulation", fmi3GetNumberOfContinuousStates, size_t *n)
