/* Runs a functional mock-up unit as a tool does, along the rows of a table: its inputs, and the measured output where it takes that. */
#include "co-simulation.h"
#include "this-model.h"

#include <stdlib.h>

#if MEMORY
#define SECONDS SAMPLE_TIME
#else
#define SECONDS 1.0
#endif

FMI2_EXPORT void verify(const double *rows, int n, double *out, int *bits)
{
    const fmi2CallbackFunctions calls = {NULL, calloc, free, NULL, NULL};
    const fmi2Component c = FMI2(fmi2Instantiate)("verify", fmi2CoSimulation, MODEL_GUID, "", &calls, fmi2False, fmi2False);
    FMI2(fmi2SetupExperiment)(c, fmi2False, 0, 0, fmi2False, 0);
    FMI2(fmi2EnterInitializationMode)(c);
    FMI2(fmi2ExitInitializationMode)(c);
    for (int i = 0; i < n; i++) {
        fmi2ValueReference place = 0;
        for (; place < INPUTS + MEASURED; place++) FMI2(fmi2SetReal)(c, &place, 1, rows + i * (INPUTS + MEASURED) + place);
        FMI2(fmi2DoStep)(c, i * SECONDS, SECONDS, fmi2True);
        FMI2(fmi2GetReal)(c, &place, 1, out + i);
        place++;
        FMI2(fmi2GetInteger)(c, &place, 1, bits + i);
    }
    FMI2(fmi2FreeInstance)(c);
}
