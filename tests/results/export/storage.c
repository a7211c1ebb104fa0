/* Restores damaged and foreign estimates between the samples of a log: the learner must refuse them and go on. At the
   end it resets the learner, which must keep the estimates and accept any time. */

#include "fw_learner.h"

#include "replay_log.h"

/* Whether a reset keeps the estimates, and the next sample may have any time. */
static int resets(fw_learner *learner, fw_sample *sample)
{
    static fw_saved before;
    static fw_saved after;
    fw_states states;
    int accepted;
    fw_learner_save(learner, &before);
    sample->time = 0.0;
    accepted = fw_learner_push(learner, sample, &states) == FW_SUCCESS;
    fw_learner_reset(learner);
    fw_learner_save(learner, &after);
    return !accepted && memcmp(&before, &after, sizeof before) == 0 &&
           fw_learner_push(learner, sample, &states) == FW_SUCCESS && states.status == FW_SETTLING;
}

int main(void)
{
    static fw_learner learner;
    static fw_saved saved;
    static fw_saved wrong;
    static replay_log log;
    fw_sample sample;
    fw_states states;
    long row = 0;
    fw_learner_init(&learner);
    open_log(&log);
    while (read_sample(&log, &sample) > 0) {
        (void)fw_learner_push(&learner, &sample, &states);
        row++;
        if (row % 50 == 0) {
            fw_learner_save(&learner, &saved);
            for (size_t i = 0; i < sizeof saved; i += 97) {
                wrong = saved;
                ((unsigned char *)&wrong)[i] ^= 0x10u;
                if (fw_learner_restore(&learner, &wrong) == FW_SUCCESS) {
                    (void)printf("accepted a damaged byte %lu\n", (unsigned long)i);
                }
            }
        }
        (void)printf("%.17g,%.17g\n", (double)states.value[0], (double)states.sigma[0]);
    }
    (void)printf("%d,", resets(&learner, &sample));
    wrong = saved;
    wrong.version++;
    (void)printf("%d", fw_learner_restore(&learner, &wrong) == FW_ERROR_FOREIGN);
    wrong = saved;
    wrong.model++;
    (void)printf(",%d", fw_learner_restore(&learner, &wrong) == FW_ERROR_FOREIGN);
    wrong = saved;
    wrong.number[0] += (fw_real)1.0;
    (void)printf(",%d", fw_learner_restore(&learner, &wrong) == FW_ERROR_DAMAGED);
    (void)printf(",%d\n", fw_learner_restore(&learner, &saved) == FW_SUCCESS);
    return 0;
}
