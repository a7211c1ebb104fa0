/* One sample of the learner: steps of the filter, innovations and statuses. See fw_learner.h. */

#include "fw_private.h"
#include "fw_step_length.h"

#define FW_MAX_STEPS 100000.0

/* Inputs of the model at both ends of a step: speed and steer angles, contacts of their plays, and their rates. */
static void fw_steer(fw_learner *learner, fw_real gap, const fw_real *last, const fw_real *inputs, fw_real *ends)
{
    fw_real *const before = ends;
    fw_real *const after = &ends[FW_HELD];
    const fw_real duration = (gap > FW_REAL(1e-3)) ? gap : FW_REAL(1e-3);
    before[0] = last[0];
    after[0] = inputs[0];
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

/* Starts the state at the steady state of the inputs; `row` becomes a row without measurements and duration. */
static void fw_start(fw_learner *learner, double time, const fw_real *inputs, fw_real *row)
{
    (void)fw_end_segment(learner);
    fw_start_state(learner->first, inputs);
    for (int i = 0; i < FW_ROW_COUNT; i++) {
        row[i] = FW_REAL(0.0);
    }
    fw_steer(learner, FW_REAL(0.0), inputs, inputs, &row[FW_ROW_INPUTS]);
    fw_restart_excitation(learner);
    learner->start_time = time;
    learner->accepted = time;
    for (int i = 0; i < FW_INPUT_COUNT; i++) {
        learner->last[i] = inputs[i];
    }
    learner->running = 1;
    learner->learning = 0;
}

/* The longest step at both ends of a step, s. */
static double fw_limit(const fw_real *ends)
{
    const fw_real first = fw_longest_step(ends[0]);
    const fw_real second = fw_longest_step(ends[FW_HELD]);
    return (double)((first < second) ? first : second);
}

/* Runs all steps of a gap but the last one, which it leaves in `row`. Returns 0 if there are too many. */
static int fw_subdivide(fw_learner *learner, double previous, double time, int in_segment, fw_real *row)
{
    const double gap = time - previous;
    fw_real *const before = &row[FW_ROW_INPUTS];
    fw_real *const after = &before[FW_HELD];
    const double count = ceil(gap / fw_limit(before));
    fw_real start[FW_HELD];
    fw_real end[FW_HELD];
    double last = previous;
    if (!(count < FW_MAX_STEPS)) {
        return 0;
    }
    for (int i = 0; i < FW_HELD; i++) {
        start[i] = before[i];
        end[i] = after[i];
    }
    for (int step = 1; (double)step < count; step++) {
        fw_update update;
        const double fraction = (double)step / count;
        const double now = previous + (gap * fraction);
        row[FW_ROW_DT] = (fw_real)(now - last);
        for (int i = 0; i < FW_HELD; i++) {
            after[i] = start[i] + ((end[i] - start[i]) * (fw_real)fraction);
        }
        (void)fw_advance(learner, row, in_segment, &update);
        for (int i = 0; i < FW_HELD; i++) {
            before[i] = after[i];
            after[i] = end[i];
        }
        last = now;
    }
    row[FW_ROW_DT] = (fw_real)(time - last);
    return 1;
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

/* Puts the measurements of a sample into a row; returns whether there is one. */
static int fw_take_measurements(const fw_sample *sample, fw_real *row)
{
    int any = 0;
    for (int i = 0; i < FW_MEASURED_COUNT; i++) {
        const int present = (FW_ABS(sample->measured[i]) < (fw_real)INFINITY) ? 1 : 0;
        row[FW_ROW_MEASURED + i] = (present != 0) ? sample->measured[i] : FW_REAL(0.0);
        row[FW_ROW_WEIGHTS + i] = (present != 0) ? FW_REAL(1.0) : FW_REAL(0.0);
        any = ((any != 0) || (present != 0)) ? 1 : 0;
    }
    return any;
}

/* Whether the bank of the road is less certain than at a start: a lane change hardly separates it from the offset of the
   steering, so that the errors of both would grow from one lane change to the next. */
static int fw_is_worse_than_a_start(const fw_learner *learner, const fw_real *inputs)
{
    fw_states states;
    fw_real row[FW_ROW_COUNT] = {FW_REAL(0.0)};
    for (int i = 0; i < FW_INPUT_COUNT; i++) {
        row[FW_ROW_INPUTS + i] = inputs[i];
        row[FW_ROW_INPUTS + FW_HELD + i] = inputs[i];
    }
    fw_view(learner->first, row, &states);
    return ((FW_BANKS > 0) && (states.sigma[FW_BANK_STATE] > FW_BANK_SIGMA)) ? 1 : 0;
}

/* Processes a sample with valid inputs. */
static fw_result fw_process_sample(fw_learner *learner, const fw_sample *sample, double previous, fw_real *row,
                                   fw_status *status)
{
    const double time = sample->time;
    double gap = time - previous;
    fw_update update;
    fw_real inputs[FW_INPUT_COUNT];
    int restart;
    int any;
    int in_segment;
    int was_excited;
    for (int i = 0; i < FW_INPUT_COUNT; i++) {
        inputs[i] = learner->held[i];
    }
    if ((learner->running == 0) || (gap > FW_MAX_GAP)) {
        gap = 0.0;
        previous = time;
        fw_start(learner, time, inputs, row);
    }
    was_excited = learner->excited;
    in_segment = fw_is_excited(learner, (fw_real)gap, inputs);
    if ((was_excited != 0) && (in_segment == 0) && (fw_is_worse_than_a_start(learner, inputs) != 0)) {
        gap = 0.0;
        previous = time;
        fw_start(learner, time, inputs, row);
    }
    in_segment = ((in_segment != 0) && ((time - learner->start_time) >= FW_SETTLING_TIME)) ? 1 : 0;
    learner->learning = ((in_segment != 0) && (fw_has_settled(learner, time) != 0)) ? 1 : 0;
    for (int i = 0; i < FW_ROW_COUNT; i++) {
        row[i] = FW_REAL(0.0);
    }
    fw_steer(learner, (fw_real)gap, learner->last, inputs, &row[FW_ROW_INPUTS]);
    if (fw_subdivide(learner, previous, time, in_segment, row) == 0) {
        return FW_ERROR_GAP;
    }
    any = fw_take_measurements(sample, row);
    row[FW_ROW_LEARN] = (learner->learning != 0) ? FW_REAL(1.0) : FW_REAL(0.0);
    for (int i = 0; i < FW_INPUT_COUNT; i++) {
        learner->last[i] = inputs[i];
    }
    restart = fw_advance(learner, row, in_segment, &update);
    if (learner->learning != 0) {
        fw_watch_innovations(learner, (fw_real)gap, row, &update);
    }
    if (update.accepted != 0) {
        learner->accepted = time;
    }
    *status = ((time - learner->accepted) > FW_COAST) ? FW_COASTING : FW_OK;
    if ((restart != 0) || ((*status == FW_COASTING) && (any != 0))) {
        fw_start(learner, time, inputs, row);
        (void)fw_advance(learner, row, 0, &update);
        *status = FW_OK;
    }
    return FW_SUCCESS;
}

void fw_learner_reset(fw_learner *learner)
{
    (void)fw_end_segment(learner);
    learner->time = -INFINITY;
    learner->start_time = -INFINITY;
    learner->accepted = -INFINITY;
    learner->dropout = -INFINITY;
    for (int i = 0; i < FW_INPUT_COUNT; i++) {
        learner->held[i] = (fw_real)NAN;
        learner->seen[i] = -INFINITY;
    }
    for (int i = 0; i < FW_STEER_COUNT; i++) {
        learner->contact[i] = FW_REAL(0.0);
    }
    for (int i = 0; i < FW_MEASURED_COUNT; i++) {
        learner->average[i] = FW_REAL(0.0);
    }
    fw_restart_excitation(learner);
    learner->running = 0;
    learner->learning = 0;
}

void fw_learner_init(fw_learner *learner)
{
    for (int i = 0; i < FW_CARRY_COUNT; i++) {
        learner->first[i] = FW_REAL(0.0);
    }
    for (int i = 0; i < FW_Z_COUNT; i++) {
        learner->first[FW_AT_PZ + fw_diagonal(FW_Z_COUNT, i)] = FW_REAL(1.0);
    }
    for (int i = 0; i < FW_MEASURED_COUNT; i++) {
        learner->mean_square[i] = FW_REAL(1.0);
        learner->autocorrelation[i] = FW_REAL(1.0);
    }
    fw_begin_segments(learner);
    fw_learner_reset(learner);
}

fw_result fw_learner_push(fw_learner *learner, const fw_sample *sample, fw_states *states)
{
    const double previous = learner->time;
    fw_real row[FW_ROW_COUNT];
    fw_status status;
    if (!(sample->time > previous) || !(sample->time < INFINITY)) {
        return FW_ERROR_TIME;
    }
    learner->time = sample->time;
    status = fw_hold_inputs(learner, sample);
    if (status != FW_OK) {
        learner->running = 0;
        learner->learning = 0;
        for (int i = 0; i < FW_STATE_COUNT; i++) {
            states->value[i] = (fw_real)NAN;
            states->sigma[i] = (fw_real)NAN;
        }
    } else if (fw_process_sample(learner, sample, previous, row, &status) != FW_SUCCESS) {
        return FW_ERROR_GAP;
    } else {
        fw_view(learner->first, row, states);
    }
    states->time = sample->time;
    states->status = status;
    states->learning = learner->learning;
    return FW_SUCCESS;
}
