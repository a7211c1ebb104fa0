/* Estimates that outlast the control unit being switched off. */

#include "fw_private.h"

#define FW_SAVED_VERSION 1u
#define FW_POLYNOMIAL 0xEDB88320u /* of CRC-32 */

/* CRC-32 of some bytes, continued from that of the bytes before them; 0 before the first. */
static uint32_t fw_checksum(uint32_t start, const void *memory, size_t size)
{
    const unsigned char *const bytes = (const unsigned char *)memory;
    uint32_t value = ~start;
    for (size_t i = 0; i < size; i++) {
        value ^= (uint32_t)bytes[i];
        for (int bit = 0; bit < 8; bit++) {
            value = ((value & 1u) != 0u) ? ((value >> 1) ^ FW_POLYNOMIAL) : (value >> 1);
        }
    }
    return ~value;
}

/* Of all members but itself. */
static uint32_t fw_checksum_of(const fw_saved *saved)
{
    uint32_t value = fw_checksum(0u, &saved->version, sizeof saved->version);
    value = fw_checksum(value, &saved->size, sizeof saved->size);
    value = fw_checksum(value, &saved->model, sizeof saved->model);
    return fw_checksum(value, saved->number, sizeof saved->number);
}

void fw_learner_save(fw_learner *learner, fw_saved *saved)
{
    const fw_real *const evidence = fw_finished_estimate(learner);
    saved->version = FW_SAVED_VERSION;
    saved->size = (uint32_t)sizeof *saved;
    saved->model = FW_MODEL_IDENTITY;
    fw_copy(saved->number, evidence, FW_EVIDENCE_COUNT);
    for (int i = 0; i < FW_MEASURED_COUNT; i++) {
        saved->number[FW_EVIDENCE_COUNT + (2 * i)] = learner->mean_square[i];
        saved->number[FW_EVIDENCE_COUNT + (2 * i) + 1] = learner->autocorrelation[i];
    }
    saved->checksum = fw_checksum_of(saved);
}

fw_result fw_learner_restore(fw_learner *learner, const fw_saved *saved)
{
    if ((saved->version != FW_SAVED_VERSION) || (saved->size != (uint32_t)sizeof *saved) ||
        (saved->model != FW_MODEL_IDENTITY)) {
        return FW_ERROR_FOREIGN;
    }
    if (saved->checksum != fw_checksum_of(saved)) {
        return FW_ERROR_DAMAGED;
    }
    fw_learner_init(learner);
    fw_copy(&learner->first[FW_AT_Z], saved->number, FW_EVIDENCE_COUNT);
    for (int i = 0; i < FW_MEASURED_COUNT; i++) {
        learner->mean_square[i] = saved->number[FW_EVIDENCE_COUNT + (2 * i)];
        learner->autocorrelation[i] = saved->number[FW_EVIDENCE_COUNT + (2 * i) + 1];
    }
    return FW_SUCCESS;
}
