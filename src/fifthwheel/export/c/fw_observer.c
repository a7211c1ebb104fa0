/* State observer of an articulated heavy vehicle. See fw_observer.h.

   The Kalman filter itself is fw_step() in fw_model.c, which is generated. This file holds what is the same for every
   vehicle: plausible and held inputs, the start of the filter, steps between samples, and statuses. */

#include "fw_observer.h"
#include "fw_model.h"
#include "fw_algebra.h"
#include "fw_step_length.h"

#include <math.h>
#include <stdbool.h>

#define FW_OUTPUTS ((2 * FW_STATE_COUNT) + (3 * FW_MEASURED_COUNT) + 2)
#define FW_ACCEPTED ((2 * FW_STATE_COUNT) + (2 * FW_MEASURED_COUNT))
#define FW_NIS (FW_OUTPUTS - 2)
#define FW_RESTART (FW_OUTPUTS - 1)
#define FW_SAMPLE (1 + (2 * FW_MODEL_INPUT_COUNT) + (2 * FW_MEASURED_COUNT))
#define FW_U FW_UNKNOWN_COUNT /* the bank of the road, and the offsets of the steer angles and accelerometers */
#define FW_MAX_STEPS 100000.0
#define FW_SHORTEST FW_REAL(0.01) /* s; the change of this time is plausible within any shorter time */

/* Starts the filter at the steady state of the inputs and of the means of the unknowns. */
static void fw_start(fw_observer *observer, const fw_real *inputs, fw_real nis, fw_real steer_sigma)
{
    fw_real a[FW_N * FW_N];
    fw_real work[FW_N * FW_N];
    fw_real b[FW_N * FW_STEER_COUNT];
    fw_real effect[FW_N]; /* of the bank of the road on the accelerations */
    fw_real x[FW_N * (1 + FW_U)]; /* steady states of the inputs, and of each unknown by its sigma */
    fw_real shift[FW_FILTER_STATES * FW_U]; /* of the first state by one sigma of each unknown */
    fw_real p[FW_L * FW_L] = {0};
    fw_real *carry = observer->carry;
    int place = FW_FILTER_STATES;
    const bool stable = inputs[0] < FW_CRITICAL_SPEED;
    fw_matrices(&inputs[0], a, b, effect);
    for (int i = 0; i < FW_N; i++) {
        fw_real *row = &x[i * (1 + FW_U)];
        for (int j = 0; j <= FW_U; j++) {
            row[j] = FW_REAL(0.0);
        }
        if (stable) {
            row[0] = -effect[i] * fw_unknown_mean[0];
            row[1] = -effect[i] * fw_unknown_sigma[0];
        }
        for (int j = 0; stable && (j < FW_STEER_COUNT); j++) {
            const fw_real gain = b[(i * FW_STEER_COUNT) + j] * fw_steer_gain[j];
            row[0] -= gain * (inputs[1 + j] - fw_unknown_mean[1 + j]);
            row[2 + j] = gain * fw_unknown_sigma[1 + j];
        }
        for (int j = 0; j < FW_N; j++) {
            work[(i * FW_N) + j] = a[(i * FW_N) + j];
        }
    }
    if (stable) {
        (void)fw_solve(FW_N, work, 1 + FW_U, x);
        (void)fw_random_steer(a, b, FW_STEER_COUNT, p);
    }
    for (int i = 0; i < FW_FILTER_STATES; i++) {
        const int unknown = i - FW_N + 1 - FW_ESTIMATES_BANK; /* 0: the bank; 1 and more: offsets */
        for (int j = 0; j < FW_U; j++) {
            const fw_real own = (unknown == j) ? fw_unknown_sigma[j] : FW_REAL(0.0);
            shift[(i * FW_U) + j] = (i < FW_N) ? x[(i * (1 + FW_U)) + 1 + j] : own;
        }
        if (i < FW_N) {
            carry[i] = x[i * (1 + FW_U)];
        } else {
            carry[i] = fw_unknown_mean[unknown];
        }
    }
    for (int j = 0; j < FW_FILTER_STATES; j++) { /* lower triangle by columns */
        for (int i = j; i < FW_FILTER_STATES; i++) {
            fw_real value = FW_REAL(0.0);
            for (int k = 1 - FW_ESTIMATES_BANK; k < FW_U; k++) {
                value += shift[(i * FW_U) + k] * shift[(j * FW_U) + k];
            }
            if (i < FW_N) {
                value += steer_sigma * steer_sigma * p[(i * FW_L) + j];
                value += (i == j) ? fw_initial_variance[i] : FW_REAL(0.0);
            }
            carry[place] = value;
            place++;
        }
    }
    for (int i = 0; (FW_ESTIMATES_BANK == 0) && (i < FW_FILTER_STATES); i++) { /* the bank is considered */
        carry[place] = shift[i * FW_U];
        place++;
    }
    carry[place] = nis;
    carry[place + 1] = FW_REAL(0.0);
    carry[place + 2] = -FW_REAL(1.0);
}

/* Takes the plausible inputs of a sample; whether every input is then at most FW_HOLD seconds old. */
static bool fw_hold_inputs(fw_observer *observer, const fw_sample *sample)
{
    bool fresh = true;
    for (int i = 0; i < FW_INPUT_COUNT; i++) {
        const fw_real value = sample->input[i];
        const double age = sample->time - observer->seen[i];
        const fw_real within = (age > (double)FW_SHORTEST) ? (fw_real)age : FW_SHORTEST;
        const bool possible = FW_ABS(value) <= fw_input_magnitude[i];
        const bool follows = FW_ABS(value - observer->held[i]) <= (fw_input_rate[i] * within);
        if (possible && (follows || !(age <= FW_HOLD))) {
            observer->held[i] = value;
            observer->seen[i] = sample->time;
#if FW_MODEL_INPUT_COUNT > FW_INPUT_COUNT
            if (i == 0) { /* the derivative of the speed follows the signals */
                const bool starts = !(age <= FW_MAX_GAP);
                const fw_real speed[3] = {
                    starts ? FW_REAL(1.0) : (fw_real)age, value, starts ? FW_REAL(1.0) : FW_REAL(0.0)};
                fw_speed_rate(observer->speed_rate, speed, observer->speed_rate, &observer->held[FW_INPUT_COUNT]);
            }
#endif
        } else if (!(age <= FW_HOLD)) {
            fresh = false;
        } else {
            /* the last value is held */
        }
    }
    return fresh;
}

/* Runs all steps between two samples but the last one, and gives its length; the inputs before it are in row. */
static fw_real fw_subdivide(fw_observer *observer, double before, double time, const fw_real *inputs, fw_real *row)
{
    const double gap = time - before;
    const fw_real first = fw_longest_step(observer->last[0]);
    const fw_real second = fw_longest_step(inputs[0]);
    const double count = ceil(gap / (double)((first < second) ? first : second));
    double last = before;
    double length;
    int steps;
    if (!(count < FW_MAX_STEPS)) {
        return FW_REAL(-1.0);
    }
    steps = (int)count;
    for (int i = 0; i < FW_MODEL_INPUT_COUNT; i++) {
        row[1 + i] = observer->last[i];
    }
    for (int step = 1; step < steps; step++) {
        fw_real out[FW_OUTPUTS];
        const double fraction = (double)step / count;
        const double now = before + (gap * fraction);
        length = now - last;
        row[0] = (fw_real)length;
        for (int i = 0; i < FW_MODEL_INPUT_COUNT; i++) {
            const fw_real change = inputs[i] - observer->last[i];
            row[1 + FW_MODEL_INPUT_COUNT + i] = observer->last[i] + (change * (fw_real)fraction);
        }
        for (int i = 1 + (2 * FW_MODEL_INPUT_COUNT); i < FW_SAMPLE; i++) {
            row[i] = FW_REAL(0.0);
        }
        fw_step(observer->carry, row, observer->carry, out);
        for (int i = 0; i < FW_MODEL_INPUT_COUNT; i++) {
            row[1 + i] = row[1 + FW_MODEL_INPUT_COUNT + i];
        }
        last = now;
    }
    length = time - last;
    return (fw_real)length;
}

void fw_observer_init(fw_observer *observer)
{
    *observer = (fw_observer){.time = -INFINITY, .accepted = -INFINITY};
    for (int i = 0; i < FW_INPUT_COUNT; i++) {
        observer->held[i] = (fw_real)NAN;
        observer->seen[i] = -INFINITY;
    }
}

fw_result fw_observer_push(fw_observer *observer, const fw_sample *sample, fw_states *states)
{
    const double time = sample->time;
    const double previous = observer->time;
    fw_real row[FW_SAMPLE];
    fw_real out[FW_OUTPUTS];
    fw_real inputs[FW_MODEL_INPUT_COUNT];
    bool fresh;
    bool accepted = false;
    if (!(time > previous) || !(time < INFINITY)) {
        return FW_ERROR_TIME;
    }
    fresh = fw_hold_inputs(observer, sample);
    observer->time = time;
    for (int i = 0; i < FW_MODEL_INPUT_COUNT; i++) {
        inputs[i] = observer->held[i];
    }
    states->time = time;
    states->status = FW_OK;
    if (!fresh) {
        states->status = FW_INPUT_MISSING;
    } else if (inputs[0] < FW_MIN_SPEED) {
        states->status = FW_TOO_SLOW;
    } else {
        /* the states can be estimated */
    }
    if (states->status != FW_OK) {
        observer->running = 0;
        states->nis = (fw_real)NAN;
        for (int i = 0; i < FW_STATE_COUNT; i++) {
            states->value[i] = (fw_real)NAN;
            states->sigma[i] = (fw_real)NAN;
        }
        return FW_SUCCESS;
    }
    if ((observer->running == 0) || ((time - previous) > FW_MAX_GAP)) {
        fw_start(observer, inputs, FW_REAL(1.0), FW_TYPICAL_STEER_SIGMA);
        observer->running = 1;
        observer->accepted = time;
        row[0] = FW_REAL(0.0);
        for (int i = 0; i < FW_MODEL_INPUT_COUNT; i++) {
            row[1 + i] = inputs[i];
        }
    } else {
        row[0] = fw_subdivide(observer, previous, time, inputs, row);
        if (row[0] < FW_REAL(0.0)) {
            observer->running = 0;
            return FW_ERROR_GAP;
        }
    }
    for (int i = 0; i < FW_MODEL_INPUT_COUNT; i++) {
        row[1 + FW_MODEL_INPUT_COUNT + i] = inputs[i];
    }
    for (int i = 0; i < FW_MEASURED_COUNT; i++) {
        const fw_real value = sample->measured[i];
        const bool present = FW_ABS(value) <= fw_measured_magnitude[i];
        row[1 + (2 * FW_MODEL_INPUT_COUNT) + i] = present ? value : FW_REAL(0.0);
        row[1 + (2 * FW_MODEL_INPUT_COUNT) + FW_MEASURED_COUNT + i] = present ? FW_REAL(1.0) : FW_REAL(0.0);
    }
    fw_step(observer->carry, row, observer->carry, out);
    if (out[FW_RESTART] != FW_REAL(0.0)) { /* the measurements contradict the state */
        fw_start(observer, inputs, out[FW_NIS], FW_SUSPECT_STEER_SIGMA);
        row[0] = FW_REAL(0.0);
        for (int i = 0; i < FW_MODEL_INPUT_COUNT; i++) {
            row[1 + i] = inputs[i];
        }
        fw_step(observer->carry, row, observer->carry, out);
    }
    for (int i = 0; i < FW_MODEL_INPUT_COUNT; i++) {
        observer->last[i] = inputs[i];
    }
    for (int i = 0; i < FW_MEASURED_COUNT; i++) {
        accepted = accepted || (out[FW_ACCEPTED + i] != FW_REAL(0.0));
    }
    if (accepted) {
        observer->accepted = time;
    } else if ((time - observer->accepted) > FW_COAST) {
        states->status = FW_COASTING;
    } else {
        /* no measurement for a short time */
    }
    if (out[FW_NIS] > FW_MAX_NIS) {
        states->status = FW_INCONSISTENT;
    }
    states->nis = out[FW_NIS];
    for (int i = 0; i < FW_STATE_COUNT; i++) {
        const fw_real variance = out[FW_STATE_COUNT + i];
        states->value[i] = out[i];
        states->sigma[i] = FW_SQRT((variance > FW_REAL(0.0)) ? variance : FW_REAL(0.0));
    }
    return FW_SUCCESS;
}
