/* What is around the filter of an observer or a learner: plausible and held inputs, gaps, and the rows of its step.
   Included after the numbers of the vehicle. */

#ifndef FW_STREAM_H
#define FW_STREAM_H

#include "fw_step_length.h"

#define FW_MAX_STEPS 100000.0
#define FW_CLOCK_RESTART 1.0 /* s */

static void fw_stream_init(fw_stream *stream)
{
    *stream = (fw_stream){.time = -INFINITY, .accepted = -INFINITY, .back_since = INFINITY, .back_last = INFINITY};
    for (int i = 0; i < FW_INPUT_COUNT; i++) {
        stream->held[i] = (fw_real)NAN;
        stream->seen[i] = -INFINITY;
    }
}

/* Whether a value of an input agrees with the last one, measured `age` seconds ago. */
static int fw_agrees(const fw_stream *stream, int i, fw_real value, double age)
{
    const fw_real change = FW_ABS(value - stream->held[i]);
    return ((age <= FW_HOLD) && ((change <= fw_input_jump[i]) || (change <= (fw_input_rate[i] * (fw_real)age)))) ? 1 : 0;
}

/* Whether a sample must be refused because its time is not after the last one. Samples in order for FW_CLOCK_RESTART
   seconds since time went back are a new start, for which `restart` is set. */
static int fw_stream_refuses(fw_stream *stream, double time, int *restart)
{
    *restart = 0;
    if (!(time < INFINITY) || !(time > -INFINITY)) {
        return 1;
    }
    if (time > stream->time) {
        stream->back_last = INFINITY;
        return 0;
    }
    if (!(time > stream->back_last) || ((time - stream->back_last) > FW_MAX_GAP)) {
        stream->back_since = time;
    }
    stream->back_last = time;
    *restart = ((time - stream->back_since) >= FW_CLOCK_RESTART) ? 1 : 0;
    return (*restart != 0) ? 0 : 1;
}

/* Takes time and plausible inputs of a sample; a missing input is held for FW_HOLD seconds. */
static fw_status fw_stream_take(fw_stream *stream, const fw_sample *sample)
{
    fw_status status = FW_OK;
    for (int i = 0; i < FW_INPUT_COUNT; i++) {
        const fw_real value = sample->input[i];
        const double age = sample->time - stream->seen[i];
        const int agrees = fw_agrees(stream, i, value, age);
        if ((FW_ABS(value) <= fw_input_magnitude[i]) &&
            ((agrees != 0) || (age > FW_HOLD) || (stream->confirmed[i] == 0))) {
            stream->confirmed[i] = agrees;
            stream->held[i] = value;
            stream->seen[i] = sample->time;
            if (i == 0) { /* the derivative of the speed follows the signals */
                const fw_real starts = (age <= FW_MAX_GAP) ? FW_REAL(0.0) : FW_REAL(1.0);
                const fw_real speed[3] = {(age <= FW_MAX_GAP) ? (fw_real)age : FW_REAL(1.0), value, starts};
                fw_speed_rate(stream->speed_rate, speed, stream->speed_rate, &stream->held[FW_AT_SPEED_RATE]);
            }
        } else if (age > FW_HOLD) {
            status = FW_INPUT_MISSING;
        } else {
            /* the last value is held */
        }
    }
    stream->time = sample->time;
    if ((status == FW_OK) && (stream->held[0] < FW_MIN_SPEED)) {
        status = FW_TOO_SLOW;
    }
    if (status != FW_OK) {
        stream->running = 0;
    }
    return status;
}

/* Starts the state with this sample: no step leads to it. */
static void fw_stream_start(fw_stream *stream)
{
    stream->running = 1;
    fw_copy(stream->last, stream->held, FW_HELD_COUNT);
}

/* Whether the state must start with this sample, the last of which was at `previous`. */
static int fw_stream_starts(const fw_stream *stream, double previous)
{
    return ((stream->running == 0) || ((stream->time - previous) > FW_MAX_GAP)) ? 1 : 0;
}

/* Number of steps that the model needs from one sample to the next; 0 if they are too many. */
static int fw_step_count(double gap, const fw_real *ends)
{
    const fw_real first = fw_longest_step(ends[0]);
    const fw_real second = fw_longest_step(ends[FW_MODEL_INPUT_COUNT]);
    const double count = ceil(gap / (double)((first < second) ? first : second));
    if (!(count < FW_MAX_STEPS)) {
        return 0;
    }
    return (count > 1.0) ? (int)count : 1;
}

/* Writes a step of `count` between two samples to a row, without measurements; `ends` are the inputs at both samples. */
static void fw_write_step(fw_real *row, const fw_real *ends, double previous, double time, int step, int count)
{
    const int done = step - 1;
    const double first = (double)done / (double)count;
    const double last = (double)step / (double)count;
    const double begin = (done > 0) ? (previous + ((time - previous) * first)) : previous;
    const double end = (step < count) ? (previous + ((time - previous) * last)) : time;
    const double duration = end - begin;
    row[FW_ROW_DT] = (fw_real)duration;
    for (int i = 0; i < FW_MODEL_INPUT_COUNT; i++) {
        const fw_real before = ends[i];
        const fw_real after = ends[FW_MODEL_INPUT_COUNT + i];
        row[FW_ROW_INPUTS + i] = (done > 0) ? (before + ((after - before) * (fw_real)first)) : before;
        row[FW_ROW_INPUTS + FW_MODEL_INPUT_COUNT + i] =
            (step < count) ? (before + ((after - before) * (fw_real)last)) : after;
    }
    fw_fill(&row[FW_ROW_MEASURED], FW_REAL(0.0), 2 * FW_MEASURED_COUNT);
}

/* Writes the measurements of a sample to a row; returns whether there is one. */
static int fw_write_measurements(fw_real *row, const fw_sample *sample)
{
    int any = 0;
    for (int i = 0; i < FW_MEASURED_COUNT; i++) {
        const int present = (FW_ABS(sample->measured[i]) <= fw_measured_magnitude[i]) ? 1 : 0;
        row[FW_ROW_MEASURED + i] = (present != 0) ? sample->measured[i] : FW_REAL(0.0);
        row[FW_ROW_WEIGHTS + i] = (present != 0) ? FW_REAL(1.0) : FW_REAL(0.0);
        any = ((any != 0) || (present != 0)) ? 1 : 0;
    }
    return any;
}

/* Ends a sample of which a measurement was accepted, or none. */
static fw_status fw_stream_finish(fw_stream *stream, int accepted)
{
    fw_copy(stream->last, stream->held, FW_HELD_COUNT);
    if (accepted != 0) {
        stream->accepted = stream->time;
    }
    return ((stream->time - stream->accepted) > FW_COAST) ? FW_COASTING : FW_OK;
}

/* The status of a sample with that of its stream, and what the monitor found. */
static fw_status fw_judged(fw_status status, fw_real nis, fw_real settles)
{
    fw_status judged = status;
    if (nis > FW_MAX_NIS) {
        judged = FW_INCONSISTENT;
    } else if ((settles != FW_REAL(0.0)) && (status == FW_OK)) {
        judged = FW_SETTLING;
    } else {
        /* as it is */
    }
    return judged;
}

#endif
