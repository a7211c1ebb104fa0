/* Whether to learn from a sample: the excitation by the steer angles, and whether they are measured. */

#include "fw_private.h"

/* Whether every steer angle is measured now, and the last long dropout is long ago. */
int fw_has_settled(fw_learner *learner)
{
    const double now = learner->stream.time;
    double age = 0.0;
    for (int i = 1; i < FW_INPUT_COUNT; i++) {
        const double own = now - learner->stream.seen[i];
        age = (own > age) ? own : age;
    }
    if (age > FW_MAX_STEER_DROPOUT) {
        learner->dropout = now;
    }
    return (!(age > 0.0) && ((now - learner->dropout) >= FW_SETTLING_TIME)) ? 1 : 0;
}

void fw_restart_excitation(fw_learner *learner)
{
    fw_fill(learner->mean, (fw_real)NAN, FW_STEER_COUNT);
    fw_fill(learner->power, FW_REAL(0.0), FW_STEER_COUNT);
    fw_fill(learner->level, FW_REAL(0.0), FW_STEER_COUNT);
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
    learner->excited = ((power > (limit * limit)) && (level <= FW_MAX_LATERAL_ACCELERATION) &&
                        (FW_ABS(inputs[FW_AT_SPEED_RATE]) <= FW_MAX_SPEED_RATE))
                           ? 1
                           : 0;
    return learner->excited;
}
