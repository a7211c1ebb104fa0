/* State observer of an articulated heavy vehicle. See fw_observer.h.

   The Kalman filter itself is fw_step() in fw_model.c, which is generated. This file holds what is the same for every
   vehicle: the start of the filter, and statuses; fw_stream.h the inputs and the steps between samples. */

#include "fw_observer.h"
#include "fw_model.h"
#include "fw_algebra.h"
#include "fw_stream.h"

#define FW_OUTPUTS ((2 * FW_STATE_COUNT) + (3 * FW_MEASURED_COUNT) + 3)
#define FW_ACCEPTED ((2 * FW_STATE_COUNT) + (2 * FW_MEASURED_COUNT))
#define FW_SETTLES (FW_OUTPUTS - 3)
#define FW_NIS (FW_OUTPUTS - 2)
#define FW_RESTART (FW_OUTPUTS - 1)
#define FW_U FW_UNKNOWN_COUNT /* the bank of the road, and the offsets of the steer angles and accelerometers */

/* Starts the filter at the steady state of the inputs and of the means of the unknowns. */
static void fw_start(fw_observer *observer, fw_real nis, fw_real steer_sigma)
{
    const fw_real *const inputs = observer->stream.held;
    fw_real a[FW_N * FW_N];
    fw_real work[FW_N * FW_N];
    fw_real b[FW_N * FW_STEER_COUNT];
    fw_real effect[FW_N]; /* of the bank of the road on the accelerations */
    fw_real steer[FW_STEER_COUNT]; /* angles of the wheels */
    fw_real slope[FW_STEER_COUNT]; /* their derivatives with respect to the measured angles */
    fw_real x[FW_N * (1 + FW_U)]; /* steady states of the inputs, and of each unknown by its sigma */
    fw_real shift[FW_FILTER_STATES * FW_U]; /* of the first state by one sigma of each unknown */
    fw_real p[FW_L * FW_L] = {0};
    fw_real *carry = observer->carry;
    int place = FW_FILTER_STATES;
    const int stable = (inputs[0] < FW_CRITICAL_SPEED) ? 1 : 0;
    fw_stream_start(&observer->stream);
    fw_matrices(inputs, a, b, effect, steer, slope);
    for (int i = 0; i < FW_N; i++) {
        fw_real *row = &x[i * (1 + FW_U)];
        fw_fill(row, FW_REAL(0.0), 1 + FW_U);
        if (stable != 0) {
            row[0] = -effect[i] * fw_unknown_mean[0];
            row[1] = -effect[i] * fw_unknown_sigma[0];
        }
        for (int j = 0; (stable != 0) && (j < FW_STEER_COUNT); j++) {
            row[0] -= b[(i * FW_STEER_COUNT) + j] * steer[j];
            row[2 + j] = b[(i * FW_STEER_COUNT) + j] * slope[j] * fw_unknown_sigma[1 + j];
        }
    }
    fw_copy(work, a, FW_N * FW_N);
    if (stable != 0) {
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
    carry[place + 3] = FW_REAL(0.0);
}

/* Runs all steps from the last sample to this one; returns 0 if they are too many. */
static int fw_advance(fw_observer *observer, const fw_sample *sample, double previous, fw_real *out)
{
    fw_real row[FW_ROW_WEIGHTS + FW_MEASURED_COUNT];
    fw_real ends[2 * FW_MODEL_INPUT_COUNT];
    int count;
    fw_copy(ends, observer->stream.last, FW_MODEL_INPUT_COUNT);
    fw_copy(&ends[FW_MODEL_INPUT_COUNT], observer->stream.held, FW_MODEL_INPUT_COUNT);
    count = fw_step_count(sample->time - previous, ends);
    for (int step = 1; step <= count; step++) {
        fw_write_step(row, ends, previous, sample->time, step, count);
        if (step == count) {
            (void)fw_write_measurements(row, sample);
        }
        fw_step(observer->carry, row, observer->carry, out);
    }
    return count;
}

void fw_observer_init(fw_observer *observer)
{
    *observer = (fw_observer){.stream = {.running = 0}};
    fw_stream_init(&observer->stream);
}

fw_result fw_observer_push(fw_observer *observer, const fw_sample *sample, fw_states *states)
{
    double previous = observer->stream.time;
    fw_real out[FW_OUTPUTS];
    int accepted = 0;
    int restart;
    if (fw_stream_refuses(&observer->stream, sample->time, &restart) != 0) {
        return FW_ERROR_TIME;
    }
    if (restart != 0) {
        fw_stream_init(&observer->stream);
        previous = -INFINITY;
    }
    states->time = sample->time;
    states->status = fw_stream_take(&observer->stream, sample);
    if (states->status != FW_OK) {
        states->nis = (fw_real)NAN;
        fw_fill(states->value, (fw_real)NAN, FW_STATE_COUNT);
        fw_fill(states->sigma, (fw_real)NAN, FW_STATE_COUNT);
        return FW_SUCCESS;
    }
    if (fw_stream_starts(&observer->stream, previous) != 0) {
        fw_start(observer, FW_REAL(1.0), FW_TYPICAL_STEER_SIGMA);
        observer->stream.accepted = sample->time;
        previous = sample->time;
    }
    if (fw_advance(observer, sample, previous, out) == 0) {
        observer->stream.running = 0;
        return FW_ERROR_GAP;
    }
    if (out[FW_RESTART] != FW_REAL(0.0)) { /* the measurements contradict the state */
        fw_start(observer, out[FW_NIS], FW_SUSPECT_STEER_SIGMA);
        (void)fw_advance(observer, sample, sample->time, out);
    }
    for (int i = 0; i < FW_MEASURED_COUNT; i++) {
        accepted = ((accepted != 0) || (out[FW_ACCEPTED + i] != FW_REAL(0.0))) ? 1 : 0;
    }
    states->status = fw_judged(fw_stream_finish(&observer->stream, accepted), out[FW_NIS], out[FW_SETTLES]);
    states->nis = out[FW_NIS];
    fw_copy(states->value, out, FW_STATE_COUNT);
    fw_copy(states->sigma, &out[FW_STATE_COUNT], FW_STATE_COUNT);
    return FW_SUCCESS;
}
