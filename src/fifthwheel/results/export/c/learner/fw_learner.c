/* One sample of the learner: steps of the filter, innovations and statuses. See fw_learner.h. */

#include "fw_private.h"
#include "fw_stream.h"

enum { FW_FOUND_SETTLES, FW_FOUND_NIS, FW_FOUND_RESTART, FW_FOUND_COUNT }; /* of fw_health() */

/* Inputs of the model at both ends of a step: speed and steer angles, contacts of their plays, and all rates. */
static void fw_steer(fw_learner *learner, fw_real gap, fw_real *ends)
{
    const fw_real *const last = learner->stream.last;
    const fw_real *const inputs = learner->stream.held;
    fw_real *const before = ends;
    fw_real *const after = &ends[FW_MODEL_INPUT_COUNT];
    const fw_real duration = (gap > FW_REAL(1e-3)) ? gap : FW_REAL(1e-3);
    before[0] = last[0];
    after[0] = inputs[0];
    before[FW_MODEL_INPUT_COUNT - 1] = last[FW_AT_SPEED_RATE];
    after[FW_MODEL_INPUT_COUNT - 1] = inputs[FW_AT_SPEED_RATE];
    for (int i = 0; i < FW_STEER_COUNT; i++) {
        const fw_real change = inputs[1 + i] - last[1 + i];
        const int place = fw_play[i];
        fw_real contact = learner->contact[i];
        before[1 + i] = last[1 + i];
        after[1 + i] = inputs[1 + i];
        before[1 + FW_STEER_COUNT + i] = contact;
        if (place >= 0) {
            const fw_real play = fw_scale[place] * learner->first[FW_AT_Z + place];
            contact += change / ((play > FW_SMALLEST_PLAY) ? play : FW_SMALLEST_PLAY);
            contact = (contact > FW_REAL(-0.5)) ? contact : FW_REAL(-0.5);
            contact = (contact < FW_REAL(0.5)) ? contact : FW_REAL(0.5);
        }
        after[1 + FW_STEER_COUNT + i] = contact;
        learner->contact[i] = contact;
        before[1 + (2 * FW_STEER_COUNT) + i] = change / duration;
        after[1 + (2 * FW_STEER_COUNT) + i] = change / duration;
    }
}

/* Starts the state at the steady state of the inputs, and its health with a NIS. */
static void fw_start(fw_learner *learner, fw_real nis)
{
    learner->health[0] = nis;
    learner->health[1] = FW_REAL(0.0);
    learner->health[2] = -FW_REAL(1.0);
    learner->health[3] = FW_REAL(0.0);
    (void)fw_end_segment(learner);
    fw_start_state(learner->first, learner->stream.held);
    fw_stream_start(&learner->stream);
    fw_restart_excitation(learner);
    learner->start_time = learner->stream.time;
    if (learner->dropout > learner->start_time) { /* the clock was set back */
        learner->dropout = learner->start_time;
    }
    learner->stream.accepted = learner->stream.time;
    learner->learning = 0;
}

/* Mean square and autocorrelation of the innovations of a sample from which it learned. */
static void fw_watch_innovations(fw_learner *learner, fw_real dt, const fw_real *row, const fw_update *update)
{
    const fw_real fraction = dt / (FW_INNOVATION_WINDOW + dt);
    const fw_real slow = dt / (FW_AUTOCORRELATION_WINDOW + dt);
    const fw_real weight = dt / (FW_AVERAGING_TIME + dt);
    const fw_real expected = weight / (FW_REAL(2.0) - weight); /* variance of the average of white innovations */
    for (int i = 0; (i < FW_MEASURED_COUNT) && (dt > FW_REAL(0.0)); i++) {
        if (row[FW_ROW_WEIGHTS + i] != FW_REAL(0.0)) {
            fw_real value = update->innovation[i];
            value = (value > -FW_MAX_INNOVATION) ? value : -FW_MAX_INNOVATION;
            value = (value < FW_MAX_INNOVATION) ? value : FW_MAX_INNOVATION;
            learner->mean_square[i] += fraction * ((value * value) - learner->mean_square[i]);
            learner->average[i] += weight * (value - learner->average[i]);
            value = learner->average[i];
            learner->autocorrelation[i] += slow * (((value * value) / expected) - learner->autocorrelation[i]);
        }
    }
}

/* Settling, NIS and whether the state must start again, after a sample that is `gap` seconds after the last one. */
static void fw_watch_health(fw_learner *learner, fw_real gap, const fw_real *row, const fw_update *update, fw_real *found)
{
    fw_real sample[1 + (2 * FW_INPUT_COUNT) + (2 * FW_MEASURED_COUNT)];
    fw_real *const innovations = &sample[1 + (2 * FW_INPUT_COUNT)];
    sample[0] = gap;
    fw_copy(&sample[1], learner->stream.last, FW_INPUT_COUNT);
    fw_copy(&sample[1 + FW_INPUT_COUNT], learner->stream.held, FW_INPUT_COUNT);
    fw_copy(innovations, update->innovation, FW_MEASURED_COUNT);
    fw_copy(&innovations[FW_MEASURED_COUNT], &row[FW_ROW_WEIGHTS], FW_MEASURED_COUNT);
    fw_health(learner->health, sample, learner->health, found);
}

/* Whether the bank of the road is less certain than at a start: a lane change hardly separates it from the offset of the
   steering, so that the errors of both would grow from one lane change to the next. */
static int fw_is_worse_than_a_start(const fw_learner *learner)
{
    fw_states states;
    fw_real row[FW_ROW_COUNT] = {FW_REAL(0.0)};
    fw_copy(&row[FW_ROW_INPUTS], learner->stream.held, FW_INPUT_COUNT);
    fw_copy(&row[FW_ROW_INPUTS + FW_MODEL_INPUT_COUNT], learner->stream.held, FW_INPUT_COUNT);
    fw_view(learner->first, row, &states);
    return ((FW_BANKS > 0) && (states.sigma[FW_BANK_STATE] > FW_BANK_SIGMA)) ? 1 : 0;
}

/* Processes a sample with valid inputs. */
static fw_result fw_process_sample(fw_learner *learner, const fw_sample *sample, double previous, fw_real *row,
                                   fw_status *status, fw_real *found)
{
    const double time = sample->time;
    double gap = time - previous;
    fw_update update = {.accepted = 0};
    fw_real ends[2 * FW_MODEL_INPUT_COUNT];
    int was_excited;
    int in_segment;
    int count;
    int restart = 0;
    int any = 0;
    if (fw_stream_starts(&learner->stream, previous) != 0) {
        gap = 0.0;
        fw_start(learner, FW_REAL(1.0));
    }
    was_excited = learner->excited;
    in_segment = fw_is_excited(learner, (fw_real)gap, learner->stream.held);
    if ((was_excited != 0) && (in_segment == 0) && (fw_is_worse_than_a_start(learner) != 0)) {
        gap = 0.0;
        fw_start(learner, FW_REAL(1.0));
    }
    in_segment = ((in_segment != 0) && ((time - learner->start_time) >= FW_SETTLING_TIME)) ? 1 : 0;
    learner->learning = ((fw_has_settled(learner) != 0) && (in_segment != 0)) ? 1 : 0;
    fw_steer(learner, (fw_real)gap, ends);
    count = fw_step_count(gap, ends);
    for (int step = 1; step <= count; step++) {
        fw_write_step(row, ends, (gap > 0.0) ? previous : time, time, step, count);
        row[FW_ROW_LEARN] = FW_REAL(0.0);
        if (step == count) {
            any = fw_write_measurements(row, sample);
            row[FW_ROW_LEARN] = (learner->learning != 0) ? FW_REAL(1.0) : FW_REAL(0.0);
        }
        restart = fw_advance(learner, row, in_segment, &update);
    }
    if (count == 0) {
        return FW_ERROR_GAP;
    }
    if (learner->learning != 0) {
        fw_watch_innovations(learner, (fw_real)gap, row, &update);
    }
    if (restart == 0) {
        fw_watch_health(learner, (fw_real)gap, row, &update, found);
        restart = (found[FW_FOUND_RESTART] != FW_REAL(0.0)) ? 1 : 0;
    }
    *status = fw_stream_finish(&learner->stream, update.accepted);
    if ((restart != 0) || ((*status == FW_COASTING) && (any != 0))) {
        fw_start(learner, learner->health[0]);
        fw_steer(learner, FW_REAL(0.0), ends);
        fw_write_step(row, ends, time, time, 1, 1);
        row[FW_ROW_LEARN] = FW_REAL(0.0);
        (void)fw_advance(learner, row, 0, &update);
        fw_watch_health(learner, FW_REAL(0.0), row, &update, found);
        *status = FW_OK;
    }
    *status = fw_judged(*status, found[FW_FOUND_NIS], found[FW_FOUND_SETTLES]);
    return FW_SUCCESS;
}

void fw_learner_reset(fw_learner *learner)
{
    (void)fw_end_segment(learner);
    fw_stream_init(&learner->stream);
    learner->start_time = -INFINITY;
    learner->dropout = -INFINITY;
    fw_fill(learner->contact, FW_REAL(0.0), FW_STEER_COUNT);
    fw_fill(learner->average, FW_REAL(0.0), FW_MEASURED_COUNT);
    fw_restart_excitation(learner);
    learner->learning = 0;
}

void fw_learner_init(fw_learner *learner)
{
    fw_fill(learner->first, FW_REAL(0.0), FW_CARRY_COUNT);
    for (int i = 0; i < FW_Z_COUNT; i++) {
        learner->first[FW_AT_PZ + fw_diagonal(FW_Z_COUNT, i)] = FW_REAL(1.0);
    }
    fw_fill(learner->mean_square, FW_REAL(1.0), FW_MEASURED_COUNT);
    fw_fill(learner->autocorrelation, FW_REAL(1.0), FW_MEASURED_COUNT);
    fw_begin_segments(learner);
    fw_learner_reset(learner);
}

fw_result fw_learner_push(fw_learner *learner, const fw_sample *sample, fw_states *states)
{
    double previous = learner->stream.time;
    fw_real row[FW_ROW_COUNT] = {FW_REAL(0.0)};
    fw_real found[FW_FOUND_COUNT];
    fw_status status;
    int restart;
    if (fw_stream_refuses(&learner->stream, sample->time, &restart) != 0) {
        return FW_ERROR_TIME;
    }
    if (restart != 0) {
        fw_stream_init(&learner->stream);
        previous = -INFINITY;
    }
    status = fw_stream_take(&learner->stream, sample);
    if (status != FW_OK) {
        learner->learning = 0;
        fw_fill(states->value, (fw_real)NAN, FW_STATE_COUNT);
        fw_fill(states->sigma, (fw_real)NAN, FW_STATE_COUNT);
    } else if (fw_process_sample(learner, sample, previous, row, &status, found) != FW_SUCCESS) {
        return FW_ERROR_GAP;
    } else {
        const fw_real excess = found[FW_FOUND_NIS] / FW_CHANCE;
        fw_view(learner->first, row, states);
        for (int i = 0; (i < FW_STATE_COUNT) && (excess > FW_REAL(1.0)); i++) {
            states->sigma[i] *= FW_SQRT(excess);
        }
    }
    states->time = sample->time;
    states->status = status;
    states->learning = learner->learning;
    return FW_SUCCESS;
}
