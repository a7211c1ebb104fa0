/* Replays a log through the observer: CSV from standard input (replay_log.h), states to standard output.

   An answer is time, status, nis, then values and sigmas. */

#include "fw_observer.h"

#include "replay_log.h"

int main(void)
{
    static fw_observer observer;
    static replay_log log;
    fw_sample sample;
    int found;
    fw_observer_init(&observer);
    open_log(&log);
    for (found = read_sample(&log, &sample); found > 0; found = read_sample(&log, &sample)) {
        fw_states states;
        if (fw_observer_push(&observer, &sample, &states) != FW_SUCCESS) {
            (void)fprintf(stderr, "line %ld: time is not after the last one, or the gap is too long\n", log.row);
            continue;
        }
        (void)printf("%.17g,%d,%.17g", states.time, (int)states.status, (double)states.nis);
        for (int i = 0; i < FW_STATE_COUNT; i++) {
            (void)printf(",%.17g", (double)states.value[i]);
        }
        for (int i = 0; i < FW_STATE_COUNT; i++) {
            (void)printf(",%.17g", (double)states.sigma[i]);
        }
        (void)printf("\n");
    }
    return (found < 0) ? 2 : 0;
}
