/* What the sources of the learner share. */

#ifndef FW_PRIVATE_H
#define FW_PRIVATE_H

#include "fw_learner_model.h"

#include <stddef.h>

#define FW_ROW_LEARN (FW_ROW_WEIGHTS + FW_MEASURED_COUNT)
#define FW_EVIDENCE_COUNT (FW_CARRY_COUNT - FW_AT_Z) /* numbers of an estimate with its covariance and score tests */

/* What a step of a filter finds. */
typedef struct {
    fw_real innovation[FW_MEASURED_COUNT]; /* over its standard deviation, 0 where missing */
    int accepted;                          /* whether it used a measurement */
    int diverged;
} fw_update;

/* fw_excitation.c */
int fw_has_settled(fw_learner *learner);
void fw_restart_excitation(fw_learner *learner);
int fw_is_excited(fw_learner *learner, fw_real dt, const fw_real *inputs);

/* fw_joint.c */
int fw_diagonal(int size, int i);
void fw_to_values(const fw_real *z, fw_real *p);
void fw_joint_step(fw_real *carry, const fw_real *row, const fw_real *base, fw_update *update);
void fw_view(const fw_real *carry, const fw_real *row, fw_states *states);

/* fw_start.c */
void fw_start_state(fw_real *carry, const fw_real *inputs);

/* fw_segment.c */
void fw_begin_segments(fw_learner *learner);
int fw_end_segment(fw_learner *learner);
int fw_advance(fw_learner *learner, const fw_real *row, int in_segment, fw_update *update);
const fw_real *fw_finished_estimate(fw_learner *learner);

#endif
