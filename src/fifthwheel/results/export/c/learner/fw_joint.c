/* The joint filter of states and unknowns. The equations of the vehicle and the update by one measurement are generated
   (fw_learner_model.c); this file holds the products of matrices around them. */

#include "fw_private.h"

#ifdef FW_FLOAT
#define FW_MAX_ESTIMATE 1e30f
#else
#define FW_MAX_ESTIMATE 1e100
#endif

/* The model at one point; see fw_linearise(). */
typedef struct {
    fw_real before[FW_X_COUNT];
    fw_real f[FW_X_COUNT * FW_X_COUNT];
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

/* out = f in, for a column; most elements of f are zero. */
static void fw_transform(const fw_real *f, const fw_real *in, fw_real *out)
{
    for (int i = 0; i < FW_X_COUNT; i++) {
        fw_real sum = FW_REAL(0.0);
        for (int k = 0; k < FW_X_COUNT; k++) {
            const fw_real factor = f[(i * FW_X_COUNT) + k];
            if (factor != FW_REAL(0.0)) {
                sum += factor * in[k];
            }
        }
        out[i] = sum;
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

/* The updates by all measurements, one after another. */
static void fw_correct_all(fw_real *carry, const fw_real *row, const fw_linear *model, const fw_real *base,
                           fw_update *update)
{
    fw_real channel[5 + (2 * FW_X_COUNT) + FW_P_COUNT + FW_Z_COUNT];
    fw_real *const h = &channel[5];
    fw_real *const direct = &h[FW_X_COUNT];
    fw_real *const before = &direct[FW_P_COUNT];
    fw_copy(before, model->before, FW_X_COUNT);
    fw_copy(&before[FW_X_COUNT], base, FW_Z_COUNT);
    for (int i = 0; i < FW_MEASURED_COUNT; i++) {
        fw_real out[2];
        channel[0] = row[FW_ROW_MEASURED + i];
        channel[1] = (update->diverged != 0) ? FW_REAL(0.0) : row[FW_ROW_WEIGHTS + i];
        channel[2] = fw_noise[i];
        channel[3] = model->predicted[i];
        channel[4] = row[FW_ROW_LEARN];
        fw_copy(h, &model->h[i * FW_X_COUNT], FW_X_COUNT);
        fw_copy(direct, &model->direct[i * FW_P_COUNT], FW_P_COUNT);
        fw_correct(carry, channel, carry, out);
        update->accepted = ((update->accepted != 0) || (out[0] != FW_REAL(0.0))) ? 1 : 0;
        update->innovation[i] = out[1];
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
    fw_correct_all(carry, row, &model, point, update);
    fw_move_state(carry, point, &carry[FW_AT_Z]);
    if (fw_is_valid(carry) == 0) {
        update->diverged = 1;
        fw_copy(&carry[FW_AT_Z], previous, FW_EVIDENCE_COUNT);
    }
}

/* s P s' for a lower triangle by columns. */
static fw_real fw_quadratic(int size, const fw_real *packed, const fw_real *s)
{
    fw_real sum = FW_REAL(0.0);
    for (int j = 0; j < size; j++) {
        const fw_real *const column = &packed[fw_diagonal(size, j)];
        sum += column[0] * s[j] * s[j];
        for (int i = j + 1; i < size; i++) {
            sum += FW_REAL(2.0) * column[i - j] * s[i] * s[j];
        }
    }
    return sum;
}

/* Reported states, with variances that contain those of the unknowns. */
void fw_view(const fw_real *carry, const fw_real *row, fw_states *states)
{
    enum { VEHICLE = FW_MODEL_STATES + FW_BANKS, ALL = VEHICLE + FW_P_COUNT };
    fw_real slope[FW_STATE_COUNT * ALL];
    fw_report(carry, &carry[FW_AT_Z], &row[FW_ROW_INPUTS], states->value, slope);
    for (int k = 0; k < FW_STATE_COUNT; k++) {
        fw_real by_x[FW_X_COUNT] = {FW_REAL(0.0)};
        fw_real by_p[FW_P_COUNT];
        fw_real variance;
        fw_copy(by_x, &slope[k * ALL], VEHICLE);
        for (int j = 0; j < FW_P_COUNT; j++) {
            by_p[j] = slope[(k * ALL) + VEHICLE + j];
            for (int i = 0; i < VEHICLE; i++) {
                by_p[j] += by_x[i] * carry[FW_AT_V + (j * FW_X_COUNT) + i];
            }
        }
        variance = fw_quadratic(FW_X_COUNT, &carry[FW_AT_P], by_x) + fw_quadratic(FW_Z_COUNT, &carry[FW_AT_PZ], by_p);
        for (int c = 0; c < FW_CONSIDERED; c++) {
            fw_real effect = by_p[FW_Z_COUNT + c];
            for (int j = 0; j < FW_Z_COUNT; j++) {
                effect += by_p[j] * carry[FW_AT_B + (c * FW_Z_COUNT) + j];
            }
            variance += effect * effect;
        }
        states->sigma[k] = FW_SQRT((variance > FW_REAL(0.0)) ? variance : FW_REAL(0.0));
    }
}
