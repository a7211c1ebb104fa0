/* Replays a log through the learner: CSV from standard input (replay_log.h), states to standard output, estimates to
   the file that the first argument names, by default estimates.csv.

   An answer is time, status, whether it learned, then values and sigmas of the states. With a second argument, a file,
   the learner starts with the estimates that it contains, if it exists, and writes its own to it at the end. */

#include "fw_learner.h"

#include "replay_log.h"

static const char *const verdicts[] = {"converged", "doubtful", "not_excited", "not_identifiable", "at_bound"};

/* Continues from the estimates of a file; returns 0 if they cannot be used. */
static int restore_from(fw_learner *learner, const char *path)
{
    static fw_saved saved;
    FILE *file = fopen(path, "rb");
    int valid = 1;
    if (file != NULL) {
        valid = (fread(&saved, sizeof saved, 1, file) == 1) ? 1 : 0;
        valid = (valid != 0 && fw_learner_restore(learner, &saved) == FW_SUCCESS) ? 1 : 0;
        (void)fclose(file);
    }
    return valid;
}

static int save_to(fw_learner *learner, const char *path)
{
    static fw_saved saved;
    FILE *file = fopen(path, "wb");
    size_t written = 0;
    if (file != NULL) {
        fw_learner_save(learner, &saved);
        written = fwrite(&saved, sizeof saved, 1, file);
        (void)fclose(file);
    }
    return (written == 1) ? 1 : 0;
}

static int write_estimates(fw_learner *learner, const char *path)
{
    static fw_learned_value estimates[FW_ESTIMATE_COUNT];
    FILE *file = fopen(path, "w");
    if (file == NULL) {
        return 0;
    }
    fw_learner_estimates(learner, estimates);
    (void)fprintf(file, "name,value,sigma,verdict\n");
    for (int i = 0; i < FW_ESTIMATE_COUNT; i++) {
        (void)fprintf(file, "%s,%.17g,%.17g,%s\n", fw_estimate_names[i], (double)estimates[i].value,
                      (double)estimates[i].sigma, verdicts[estimates[i].verdict]);
    }
    return (fclose(file) == 0) ? 1 : 0;
}

static void print_states(const fw_states *states)
{
    (void)printf("%.17g,%d,%d", states->time, (int)states->status, states->learning);
    for (int i = 0; i < FW_STATE_COUNT; i++) {
        (void)printf(",%.17g", (double)states->value[i]);
    }
    for (int i = 0; i < FW_STATE_COUNT; i++) {
        (void)printf(",%.17g", (double)states->sigma[i]);
    }
    (void)printf("\n");
}

int main(int count, char **arguments)
{
    static fw_learner learner;
    static replay_log log;
    const char *const result = (count > 1) ? arguments[1] : "estimates.csv";
    fw_sample sample;
    int found;
    fw_learner_init(&learner);
    if (count > 2 && restore_from(&learner, arguments[2]) == 0) {
        (void)fprintf(stderr, "%s: damaged, or of another vehicle or version; remove it to start anew\n", arguments[2]);
        return 2;
    }
    open_log(&log);
    for (found = read_sample(&log, &sample); found > 0; found = read_sample(&log, &sample)) {
        fw_states states;
        if (fw_learner_push(&learner, &sample, &states) == FW_SUCCESS) {
            print_states(&states);
        } else {
            (void)fprintf(stderr, "line %ld: time is not after the last one, or the gap is too long\n", log.row);
        }
    }
    if (found < 0 || (count > 2 && save_to(&learner, arguments[2]) == 0) || write_estimates(&learner, result) == 0) {
        return 2;
    }
    return 0;
}
