/* Replays a log through the observer: lines of numbers from standard input, states to standard output.

   A line is time, then the inputs and the measured signals in the order of their enumerations, separated by commas;
   "nan" where missing. An answer is time, status, nis, then values and sigmas. */

#include "fw_observer.h"

#include <stdio.h>
#include <stdlib.h>

static int read_numbers(const char *line, double *numbers, int count)
{
    int found = 0;
    char *end = NULL;
    for (const char *at = line; found < count; at = end + 1) {
        numbers[found] = strtod(at, &end);
        if (end == at) {
            break;
        }
        found++;
        if (*end != ',') {
            break;
        }
    }
    return found;
}

int main(void)
{
    static fw_observer observer;
    static char line[8192];
    const int count = 1 + FW_INPUT_COUNT + FW_MEASURED_COUNT;
    double numbers[1 + FW_INPUT_COUNT + FW_MEASURED_COUNT];
    long row = 0;
    fw_observer_init(&observer);
    while (fgets(line, (int)sizeof line, stdin) != NULL) {
        fw_sample sample;
        fw_states states;
        row++;
        if (read_numbers(line, numbers, count) != count) {
            (void)fprintf(stderr, "line %ld: expected %d numbers\n", row, count);
            return 2;
        }
        sample.time = numbers[0];
        for (int i = 0; i < FW_INPUT_COUNT; i++) {
            sample.input[i] = (fw_real)numbers[1 + i];
        }
        for (int i = 0; i < FW_MEASURED_COUNT; i++) {
            sample.measured[i] = (fw_real)numbers[1 + FW_INPUT_COUNT + i];
        }
        if (fw_observer_push(&observer, &sample, &states) != FW_SUCCESS) {
            (void)fprintf(stderr, "line %ld: time is not after the last one, or the gap is too long\n", row);
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
    return 0;
}
