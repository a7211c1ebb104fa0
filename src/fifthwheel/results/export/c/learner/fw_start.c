/* The start of the state: the steady state of speed and steer angles at the present estimates. */

#include "fw_private.h"
#include "fw_algebra.h"

/* The steady state and what follows from it; zeros for an unstable vehicle. */
typedef struct {
    fw_real x[FW_N * 2];              /* of the inputs, and of the bank of the road */
    fw_real p[FW_L * FW_L];           /* covariance under random steering of variance 1 */
    fw_real slope[FW_N * FW_P_COUNT]; /* derivatives of -x with respect to the unknowns */
} fw_steady;

static void fw_steady_state(const fw_real *inputs, const fw_real *values, fw_steady *steady)
{
    fw_real a[FW_N * FW_N];
    fw_real work[FW_N * FW_N];
    fw_real b[FW_N];
    fw_real steer[FW_N];
    fw_real bank[FW_N];
    fw_real x[FW_N];
    fw_fill(steady->x, FW_REAL(0.0), 2 * FW_N);
    fw_fill(steady->slope, FW_REAL(0.0), FW_N * FW_P_COUNT);
    fw_start_matrices(inputs, values, a, b, steer, bank);
    if (fw_random_steer(a, b, 1, steady->p) == 0) {
        fw_fill(steady->p, FW_REAL(0.0), FW_L * FW_L);
        return;
    }
    for (int i = 0; i < FW_N; i++) {
        steady->x[2 * i] = -steer[i];
        steady->x[(2 * i) + 1] = -bank[i];
    }
    (void)fw_solve(FW_N, a, 2, steady->x);
    for (int i = 0; i < FW_N; i++) {
        x[i] = steady->x[2 * i];
    }
    fw_start_slopes(inputs, values, x, work, steady->slope);
    (void)fw_solve(FW_N, work, FW_P_COUNT, steady->slope);
}

/* Covariance of two states. */
static fw_real fw_start_covariance(const fw_steady *steady, int i, int j)
{
    fw_real value = FW_REAL(0.0);
    if ((i < FW_N + FW_BANKS) && (j < FW_N + FW_BANKS)) {
        const fw_real one = (i < FW_N) ? steady->x[(2 * i) + 1] : FW_REAL(1.0);
        const fw_real other = (j < FW_N) ? steady->x[(2 * j) + 1] : FW_REAL(1.0);
        value = FW_BANK_SIGMA * FW_BANK_SIGMA * one * other;
    }
    if ((i < FW_N) && (j < FW_N)) {
        value += FW_TYPICAL_STEER_SIGMA * FW_TYPICAL_STEER_SIGMA * steady->p[(i * FW_L) + j];
    }
    if (i == j) {
        if (i < FW_N) {
            value += fw_initial_variance[i];
        } else if (i >= FW_N + FW_BANKS) {
            value += fw_discrepancy_variance[i - FW_N - FW_BANKS];
        } else {
            /* the bank of the road */
        }
    }
    return value;
}

/* Sets state, covariance and sensitivities; the estimates stay. */
void fw_start_state(fw_real *carry, const fw_real *inputs)
{
    fw_steady steady;
    fw_real values[FW_P_COUNT];
    int place = FW_AT_P;
    fw_to_values(&carry[FW_AT_Z], values);
    fw_steady_state(inputs, values, &steady);
    for (int i = 0; i < FW_X_COUNT; i++) {
        carry[i] = (i < FW_N) ? steady.x[2 * i] : FW_REAL(0.0);
    }
    for (int j = 0; j < FW_X_COUNT; j++) { /* lower triangle by columns */
        for (int i = j; i < FW_X_COUNT; i++) {
            carry[place] = fw_start_covariance(&steady, i, j);
            place++;
        }
    }
    for (int k = 0; k < FW_P_COUNT; k++) {
        const fw_real rate = (fw_logarithmic[k] != 0) ? (values[k] * fw_scale[k]) : fw_scale[k];
        for (int i = 0; i < FW_X_COUNT; i++) {
            carry[FW_AT_V + (k * FW_X_COUNT) + i] =
                (i < FW_N) ? (-steady.slope[(i * FW_P_COUNT) + k] * rate) : FW_REAL(0.0);
        }
    }
}
