/* Replays the samples of log.h, and prints the ticks of the processor clock that each push takes. */

#include "estimator.h"
#include "log.h"

#include <stdint.h>
#include <stdio.h>

#define SYST_CSR (*(volatile uint32_t *)0xE000E010u)
#define SYST_RVR (*(volatile uint32_t *)0xE000E014u)
#define SYST_CVR (*(volatile uint32_t *)0xE000E018u)
#define LONGEST 0xFFFFFFu

int main(void)
{
    static estimator unit;
    static fw_states states;
    estimator_init(&unit);
    printf("%lu bytes\n", (unsigned long)sizeof unit);
    SYST_RVR = LONGEST;
    SYST_CVR = 0;
    SYST_CSR = 5;
    for (int k = 0; k < ROWS; k++) {
        fw_sample sample;
        uint32_t before;
        uint32_t used;
        sample.time = samples[k][0];
        for (int i = 0; i < FW_INPUT_COUNT; i++) {
            sample.input[i] = (fw_real)samples[k][1 + i];
        }
        for (int i = 0; i < FW_MEASURED_COUNT; i++) {
            sample.measured[i] = (fw_real)samples[k][1 + FW_INPUT_COUNT + i];
        }
        before = SYST_CVR;
        (void)estimator_push(&unit, &sample, &states);
        used = (before - SYST_CVR) & LONGEST;
        printf("%lu,%d", (unsigned long)used, (int)states.status);
        for (int i = 0; i < FW_STATE_COUNT; i++) {
            printf(",%.9g", (double)states.value[i]);
        }
        for (int i = 0; i < FW_STATE_COUNT; i++) {
            printf(",%.9g", (double)states.sigma[i]);
        }
        printf("\n");
    }
    return 0;
}
