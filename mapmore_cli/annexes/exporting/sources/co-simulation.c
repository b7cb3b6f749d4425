/* The functions of FMI 2.0 for co-simulation; unit.h says what a step does. */
#include "co-simulation.h"
#include "unit.h"

typedef struct {
    values now;
    fmi2CallbackFunctions calls;
    char name[1]; /* the memory is allocated for the whole name */
} instance;

/* Report an error. The reason is used as a format without arguments, so it must contain no per cent sign. */
static fmi2Status refused(const instance *one, fmi2String why)
{
    if (one->calls.logger) one->calls.logger(one->calls.componentEnvironment, one->name, fmi2Error, "logStatusError", why);
    return fmi2Error;
}

const char *FMI2(fmi2GetTypesPlatform)(void)
{
    return "default";
}

const char *FMI2(fmi2GetVersion)(void)
{
    return "2.0";
}

fmi2Status FMI2(fmi2SetDebugLogging)(fmi2Component c, fmi2Boolean on, size_t count, const fmi2String categories[])
{
    (void)c;
    (void)on;
    (void)count;
    (void)categories;
    return fmi2OK;
}

fmi2Component FMI2(fmi2Instantiate)(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                                   const fmi2CallbackFunctions *calls, fmi2Boolean visible, fmi2Boolean logging)
{
    instance *one;
    fmi2String why = NULL;
    (void)resources;
    (void)visible;
    (void)logging;
    if (!calls || !calls->allocateMemory || !calls->freeMemory || !name) return NULL;
    if (type != fmi2CoSimulation) why = "this unit is for co-simulation";
    if (!guid || strcmp(guid, MODEL_GUID) != 0) why = "modelDescription.xml and the binary are of different units: the guid differs";
    if (why) {
        if (calls->logger) calls->logger(calls->componentEnvironment, name, fmi2Error, "logStatusError", why);
        return NULL;
    }
    one = calls->allocateMemory(1, sizeof *one + strlen(name));
    if (!one) return NULL;
    begin(&one->now);
    one->calls = *calls;
    strcpy(one->name, name);
    return one;
}

void FMI2(fmi2FreeInstance)(fmi2Component c)
{
    instance *one = c;
    if (one) one->calls.freeMemory(one);
}

fmi2Status FMI2(fmi2SetupExperiment)(fmi2Component c, fmi2Boolean has_tolerance, fmi2Real tolerance, fmi2Real start,
                                    fmi2Boolean has_stop, fmi2Real stop)
{
    instance *one = c;
    (void)has_tolerance;
    (void)tolerance;
    (void)has_stop;
    (void)stop;
    if (one->now.at != INSTANTIATED) return refused(one, "fmi2SetupExperiment comes before the initialization");
    one->now.time = start;
    return fmi2OK;
}

fmi2Status FMI2(fmi2EnterInitializationMode)(fmi2Component c)
{
    instance *one = c;
    if (one->now.at != INSTANTIATED) return refused(one, "it is initialized already: call fmi2Reset first");
    one->now.at = INITIALIZING;
    return fmi2OK;
}

fmi2Status FMI2(fmi2ExitInitializationMode)(fmi2Component c)
{
    instance *one = c;
    if (one->now.at != INITIALIZING) return refused(one, "fmi2EnterInitializationMode comes first");
    one->now.at = STEPPING;
    return fmi2OK;
}

fmi2Status FMI2(fmi2Terminate)(fmi2Component c)
{
    instance *one = c;
    if (one->now.at != STEPPING) return refused(one, "it is not initialized");
    one->now.at = TERMINATED;
    return fmi2OK;
}

fmi2Status FMI2(fmi2Reset)(fmi2Component c)
{
    begin(&((instance *)c)->now);
    return fmi2OK;
}

fmi2Status FMI2(fmi2GetReal)(fmi2Component c, const fmi2ValueReference places[], size_t count, fmi2Real found[])
{
    instance *one = c;
    for (size_t i = 0; i < count; i++) {
        if (places[i] > OUTPUT) return refused(one, "there is no such real variable");
        if (places[i] == OUTPUT) answer(&one->now);
        found[i] = places[i] == OUTPUT ? one->now.output : one->now.given[places[i]];
    }
    return fmi2OK;
}

fmi2Status FMI2(fmi2GetInteger)(fmi2Component c, const fmi2ValueReference places[], size_t count, fmi2Integer found[])
{
    instance *one = c;
    for (size_t i = 0; i < count; i++) {
        if (places[i] != OUTSIDE_RANGE) return refused(one, "there is no such integer variable");
        answer(&one->now);
        found[i] = one->now.bits;
    }
    return fmi2OK;
}

fmi2Status FMI2(fmi2GetBoolean)(fmi2Component c, const fmi2ValueReference places[], size_t count, fmi2Boolean found[])
{
    (void)places;
    (void)found;
    return count ? refused(c, "there is no Boolean variable") : fmi2OK;
}

fmi2Status FMI2(fmi2GetString)(fmi2Component c, const fmi2ValueReference places[], size_t count, fmi2String found[])
{
    (void)places;
    (void)found;
    return count ? refused(c, "there is no string variable") : fmi2OK;
}

fmi2Status FMI2(fmi2SetReal)(fmi2Component c, const fmi2ValueReference places[], size_t count, const fmi2Real given[])
{
    instance *one = c;
    for (size_t i = 0; i < count; i++)
        if (places[i] >= GIVEN) return refused(one, "only inputs can be set");
    for (size_t i = 0; i < count; i++) one->now.given[places[i]] = given[i];
    return fmi2OK;
}

fmi2Status FMI2(fmi2SetInteger)(fmi2Component c, const fmi2ValueReference places[], size_t count, const fmi2Integer given[])
{
    (void)places;
    (void)given;
    return count ? refused(c, "only inputs can be set, which are real") : fmi2OK;
}

fmi2Status FMI2(fmi2SetBoolean)(fmi2Component c, const fmi2ValueReference places[], size_t count, const fmi2Boolean given[])
{
    (void)places;
    (void)given;
    return count ? refused(c, "only inputs can be set, which are real") : fmi2OK;
}

fmi2Status FMI2(fmi2SetString)(fmi2Component c, const fmi2ValueReference places[], size_t count, const fmi2String given[])
{
    (void)places;
    (void)given;
    return count ? refused(c, "only inputs can be set, which are real") : fmi2OK;
}

fmi2Status FMI2(fmi2GetFMUstate)(fmi2Component c, fmi2FMUstate *state)
{
    instance *one = c;
    if (!*state) *state = one->calls.allocateMemory(1, sizeof(values));
    if (!*state) return refused(one, "there is no memory for a state");
    memcpy(*state, &one->now, sizeof(values));
    return fmi2OK;
}

fmi2Status FMI2(fmi2SetFMUstate)(fmi2Component c, fmi2FMUstate state)
{
    instance *one = c;
    if (!state) return refused(one, "there is no state to go back to");
    memcpy(&one->now, state, sizeof(values));
    return fmi2OK;
}

fmi2Status FMI2(fmi2FreeFMUstate)(fmi2Component c, fmi2FMUstate *state)
{
    if (state && *state) ((instance *)c)->calls.freeMemory(*state);
    if (state) *state = NULL;
    return fmi2OK;
}

fmi2Status FMI2(fmi2SerializedFMUstateSize)(fmi2Component c, fmi2FMUstate state, size_t *size)
{
    (void)c;
    (void)state;
    *size = sizeof(values);
    return fmi2OK;
}

fmi2Status FMI2(fmi2SerializeFMUstate)(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
{
    if (!state || size < sizeof(values)) return refused(c, "there is no state, or no room for it");
    memcpy(bytes, state, sizeof(values));
    return fmi2OK;
}

fmi2Status FMI2(fmi2DeSerializeFMUstate)(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state)
{
    instance *one = c;
    if (size != sizeof(values)) return refused(one, "these bytes are no state of this unit");
    if (!*state) *state = one->calls.allocateMemory(1, sizeof(values));
    if (!*state) return refused(one, "there is no memory for a state");
    memcpy(*state, bytes, sizeof(values));
    return fmi2OK;
}

fmi2Status FMI2(fmi2GetDirectionalDerivative)(fmi2Component c, const fmi2ValueReference unknown[], size_t unknowns,
                                             const fmi2ValueReference known[], size_t knowns, const fmi2Real seed[], fmi2Real result[])
{
    (void)unknown;
    (void)unknowns;
    (void)known;
    (void)knowns;
    (void)seed;
    (void)result;
    return refused(c, "directional derivatives are not provided");
}

fmi2Status FMI2(fmi2SetRealInputDerivatives)(fmi2Component c, const fmi2ValueReference places[], size_t count, const fmi2Integer order[],
                                            const fmi2Real given[])
{
    (void)places;
    (void)order;
    (void)given;
    return count ? refused(c, "inputs are held during a step: canInterpolateInputs is false") : fmi2OK;
}

fmi2Status FMI2(fmi2GetRealOutputDerivatives)(fmi2Component c, const fmi2ValueReference places[], size_t count, const fmi2Integer order[],
                                             fmi2Real found[])
{
    (void)places;
    (void)order;
    (void)found;
    return count ? refused(c, "derivatives of outputs are not provided: maxOutputDerivativeOrder is 0") : fmi2OK;
}

fmi2Status FMI2(fmi2DoStep)(fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean no_way_back)
{
    instance *one = c;
    const char *why = stepped(&one->now, time, step);
    (void)no_way_back;
    return why ? refused(one, why) : fmi2OK;
}

fmi2Status FMI2(fmi2CancelStep)(fmi2Component c)
{
    return refused(c, "no step is under way: every step ends before fmi2DoStep returns");
}

fmi2Status FMI2(fmi2GetStatus)(fmi2Component c, const fmi2StatusKind kind, fmi2Status *found)
{
    (void)kind;
    (void)found;
    return refused(c, "no step is ever pending");
}

fmi2Status FMI2(fmi2GetRealStatus)(fmi2Component c, const fmi2StatusKind kind, fmi2Real *found)
{
    instance *one = c;
    if (kind != fmi2LastSuccessfulTime) return refused(one, "the only status that is a real number is fmi2LastSuccessfulTime");
    *found = one->now.time;
    return fmi2OK;
}

fmi2Status FMI2(fmi2GetIntegerStatus)(fmi2Component c, const fmi2StatusKind kind, fmi2Integer *found)
{
    (void)kind;
    (void)found;
    return refused(c, "no status is an integer");
}

fmi2Status FMI2(fmi2GetBooleanStatus)(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *found)
{
    instance *one = c;
    if (kind != fmi2Terminated) return refused(one, "the only status that is true or false is fmi2Terminated");
    *found = one->now.at == TERMINATED ? fmi2True : fmi2False;
    return fmi2OK;
}

fmi2Status FMI2(fmi2GetStringStatus)(fmi2Component c, const fmi2StatusKind kind, fmi2String *found)
{
    (void)kind;
    (void)found;
    return refused(c, "no step is ever pending");
}
