/* The observer as the model of an FMU: a step whose start is a sample time pushes the inputs as one sample. */

#include "fmu.h"

#include <math.h>

#define EARLY 1e-6 /* fraction of the sample time by which a sample may be early */

static void no_states(fmu_state *state)
{
    for (int i = FMU_FIRST_OUTPUT; i < FMU_COUNT; i++) {
        state->value[i] = (double)NAN;
    }
    state->value[FMU_STATUS] = (double)FW_INPUT_MISSING;
}

void fmu_start(fmu_state *state)
{
    fw_observer_init(&state->model.observer);
    state->model.sampled = -(double)INFINITY;
    no_states(state);
}

void fmu_outputs(fmu_state *state)
{
    (void)state; /* those of the last sample */
}

const char *fmu_step(fmu_state *state, double step)
{
    const double time = state->value[0];
    const double least = state->value[FMU_SAMPLE_TIME] * (1.0 - EARLY);
    fw_sample sample;
    fw_states states;
    fw_result result;
    (void)step;
    if ((time - state->model.sampled) < least) {
        return NULL;
    }
    sample.time = time;
    for (int i = 0; i < FW_INPUT_COUNT; i++) {
        sample.input[i] = state->value[FMU_FIRST_INPUT + i];
    }
    for (int i = 0; i < FW_MEASURED_COUNT; i++) {
        sample.measured[i] = state->value[FMU_FIRST_INPUT + FW_INPUT_COUNT + i];
    }
    result = fw_observer_push(&state->model.observer, &sample, &states);
    if (result == FW_ERROR_TIME) {
        return "time: expected after the last sample; to repeat a step, restore its state";
    }
    state->model.sampled = time;
    if (result == FW_ERROR_GAP) {
        no_states(state);
        return "speed: the model needs too many steps since the last sample; check the unit, m/s";
    }
    for (int i = 0; i < FW_STATE_COUNT; i++) {
        state->value[FMU_FIRST_OUTPUT + (2 * i)] = states.value[i];
        state->value[FMU_FIRST_OUTPUT + (2 * i) + 1] = states.sigma[i];
    }
    state->value[FMU_NIS] = states.nis;
    state->value[FMU_STATUS] = (double)states.status;
    return NULL;
}
