/* Repeated passes over the samples of a segment with excitation, from a better point of linearisation.

   A second filter processes the stored samples of the segment again, from the state of the first filter at its
   beginning. In its first pass it follows the first filter at a distance and linearises at the first filter's estimate;
   in each further pass it linearises at its own last result, until that converges. The first filter then continues from
   the result. The estimates of a filter, with covariance and score tests, are its carry from FW_AT_Z on. */

#include "fw_private.h"

#if FW_MAX_PASSES > 0

/* A result of the passes, and the point at which it was linearised. */
typedef struct {
    const fw_real *evidence; /* from FW_AT_Z on */
    fw_real base[FW_Z_COUNT];
    int has_base; /* 0: at the estimate of the first filter */
} fw_result_of_passes;

static void fw_clear_segment(fw_learner *learner)
{
    learner->count = 0;
    learner->position = 0;
    learner->pass = 1;
    learner->complete = 1;
}

void fw_begin_segments(fw_learner *learner)
{
    learner->has_base = 0;
    fw_clear_segment(learner);
}

/* Whether the result of a pass is near its point of linearisation, or the pass is the last one allowed. */
static int fw_is_last_pass(const fw_learner *learner, const fw_real *filter, const fw_real *base, int pass)
{
    const fw_real limit = (base == NULL) ? FW_FIRST_PASS_LIMIT : FW_PASS_LIMIT;
    const fw_real *const point = (base == NULL) ? &learner->first[FW_AT_Z] : base;
    int near = 1;
    for (int i = 0; (i < FW_Z_COUNT) && (near != 0); i++) {
        const fw_real sigma = FW_SQRT(filter[FW_AT_PZ + fw_diagonal(FW_Z_COUNT, i)]);
        near = (FW_ABS(filter[FW_AT_Z + i] - point[i]) <= (limit * sigma)) ? 1 : 0;
    }
    return ((pass >= FW_MAX_PASSES) || (near != 0)) ? 1 : 0;
}

/* Finishes all passes on a copy of the second filter. */
static void fw_finish_passes(fw_learner *learner, fw_result_of_passes *result)
{
    int position = learner->position;
    int pass = learner->pass;
    result->evidence = &learner->first[FW_AT_Z];
    result->has_base = learner->has_base;
    fw_copy(result->base, learner->base, FW_Z_COUNT);
    if (learner->count == 0) {
        return;
    }
    fw_copy(learner->work, learner->second, FW_CARRY_COUNT);
    while (pass <= FW_MAX_PASSES) {
        const fw_real *const base = (result->has_base != 0) ? result->base : &learner->first[FW_AT_Z];
        for (int k = position; k < learner->count; k++) {
            fw_update update;
            fw_joint_step(learner->work, learner->rows[k], base, &update);
            if (update.diverged != 0) { /* keep the estimate of the first filter */
                result->has_base = learner->has_base;
                fw_copy(result->base, learner->base, FW_Z_COUNT);
                return;
            }
        }
        if (fw_is_last_pass(learner, learner->work, (result->has_base != 0) ? result->base : NULL, pass) != 0) {
            result->evidence = &learner->work[FW_AT_Z];
            return;
        }
        fw_copy(result->base, &learner->work[FW_AT_Z], FW_Z_COUNT);
        result->has_base = 1;
        position = 0;
        pass++;
        fw_copy(learner->work, learner->begin, FW_CARRY_COUNT);
    }
}

/* Sets the estimate of the first filter; returns 1 if the change is too large for its state.

   The state changes with z to first order, and its covariance grows by the square of that change. */
static int fw_continue_from(fw_learner *learner, const fw_result_of_passes *result)
{
    fw_real *const first = learner->first;
    fw_real change[FW_X_COUNT];
    int restart = 0;
    int place = FW_AT_P;
    for (int i = 0; i < FW_X_COUNT; i++) {
        change[i] = FW_REAL(0.0);
        for (int j = 0; j < FW_Z_COUNT; j++) {
            change[i] += first[FW_AT_V + (j * FW_X_COUNT) + i] * (result->evidence[j] - first[FW_AT_Z + j]);
        }
    }
    for (int j = 0; j < FW_X_COUNT; j++) {
        first[j] += change[j];
        for (int i = j; i < FW_X_COUNT; i++) {
            first[place] += change[i] * change[j];
            place++;
        }
    }
    for (int j = 0; j < FW_Z_COUNT; j++) {
        const fw_real variance = result->evidence[(FW_AT_PZ - FW_AT_Z) + fw_diagonal(FW_Z_COUNT, j)];
        const fw_real difference = result->evidence[j] - first[FW_AT_Z + j];
        restart = ((restart != 0) || (FW_ABS(difference) > (FW_PASS_LIMIT * FW_SQRT(variance)))) ? 1 : 0;
    }
    if (result->evidence != &first[FW_AT_Z]) {
        fw_copy(&first[FW_AT_Z], result->evidence, FW_EVIDENCE_COUNT);
    }
    fw_copy(learner->base, (result->has_base != 0) ? result->base : result->evidence, FW_Z_COUNT);
    learner->has_base = 1;
    fw_clear_segment(learner);
    return restart;
}

/* Ends the segment and finishes its passes; returns 1 if the state must start anew. */
int fw_end_segment(fw_learner *learner)
{
    fw_result_of_passes result;
    if (learner->count == 0) {
        return 0;
    }
    fw_finish_passes(learner, &result);
    return fw_continue_from(learner, &result);
}

/* Estimate after all passes over all samples, from z on. */
const fw_real *fw_finished_estimate(fw_learner *learner)
{
    fw_result_of_passes result;
    fw_finish_passes(learner, &result);
    return result.evidence;
}

/* Adds a row to the segment, or begins a segment with it; returns 1 if the state must start anew. */
static int fw_store_row(fw_learner *learner, const fw_real *row)
{
    const int full = ((learner->complete != 0) || (learner->count == FW_SEGMENT_COUNT)) ? 1 : 0;
    if ((learner->count > 0) && (full != 0) && (fw_end_segment(learner) != 0)) {
        return 1;
    }
    if (learner->count == 0) {
        fw_copy(learner->begin, learner->first, FW_CARRY_COUNT);
        fw_copy(learner->second, learner->first, FW_CARRY_COUNT);
    }
    learner->complete = 0;
    fw_copy(learner->rows[learner->count], row, FW_ROW_COUNT);
    learner->count++;
    return 0;
}

/* Begins the next pass, or continues from the result of this one; returns 1 if the state must start anew. */
static int fw_end_pass(fw_learner *learner)
{
    const fw_real *const base = (learner->has_base != 0) ? learner->base : NULL;
    if (fw_is_last_pass(learner, learner->second, base, learner->pass) != 0) {
        fw_result_of_passes result;
        result.evidence = &learner->second[FW_AT_Z];
        result.has_base = learner->has_base;
        fw_copy(result.base, learner->base, FW_Z_COUNT);
        return fw_continue_from(learner, &result);
    }
    fw_copy(learner->base, &learner->second[FW_AT_Z], FW_Z_COUNT);
    learner->has_base = 1;
    learner->position = 0;
    learner->pass++;
    fw_copy(learner->second, learner->begin, FW_CARRY_COUNT);
    return 0;
}

/* Gives the second filter its next row, at most one for each row of the first; returns 1 if it diverged. */
static int fw_advance_second(fw_learner *learner)
{
    const int behind = learner->count - learner->position;
    fw_update update = {.diverged = 0};
    if ((learner->count > 0) && (behind > ((learner->complete != 0) ? 0 : FW_LAG))) {
        const fw_real *const base = (learner->has_base != 0) ? learner->base : &learner->first[FW_AT_Z];
        fw_joint_step(learner->second, learner->rows[learner->position], base, &update);
        learner->position++;
    }
    return update.diverged;
}

/* Processes a row; returns 1 if the state must start anew. */
int fw_advance(fw_learner *learner, const fw_real *row, int in_segment, fw_update *update)
{
    int restart = 0;
    int second_diverged;
    if (in_segment != 0) {
        restart = fw_store_row(learner, row);
    } else {
        learner->complete = 1;
    }
    second_diverged = fw_advance_second(learner);
    fw_joint_step(learner->first, row, NULL, update);
    if (second_diverged != 0) {
        fw_clear_segment(learner);
    } else if ((learner->count > 0) && (learner->complete != 0) && (learner->position == learner->count)) {
        restart = fw_end_pass(learner);
    } else {
        /* within the segment, or a pass */
    }
    return ((restart != 0) || (update->diverged != 0)) ? 1 : 0;
}

#else

void fw_begin_segments(fw_learner *learner)
{
    (void)learner;
}

int fw_end_segment(fw_learner *learner)
{
    (void)learner;
    return 0;
}

const fw_real *fw_finished_estimate(fw_learner *learner)
{
    return &learner->first[FW_AT_Z];
}

int fw_advance(fw_learner *learner, const fw_real *row, int in_segment, fw_update *update)
{
    (void)in_segment;
    fw_joint_step(learner->first, row, NULL, update);
    return update->diverged;
}

#endif
