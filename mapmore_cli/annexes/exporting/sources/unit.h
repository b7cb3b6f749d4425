/* The part that units of FMI 2 and 3 share; this-model.h holds the properties of the model.
 *
 * Inputs are constant during a communication step. The output of a model without memory always belongs to the present inputs. A model
 * with memory takes a sample at the beginning of a step, and another one after each sample time within the step; its output is that of
 * the last sample. Before the first step, the output is what a sample would give.
 */
#ifndef UNIT_H
#define UNIT_H

#include "this-model.h"

#include <math.h>
#include <string.h>

#define GIVEN (INPUTS + MEASURED) /* inputs, and the measured output if the model starts with it */
#define OUTPUT GIVEN              /* value reference of the output; those of the inputs are their indices */
#define OUTSIDE_RANGE (GIVEN + 1)
#define TIME (GIVEN + 2) /* only in FMI 3 */
#define CLOSE 1e-6 /* largest deviation of a step, as a fraction of the sample time */

typedef enum { INSTANTIATED, INITIALIZING, STEPPING, TERMINATED } phase;

/* Everything that changes; a copy of it is a state of the unit. */
typedef struct {
    phase at;
    double given[GIVEN + 1]; /* one element more, because C has no empty arrays */
    double output;
    int bits;
    int sampled; /* 1 if the output is that of a sample */
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

/* Compute the output, and the bits of inputs outside their range. */
static void answer(values *now)
{
    if (!now->sampled) {
        model_state copy = now->model;
        now->bits = model_step(&copy, now->given, &now->output);
    }
}

/* Do a communication step, and return the reason if it is refused, otherwise NULL. */
static const char *stepped(values *now, double time, double step)
{
    if (now->at != STEPPING) return "the initialization must end before the first step";
    if (!(step > 0)) return "a communication step must be longer than zero";
#if MEMORY
    const double samples = floor(step / SAMPLE_TIME + 0.5);
    if (samples < 1 || fabs(step - samples * SAMPLE_TIME) > CLOSE * SAMPLE_TIME)
        return "communication steps must be " SAMPLE_TIME_TEXT " s, the time between the model's samples, or a multiple of it";
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
