/* Runs a functional mock-up unit of FMI 3 as a simulation tool does, along the rows on stdin, which hold its inputs, and the
 * measured output if it needs it.
 */
#include "co-simulation-3.c"

#include <stdio.h>

#if MEMORY
#define SECONDS SAMPLE_TIME
#else
#define SECONDS 1.0
#endif

int main(void)
{
    const fmi3Instance c = FMI3(fmi3InstantiateCoSimulation)("verify", MODEL_GUID, "", false, false, false, false, NULL, 0, NULL, NULL, NULL);
    FMI3(fmi3EnterInitializationMode)(c, false, 0, 0, false, 0);
    FMI3(fmi3ExitInitializationMode)(c);
    for (int i = 0;; i++) {
        fmi3ValueReference place = 0;
        double value;
        fmi3Int32 bits;
        bool event, terminate, early;
        for (; place < INPUTS + MEASURED; place++) {
            if (scanf("%lf", &value) != 1) return 0;
            FMI3(fmi3SetFloat64)(c, &place, 1, &value, 1);
        }
        FMI3(fmi3DoStep)(c, i * SECONDS, SECONDS, true, &event, &terminate, &early, &value);
        FMI3(fmi3GetFloat64)(c, &place, 1, &value, 1);
        place++;
        FMI3(fmi3GetInt32)(c, &place, 1, &bits, 1);
        printf("%.17g %d\n", value, (int)bits);
        if (INPUTS + MEASURED == 0) return 0;
    }
}
