/* Speed and steer angles, each held at its last plausible value, and the excitation by the steer angles. */

#include "fw_private.h"

/* Whether an input is possible, and can follow its last value, measured `age` seconds ago. */
static int fw_is_plausible(const fw_learner *learner, int i, fw_real value, double age)
{
    const fw_real change = FW_ABS(value - learner->held[i]);
    const fw_real most = (i == 0) ? FW_MAX_SPEED_CHANGE : (FW_MAX_STEER_RATE * (fw_real)age);
    if (!(FW_ABS(value) <= ((i == 0) ? FW_MAX_SPEED : FW_MAX_STEER))) {
        return 0;
    }
    return ((change <= most) || (age > FW_HOLD)) ? 1 : 0;
}

/* Takes the plausible inputs of a sample; the last ones are held for FW_HOLD seconds. */
fw_status fw_hold_inputs(fw_learner *learner, const fw_sample *sample)
{
    fw_status status = FW_OK;
    for (int i = 0; i < FW_INPUT_COUNT; i++) {
        const double age = sample->time - learner->seen[i];
        if (fw_is_plausible(learner, i, sample->input[i], age) != 0) {
            learner->held[i] = sample->input[i];
            learner->seen[i] = sample->time;
        } else if (!(age <= FW_HOLD)) {
            status = FW_INPUT_MISSING;
        } else if ((i > 0) && (age > FW_MAX_STEER_DROPOUT)) {
            learner->dropout = sample->time;
        } else {
            /* a short dropout */
        }
    }
    if ((status == FW_OK) && (learner->held[0] < FW_MIN_SPEED)) {
        status = FW_TOO_SLOW;
    }
    return status;
}

/* Whether every steer angle is measured now, and the last long dropout is long ago. */
int fw_has_settled(const fw_learner *learner, double time)
{
    int settled = ((time - learner->dropout) >= FW_SETTLING_TIME) ? 1 : 0;
    for (int i = 1; i < FW_INPUT_COUNT; i++) {
        settled = ((settled != 0) && !(learner->seen[i] < time)) ? 1 : 0;
    }
    return settled;
}

void fw_restart_excitation(fw_learner *learner)
{
    for (int i = 0; i < FW_STEER_COUNT; i++) {
        learner->mean[i] = (fw_real)NAN;
        learner->power[i] = FW_REAL(0.0);
        learner->level[i] = FW_REAL(0.0);
    }
    learner->excited = 0;
}

/* Whether the steady lateral acceleration of the steer angles varies enough to learn from, and is not too large. */
int fw_is_excited(fw_learner *learner, fw_real dt, const fw_real *inputs)
{
    const fw_real squared = inputs[0] * inputs[0];
    const fw_real gain = squared / (FW_WHEELBASE + (FW_UNDERSTEER * squared));
    const fw_real slow = dt / (FW_HIGH_PASS_TIME + dt);
    const fw_real fast = dt / (FW_EXCITATION_WINDOW + dt);
    const fw_real limit = (learner->excited != 0) ? FW_STOP_EXCITATION : FW_START_EXCITATION;
    fw_real power = FW_REAL(0.0);
    fw_real level = FW_REAL(0.0);
    for (int i = 0; i < FW_STEER_COUNT; i++) {
        const fw_real acceleration = gain * inputs[1 + i];
        const fw_real mean = isnan(learner->mean[i]) ? acceleration : learner->mean[i];
        fw_real deviation;
        learner->mean[i] = mean + (slow * (acceleration - mean));
        deviation = acceleration - learner->mean[i];
        learner->power[i] += fast * ((deviation * deviation) - learner->power[i]);
        learner->level[i] += fast * (acceleration - learner->level[i]);
        power = (learner->power[i] > power) ? learner->power[i] : power;
        level = (FW_ABS(learner->level[i]) > level) ? FW_ABS(learner->level[i]) : level;
    }
    learner->excited = ((power > (limit * limit)) && (level <= FW_MAX_LATERAL_ACCELERATION)) ? 1 : 0;
    return learner->excited;
}
