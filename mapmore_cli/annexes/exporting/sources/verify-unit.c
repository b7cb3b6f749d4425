/* Runs a functional mock-up unit as a simulation tool does, along the rows on stdin, which hold its inputs, and the measured output if it needs it. */
#include "co-simulation.h"
#include "this-model.h"

#include <stdio.h>
#include <stdlib.h>

#if MEMORY
#define SECONDS SAMPLE_TIME
#else
#define SECONDS 1.0
#endif

int main(void)
{
    const fmi2CallbackFunctions calls = {NULL, calloc, free, NULL, NULL};
    const fmi2Component c = FMI2(fmi2Instantiate)("verify", fmi2CoSimulation, MODEL_GUID, "", &calls, fmi2False, fmi2False);
    FMI2(fmi2SetupExperiment)(c, fmi2False, 0, 0, fmi2False, 0);
    FMI2(fmi2EnterInitializationMode)(c);
    FMI2(fmi2ExitInitializationMode)(c);
    for (int i = 0;; i++) {
        fmi2ValueReference place = 0;
        double value;
        int bits;
        for (; place < INPUTS + MEASURED; place++) {
            if (scanf("%lf", &value) != 1) return 0;
            FMI2(fmi2SetReal)(c, &place, 1, &value);
        }
        FMI2(fmi2DoStep)(c, i * SECONDS, SECONDS, fmi2True);
        FMI2(fmi2GetReal)(c, &place, 1, &value);
        place++;
        FMI2(fmi2GetInteger)(c, &place, 1, &bits);
        printf("%.17g %d\n", value, bits);
        if (INPUTS + MEASURED == 0) return 0;
    }
}
