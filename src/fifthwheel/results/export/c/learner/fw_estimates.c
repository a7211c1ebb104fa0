/* Values, standard deviations and verdicts of the unknowns. */

#include "fw_private.h"

/* An estimate with the information that autocorrelated innovations contain. */
typedef struct {
    const fw_real *evidence;   /* of the filter, from z on */
    fw_real scale[FW_Z_COUNT]; /* factors of standard deviations */
    fw_real inflation;         /* so many innovations contain the information of one */
} fw_inflated;

/* Whether an estimate is doubtful, by unknown. */
typedef int fw_doubts[FW_Z_COUNT];

static fw_inflated fw_inflate(const fw_learner *learner, const fw_real *evidence)
{
    fw_inflated result;
    result.evidence = evidence;
    result.inflation = FW_REAL(1.0);
    for (int i = 0; i < FW_MEASURED_COUNT; i++) {
        const fw_real factor = learner->autocorrelation[i];
        result.inflation = (factor > result.inflation) ? factor : result.inflation;
    }
    for (int i = 0; i < FW_Z_COUNT; i++) { /* no variance exceeds that of the prior */
        fw_real factor = FW_REAL(1.0) / evidence[(FW_AT_PZ - FW_AT_Z) + fw_diagonal(FW_Z_COUNT, i)];
        factor = (factor > FW_REAL(1.0)) ? factor : FW_REAL(1.0);
        result.scale[i] = FW_SQRT((factor < result.inflation) ? factor : result.inflation);
    }
    return result;
}

/* Dependence of estimate i on considered unknown c. */
static fw_real fw_dependence(const fw_inflated *estimate, int i, int c)
{
    return estimate->evidence[(FW_AT_B - FW_AT_Z) + (c * FW_Z_COUNT) + i];
}

/* Covariance of two estimates, in variances of their priors. */
static fw_real fw_covariance(const fw_inflated *estimate, int i, int j)
{
    const int low = (i < j) ? i : j;
    const int high = (i < j) ? j : i;
    const int place = (FW_AT_PZ - FW_AT_Z) + fw_diagonal(FW_Z_COUNT, low) + high - low;
    fw_real sum = estimate->evidence[place] * estimate->scale[i] * estimate->scale[j];
    for (int c = 0; c < FW_CONSIDERED; c++) {
        sum += fw_dependence(estimate, i, c) * fw_dependence(estimate, j, c);
    }
    return sum;
}

/* Marks an estimate that a change moves by a harmful fraction of its standard deviation. */
static void fw_mark_moved(const fw_inflated *estimate, int i, fw_real shift, fw_doubts doubts)
{
    if (FW_ABS(shift) > (FW_HARMFUL_SHIFT * FW_SQRT(fw_covariance(estimate, i, i)))) {
        doubts[i] = 1;
    }
}

static void fw_mark_all(fw_doubts doubts)
{
    for (int i = 0; i < FW_Z_COUNT; i++) {
        doubts[i] = 1;
    }
}

/* The test of the prior of a considered unknown. */
typedef struct {
    fw_real implied;   /* change without the prior */
    fw_real statistic; /* squared; it has the variance 1 if the prior holds */
    fw_real odds;      /* logarithm of the odds of a gross error; below 0 if a truck cannot have the change */
    int informed;      /* whether the measurements contain no less information than the prior, or it is a sensor's */
} fw_test;

static fw_test fw_test_prior(const fw_inflated *estimate, int c)
{
    const fw_real gradient = estimate->evidence[(FW_AT_GRADIENT - FW_AT_Z) + c] / estimate->inflation;
    const fw_real information = estimate->evidence[(FW_AT_INFORMATION - FW_AT_Z) + c] / estimate->inflation;
    fw_test test = {FW_REAL(0.0), FW_REAL(0.0), FW_REAL(-1.0), 0};
    if ((information > FW_REAL(0.0)) && (FW_ABS(gradient) >= (fw_least_change[c] * (FW_REAL(1.0) + information)))) {
        const fw_real variance = FW_REAL(1.0) + (FW_REAL(1.0) / information);
        const fw_real wider = variance + fw_gross_variance[c];
        test.implied = -gradient / information;
        test.statistic = test.implied * test.implied / variance;
        test.informed = ((fw_least_change[c] <= FW_REAL(0.0)) || (variance <= FW_REAL(2.0))) ? 1 : 0;
        if (FW_ABS(test.implied) <= fw_possible_change[c]) {
            test.odds = fw_gross_odds[c] + ((test.statistic * (FW_REAL(1.0) - (variance / wider))) * FW_REAL(0.5)) -
                        (FW_LOG(wider / variance) * FW_REAL(0.5));
        }
    }
    return test;
}

/* Estimates that depend on the assumptions which the measurements contradict most. */
static void fw_doubt_assumptions(const fw_inflated *estimate, fw_doubts doubts)
{
    fw_test best = {FW_REAL(0.0), FW_REAL(0.0), FW_REAL(0.0), 0};
    for (int informed = 1; (informed >= 0) && (best.odds <= FW_REAL(0.0)); informed--) {
        for (int c = 0; c < FW_CONSIDERED; c++) {
            const fw_test test = fw_test_prior(estimate, c);
            best = ((test.informed >= informed) && (test.odds > best.odds)) ? test : best;
        }
    }
    for (int c = 0; c < FW_CONSIDERED; c++) {
        const fw_test test = fw_test_prior(estimate, c);
        const int likely = ((test.informed >= best.informed) && (test.odds > FW_REAL(0.0)) &&
                            (test.odds > (best.odds - FW_ABOUT_AS_LIKELY))) ? 1 : 0;
        for (int i = 0; (likely != 0) && (i < FW_Z_COUNT); i++) {
            fw_mark_moved(estimate, i, fw_dependence(estimate, i, c) * test.implied, doubts);
        }
    }
    if (best.statistic > (FW_STRONG_SCORE * FW_STRONG_SCORE)) { /* the model does not describe the measurements */
        fw_mark_all(doubts);
    }
}

/* Sensor errors and parameters far outside their priors. */
static void fw_doubt_unusual(const fw_inflated *estimate, fw_doubts doubts)
{
    for (int i = 0; i < FW_Z_COUNT; i++) {
        const fw_real deviation = estimate->evidence[i];
        if ((fw_sensor_error[i] != 0) && (FW_ABS(deviation) > FW_UNUSUAL_SENSOR_ERROR)) {
            for (int j = 0; j < FW_Z_COUNT; j++) {
                const fw_real slope = fw_covariance(estimate, j, i) / fw_covariance(estimate, i, i);
                fw_mark_moved(estimate, j, slope * deviation, doubts);
            }
        } else if ((fw_sensor_error[i] == 0) && (fw_logarithmic[i] != 0) && (FW_ABS(deviation) > FW_UNUSUAL_ESTIMATE)) {
            doubts[i] = 1;
        } else {
            /* within its prior */
        }
    }
}

/* Innovations that are larger or more autocorrelated than noise and discrepancies explain. */
static void fw_doubt_innovations(const fw_learner *learner, fw_doubts doubts)
{
    for (int i = 0; i < FW_MEASURED_COUNT; i++) {
        if ((learner->mean_square[i] > FW_MAX_INNOVATION_RATIO) ||
            (learner->autocorrelation[i] > FW_MAX_AUTOCORRELATION)) {
            fw_mark_all(doubts);
        }
    }
}

/* Whether a roll rate that an unknown needs is not measured: a channel without a sample counts as absent. */
static int fw_lacks_roll_rate(const fw_learner *learner, int unknown)
{
    const int channel = fw_roll_channel[unknown];
    int any = 0;
    for (int i = 0; i < FW_MEASURED_COUNT; i++) {
        any = ((any != 0) || (learner->mean_square[i] != FW_REAL(1.0))) ? 1 : 0; /* the first sample changes it */
    }
    if (channel < 0) {
        return (channel == -2) ? 1 : 0;
    }
    return ((any != 0) && (learner->mean_square[channel] == FW_REAL(1.0))) ? 1 : 0;
}

static fw_verdict fw_judge(const fw_learner *learner, int unknown, const fw_learned_value *estimate, fw_real z_sigma,
                           int doubtful)
{
    const fw_real below = estimate->value - fw_lower[unknown];
    const fw_real above = fw_upper[unknown] - estimate->value;
    const fw_real grown = (fw_logarithmic[unknown] != 0) ? (estimate->value / fw_centre[unknown]) : FW_REAL(1.0);
    const fw_real remaining = z_sigma * ((grown > FW_REAL(1.0)) ? grown : FW_REAL(1.0)); /* of the prior sigma */
    fw_verdict verdict = (doubtful != 0) ? FW_DOUBTFUL : FW_CONVERGED;
    if (fw_lacks_roll_rate(learner, unknown) != 0) {
        verdict = FW_NOT_IDENTIFIABLE;
    } else if (!(remaining < FW_EXCITED)) {
        verdict = FW_NOT_EXCITED;
    } else if (((below < above) ? below : above) < (FW_REAL(0.1) * estimate->sigma)) {
        verdict = FW_AT_BOUND;
    } else {
        /* converged or doubtful */
    }
    return verdict;
}

void fw_learner_estimates(fw_learner *learner, fw_learned_value estimates[FW_ESTIMATE_COUNT])
{
    const fw_inflated estimate = fw_inflate(learner, fw_finished_estimate(learner));
    fw_doubts doubts = {0};
    fw_real values[FW_P_COUNT];
    fw_to_values(estimate.evidence, values);
    fw_doubt_assumptions(&estimate, doubts);
    fw_doubt_unusual(&estimate, doubts);
    fw_doubt_innovations(learner, doubts);
    for (int k = 0; k < FW_ESTIMATE_COUNT; k++) {
        const int i = fw_reported[k];
        const int estimated = (i < FW_Z_COUNT) ? 1 : 0;
        const int doubtful = ((estimated != 0) && (fw_sensor_error[i] == 0)) ? doubts[i] : 0;
        const fw_real z_sigma = (estimated != 0) ? FW_SQRT(fw_covariance(&estimate, i, i)) : FW_REAL(1.0);
        fw_real value = (values[i] > fw_lower[i]) ? values[i] : fw_lower[i];
        value = (value < fw_upper[i]) ? value : fw_upper[i];
        estimates[k].value = value;
        estimates[k].sigma = z_sigma * ((fw_logarithmic[i] != 0) ? (value * fw_scale[i]) : fw_scale[i]);
        estimates[k].verdict = fw_judge(learner, i, &estimates[k], z_sigma, doubtful);
    }
}
