/* The joint filter of states and unknowns. The equations of the vehicle are generated (fw_learner_model.c); this file
   holds the products of matrices around them. */

#include "fw_private.h"

#ifdef FW_FLOAT
#define FW_MAX_ESTIMATE 1e30f
#else
#define FW_MAX_ESTIMATE 1e100
#endif

/* The model at one point; see fw_linearise(). */
typedef struct {
    fw_real before[FW_X_COUNT];
    fw_real f[FW_F_COUNT]; /* without zeros */
    fw_real first[FW_SLOPES];
    fw_real last[FW_SLOPES];
    fw_real predicted[FW_MEASURED_COUNT];
    fw_real h[FW_MEASURED_COUNT * FW_X_COUNT];
    fw_real direct[FW_MEASURED_COUNT * FW_P_COUNT];
} fw_linear;

/* Place of element (i, i) of a lower triangle by columns. */
int fw_diagonal(int size, int i)
{
    return (i * size) - ((i * (i - 1)) / 2);
}

/* Values of all unknowns from those of the estimated ones; the others keep their prior mean. */
void fw_to_values(const fw_real *z, fw_real *p)
{
    for (int i = 0; i < FW_P_COUNT; i++) {
        const fw_real deviation = (i < FW_Z_COUNT) ? (fw_scale[i] * z[i]) : FW_REAL(0.0);
        p[i] = (fw_logarithmic[i] != 0) ? (fw_centre[i] * FW_EXP(deviation)) : (fw_centre[i] + deviation);
    }
}

/* Whether state, covariance or sensitivities are too large, or not numbers. */
static int fw_has_diverged(const fw_real *carry)
{
    fw_real sum = FW_REAL(0.0);
    for (int i = 0; i < FW_X_COUNT; i++) {
        sum += (carry[i] * carry[i]) + carry[FW_AT_P + fw_diagonal(FW_X_COUNT, i)];
    }
    for (int i = FW_AT_V; i < FW_AT_Z; i++) {
        sum += carry[i] * carry[i];
    }
    return (sum <= (FW_MAX_STATE * FW_MAX_STATE)) ? 0 : 1;
}

/* Moves the state with the estimates, to first order: x += dx/dz (to - from). */
static void fw_move_state(fw_real *carry, const fw_real *from, const fw_real *to)
{
    for (int i = 0; i < FW_X_COUNT; i++) {
        fw_real sum = FW_REAL(0.0);
        for (int j = 0; j < FW_Z_COUNT; j++) {
            sum += carry[FW_AT_V + (j * FW_X_COUNT) + i] * (to[j] - from[j]);
        }
        carry[i] += sum;
    }
}

/* P = F P F' + Q dt. */
static void fw_predict_covariance(fw_real *packed, const fw_real *f, fw_real dt)
{
    fw_real fp[FW_X_COUNT * FW_X_COUNT]; /* F P by columns */
    fw_real column[FW_X_COUNT];
    for (int j = 0; j < FW_X_COUNT; j++) {
        for (int i = 0; i < FW_X_COUNT; i++) {
            const int low = (i < j) ? i : j;
            const int high = (i < j) ? j : i;
            column[i] = packed[fw_diagonal(FW_X_COUNT, low) + high - low];
        }
        fw_transform(f, column, &fp[j * FW_X_COUNT]);
    }
    for (int i = 0; i < FW_X_COUNT; i++) { /* row i of F P, times F' */
        fw_real row[FW_X_COUNT];
        for (int k = 0; k < FW_X_COUNT; k++) {
            row[k] = fp[(k * FW_X_COUNT) + i];
        }
        fw_transform(f, row, column);
        for (int j = 0; j <= i; j++) {
            const int place = fw_diagonal(FW_X_COUNT, j) + i - j;
            packed[place] = column[j] + (fw_process[place] * dt);
        }
    }
}

/* dx/dz = F (dx/dz + first dt / 2) + last dt / 2. */
static void fw_predict_sensitivity(fw_real *v, const fw_linear *model, fw_real dt)
{
    const fw_real half = dt / FW_REAL(2.0);
    fw_real column[FW_X_COUNT];
    for (int k = 0; k < FW_SLOPES; k++) {
        v[fw_slope_place[k]] += half * model->first[k];
    }
    for (int j = 0; j < FW_P_COUNT; j++) {
        fw_transform(model->f, &v[j * FW_X_COUNT], column);
        fw_copy(&v[j * FW_X_COUNT], column, FW_X_COUNT);
    }
    for (int k = 0; k < FW_SLOPES; k++) {
        v[fw_slope_place[k]] += half * model->last[k];
    }
}

/* y += factor x, for columns; four elements in a turn, as below. */
static void fw_add(fw_real *y, fw_real factor, const fw_real *x, int count)
{
    int i = 0;
    for (; i < (count - 3); i += 4) {
        y[i] += factor * x[i];
        y[i + 1] += factor * x[i + 1];
        y[i + 2] += factor * x[i + 2];
        y[i + 3] += factor * x[i + 3];
    }
    for (; i < count; i++) {
        y[i] += factor * x[i];
    }
}

static fw_real fw_product(const fw_real *x, const fw_real *y, int count)
{
    fw_real sum = FW_REAL(0.0);
    int i = 0;
    for (; i < (count - 3); i += 4) {
        sum += x[i] * y[i];
        sum += x[i + 1] * y[i + 1];
        sum += x[i + 2] * y[i + 2];
        sum += x[i + 3] * y[i + 3];
    }
    for (; i < count; i++) {
        sum += x[i] * y[i];
    }
    return sum;
}

/* out = p s for a lower triangle by columns; most elements of s may be zero. */
static void fw_symmetric(int size, const fw_real *packed, const fw_real *s, fw_real *out)
{
    const fw_real *column = packed;
    fw_fill(out, FW_REAL(0.0), size);
    for (int j = 0; j < size; j++) {
        const int below = size - j - 1;
        if (s[j] != FW_REAL(0.0)) {
            fw_add(&out[j], s[j], column, below + 1);
        }
        out[j] += fw_product(&column[1], &s[j + 1], below);
        column = &column[below + 1];
    }
}

/* The update of the state by an innovation, with its gain; cross = P h', and `both` are the derivatives of the
   measurement with respect to all unknowns. */
static void fw_correct_state(fw_real *carry, const fw_real *gain, const fw_real *cross, const fw_real *h,
                             const fw_real *both, fw_real innovation, fw_real noise)
{
    fw_real rest[FW_X_COUNT]; /* K r - (I - K h) P h' */
    fw_real *column = &carry[FW_AT_P];
    for (int i = 0; i < FW_X_COUNT; i++) {
        rest[i] = noise * gain[i];
        for (int j = 0; j < FW_X_COUNT; j++) {
            if (h[j] != FW_REAL(0.0)) {
                const int low = (i < j) ? i : j;
                const int high = (i < j) ? j : i;
                const fw_real left = column[fw_diagonal(FW_X_COUNT, low) + high - low] - (gain[i] * cross[j]);
                rest[i] -= left * h[j];
            }
        }
    }
    fw_add(carry, innovation, gain, FW_X_COUNT);
    for (int j = 0; j < FW_X_COUNT; j++) {
        fw_add(column, -cross[j], &gain[j], FW_X_COUNT - j);
        fw_add(column, gain[j], &rest[j], FW_X_COUNT - j);
        column = &column[FW_X_COUNT - j];
    }
    for (int j = 0; j < FW_P_COUNT; j++) {
        fw_add(&carry[FW_AT_V + (j * FW_X_COUNT)], -both[j], gain, FW_X_COUNT);
    }
}

/* The update of the estimates by an innovation with its variances by state and estimates. `psi` and `rho` are its
   derivatives with respect to estimated and considered unknowns, cross = Pz psi'. */
static void fw_correct_estimates(fw_real *carry, const fw_real *cross, const fw_real *rho, fw_real innovation,
                                 fw_real of_state, fw_real of_estimates)
{
    const fw_real least = FW_PRECISION * of_estimates;
    const fw_real total = of_estimates + ((of_state > least) ? of_state : least);
    const fw_real factor = FW_REAL(1.0) / (of_state + of_estimates);
    fw_real gain[FW_Z_COUNT];
    fw_real rest[FW_Z_COUNT];
    fw_real *column = &carry[FW_AT_PZ];
    for (int i = 0; i < FW_Z_COUNT; i++) {
        gain[i] = cross[i] * (FW_REAL(1.0) / total);
        rest[i] = (total * gain[i]) - cross[i];
    }
    for (int i = 0; i < FW_Z_COUNT; i++) {
        const fw_real z = carry[FW_AT_Z + i] + (gain[i] * innovation);
        const fw_real above = (z > fw_lowest[i]) ? z : fw_lowest[i];
        carry[FW_AT_Z + i] = (above < fw_highest[i]) ? above : fw_highest[i];
    }
    for (int j = 0; j < FW_Z_COUNT; j++) {
        fw_add(column, -cross[j], &gain[j], FW_Z_COUNT - j);
        fw_add(column, gain[j], &rest[j], FW_Z_COUNT - j);
        column = &column[FW_Z_COUNT - j];
    }
    for (int c = 0; c < FW_CONSIDERED; c++) {
        const fw_real evidence = factor * rho[c];
        fw_add(&carry[FW_AT_B + (c * FW_Z_COUNT)], -rho[c], gain, FW_Z_COUNT);
        carry[FW_AT_GRADIENT + c] -= evidence * innovation;
        carry[FW_AT_INFORMATION + c] += evidence * rho[c];
    }
}

/* The update by measurement i. The prediction is that of the state `before` of the model and of the estimates `base`. */
static void fw_correct(fw_real *carry, const fw_real *row, const fw_linear *model, const fw_real *base, int i,
                       fw_update *update)
{
    const fw_real *const h = &model->h[i * FW_X_COUNT];
    const fw_real weight = (update->diverged != 0) ? FW_REAL(0.0) : row[FW_ROW_WEIGHTS + i];
    const int learn = (row[FW_ROW_LEARN] != FW_REAL(0.0)) ? 1 : 0;
    fw_real both[FW_P_COUNT];
    fw_real cross[FW_X_COUNT];
    fw_real cross_z[FW_Z_COUNT];
    fw_real rho[(FW_CONSIDERED > 0) ? FW_CONSIDERED : 1];
    fw_real at_base = row[FW_ROW_MEASURED + i] - model->predicted[i];
    fw_real innovation;
    fw_real of_state;
    fw_real of_estimates;
    fw_real of_considered = FW_REAL(0.0);
    fw_real total;
    if (!(weight > FW_REAL(0.0))) {
        return;
    }
    fw_copy(both, &model->direct[i * FW_P_COUNT], FW_P_COUNT);
    for (int k = 0; k < FW_X_COUNT; k++) {
        if (h[k] != FW_REAL(0.0)) {
            at_base -= h[k] * (carry[k] - model->before[k]);
            for (int j = 0; j < FW_P_COUNT; j++) {
                both[j] += h[k] * carry[FW_AT_V + (j * FW_X_COUNT) + k];
            }
        }
    }
    innovation = at_base;
    for (int j = 0; j < FW_Z_COUNT; j++) {
        innovation -= both[j] * (carry[FW_AT_Z + j] - base[j]);
    }
    for (int c = 0; c < FW_CONSIDERED; c++) {
        rho[c] = both[FW_Z_COUNT + c] + fw_product(both, &carry[FW_AT_B + (c * FW_Z_COUNT)], FW_Z_COUNT);
        of_considered += rho[c] * rho[c];
    }
    fw_symmetric(FW_X_COUNT, &carry[FW_AT_P], h, cross);
    fw_symmetric(FW_Z_COUNT, &carry[FW_AT_PZ], both, cross_z);
    of_state = fw_product(h, cross, FW_X_COUNT) + fw_noise[i];
    of_estimates = fw_product(both, cross_z, FW_Z_COUNT);
    total = of_state + of_estimates + of_considered;
    update->innovation[i] = weight * innovation / FW_SQRT(total);
    if ((innovation * innovation) <= (FW_SQUARED_GATE * total)) {
        fw_real gain[FW_X_COUNT];
        fw_real variance = of_state;
        fw_copy(gain, cross, FW_X_COUNT);
        if (learn == 0) { /* the gain of the state is optimal for P + V Pz V' */
            variance += of_estimates;
            for (int j = 0; j < FW_Z_COUNT; j++) {
                fw_add(gain, cross_z[j], &carry[FW_AT_V + (j * FW_X_COUNT)], FW_X_COUNT);
            }
        }
        for (int k = 0; k < FW_X_COUNT; k++) {
            gain[k] *= FW_REAL(1.0) / variance;
        }
        update->accepted = 1;
        fw_correct_state(carry, gain, cross, h, both, at_base, fw_noise[i]);
        if (learn != 0) {
            fw_correct_estimates(carry, cross_z, rho, innovation, of_state, of_estimates);
        }
    }
}

/* Whether an estimate is a number, with positive variances. */
static int fw_is_valid(const fw_real *carry)
{
    int valid = 1;
    for (int i = FW_AT_Z; (i < FW_CARRY_COUNT) && (valid != 0); i++) {
        valid = (FW_ABS(carry[i]) <= FW_MAX_ESTIMATE) ? 1 : 0;
    }
    for (int i = 0; (i < FW_Z_COUNT) && (valid != 0); i++) {
        valid = (carry[FW_AT_PZ + fw_diagonal(FW_Z_COUNT, i)] > FW_REAL(0.0)) ? 1 : 0;
    }
    return valid;
}

/* Processes one row of samples. The filter linearises at `base`, or at its own estimate if that is NULL. */
void fw_joint_step(fw_real *carry, const fw_real *row, const fw_real *base, fw_update *update)
{
    static const fw_update nothing = {.accepted = 0};
    fw_linear model = {.before = {FW_REAL(0.0)}};
    fw_real previous[FW_EVIDENCE_COUNT];
    fw_real point[FW_Z_COUNT];
    *update = nothing;
    update->diverged = fw_has_diverged(carry);
    for (int i = 0; (i < FW_AT_Z) && (update->diverged != 0); i++) {
        carry[i] = FW_REAL(0.0); /* avoids 0 times infinity below */
    }
    fw_copy(previous, &carry[FW_AT_Z], FW_EVIDENCE_COUNT);
    for (int i = 0; i < FW_Z_COUNT; i++) {
        point[i] = (base != NULL) ? (previous[i] + (base[i] - previous[i])) : previous[i];
    }
    fw_move_state(carry, &carry[FW_AT_Z], point);
    fw_linearise(carry, point, row, model.before, model.f, model.first, model.last, model.predicted, model.h,
                 model.direct);
    fw_predict_covariance(&carry[FW_AT_P], model.f, row[FW_ROW_DT]);
    fw_predict_sensitivity(&carry[FW_AT_V], &model, row[FW_ROW_DT]);
    fw_copy(carry, model.before, FW_X_COUNT);
    for (int i = 0; i < FW_Z_COUNT; i++) {
        fw_real *const variance = &carry[FW_AT_PZ + fw_diagonal(FW_Z_COUNT, i)];
        const fw_real room = FW_REAL(1.0) - *variance;
        *variance += (fw_walk[i] * row[FW_ROW_DT]) * ((room > FW_REAL(0.0)) ? room : FW_REAL(0.0));
    }
    for (int i = 0; i < FW_MEASURED_COUNT; i++) {
        fw_correct(carry, row, &model, point, i, update);
    }
    fw_move_state(carry, point, &carry[FW_AT_Z]);
    if (fw_is_valid(carry) == 0) {
        update->diverged = 1;
        fw_copy(&carry[FW_AT_Z], previous, FW_EVIDENCE_COUNT);
    }
}

/* Reported states, with variances that contain those of the unknowns. */
void fw_view(const fw_real *carry, const fw_real *row, fw_states *states)
{
    fw_real slope[FW_REPORT_SLOPES];
    fw_report(carry, &carry[FW_AT_Z], &row[FW_ROW_INPUTS], states->value, slope);
    for (int k = 0; k < FW_STATE_COUNT; k++) {
        fw_real by_x[FW_X_COUNT] = {FW_REAL(0.0)};
        fw_real by_p[FW_P_COUNT] = {FW_REAL(0.0)};
        fw_real cross[FW_X_COUNT];
        fw_real cross_z[FW_Z_COUNT];
        fw_real variance;
        for (int n = fw_report_start[k]; n < fw_report_start[k + 1]; n++) {
            const int i = fw_report_place[n];
            if (i < FW_X_COUNT) {
                by_x[i] = slope[n];
                for (int j = 0; j < FW_P_COUNT; j++) {
                    by_p[j] += slope[n] * carry[FW_AT_V + (j * FW_X_COUNT) + i];
                }
            } else {
                by_p[i - FW_X_COUNT] += slope[n];
            }
        }
        fw_symmetric(FW_X_COUNT, &carry[FW_AT_P], by_x, cross);
        fw_symmetric(FW_Z_COUNT, &carry[FW_AT_PZ], by_p, cross_z);
        variance = fw_product(by_x, cross, FW_X_COUNT) + fw_product(by_p, cross_z, FW_Z_COUNT);
        for (int c = 0; c < FW_CONSIDERED; c++) {
            const fw_real *const column = &carry[FW_AT_B + (c * FW_Z_COUNT)];
            const fw_real effect = by_p[FW_Z_COUNT + c] + fw_product(by_p, column, FW_Z_COUNT);
            variance += effect * effect;
        }
        states->sigma[k] = FW_SQRT((variance > FW_REAL(0.0)) ? variance : FW_REAL(0.0));
    }
}
