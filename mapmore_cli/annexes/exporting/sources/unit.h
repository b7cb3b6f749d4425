/* What units of FMI 2 and 3 have in common around a model in C; this-model.h says which one.
 *
 * Inputs are held during a communication step. A model without memory answers to its present inputs at any time. A model with
 * memory takes a sample at the beginning of a step, and another one whenever its sample time has gone by within the step; its output
 * is that of the last sample. Before the first step it is what a sample would give.
 */
#ifndef UNIT_H
#define UNIT_H

#include "this-model.h"

#include <math.h>
#include <string.h>

#define GIVEN (INPUTS + MEASURED) /* inputs, and the measured output where the model goes on from that */
#define OUTPUT GIVEN              /* value reference of the output; of the inputs they are their places */
#define OUTSIDE_RANGE (GIVEN + 1)
#define TIME (GIVEN + 2) /* of FMI 3 */
#define CLOSE 1e-6 /* of a sample time: what steps may differ by */

typedef enum { INSTANTIATED, INITIALIZING, STEPPING, TERMINATED } phase;

/* All that changes; a copy of it is a state of the unit. */
typedef struct {
    phase at;
    double given[GIVEN + 1]; /* one more, as C has no empty arrays */
    double output;
    int bits;
    int sampled; /* whether the output is that of a sample */
    double time;
    model_state model;
} values;

static void begin(values *now)
{
    memset(now, 0, sizeof *now);
    now->at = INSTANTIATED;
    memcpy(now->given, model_start, GIVEN * sizeof *now->given);
    model_reset(&now->model);
}

/* The output, and the bits of inputs outside of their range. */
static void answer(values *now)
{
    if (!now->sampled) {
        model_state copy = now->model;
        now->bits = model_step(&copy, now->given, &now->output);
    }
}

/* Takes a communication step; why it is refused, or nothing. */
static const char *stepped(values *now, double time, double step)
{
    if (now->at != STEPPING) return "the initialization has to end before the first step";
    if (!(step > 0)) return "a communication step takes some time";
#if MEMORY
    const double samples = floor(step / SAMPLE_TIME + 0.5);
    if (samples < 1 || fabs(step - samples * SAMPLE_TIME) > CLOSE * SAMPLE_TIME)
        return "communication steps have to be " SAMPLE_TIME_TEXT " s, the time between the model's samples, or a multiple of it";
    for (double i = 0; i < samples; i++) {
        now->bits = model_step(&now->model, now->given, &now->output);
        if (isnan(now->output)) model_measured(&now->model, now->given);
    }
    now->sampled = 1;
#endif
    now->time = time + step;
    return NULL;
}

#endif
