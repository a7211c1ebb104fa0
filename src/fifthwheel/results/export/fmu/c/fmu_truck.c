/* The linear truck as the model of an FMU. Inputs change linearly during a step, by their derivatives; without these
   they are constant. The step of the model is fw_step() in fw_truck.h, which is generated. */

#include "fmu.h"

typedef double fw_real;

#include "fw_math.h"
#include "fw_truck.h"
#include "fw_step_length.h"

#define FW_MAX_STEPS 100000.0
#define FW_SQUARINGS 6

/* Upper bound of the magnitude of the fastest eigenvalue, 1/s, by Gelfand's formula: the norm of A^64, to the power of
   1/64. The norm is divided out of each power, so that it does not overflow. */
static double fastest_eigenvalue(const double *speed, const double *parameters)
{
    double a[FW_STATES * FW_STATES];
    double square[FW_STATES * FW_STATES];
    double norms[FW_SQUARINGS + 1];
    double bound = 1.0;
    fw_matrix(speed, parameters, a);
    for (int k = 0; k <= FW_SQUARINGS; k++) {
        double sum = 0.0;
        for (int i = 0; i < (FW_STATES * FW_STATES); i++) {
            sum += a[i] * a[i];
        }
        norms[k] = sqrt(sum);
        if (!(norms[k] > 0.0)) {
            return 0.0;
        }
        for (int i = 0; i < FW_STATES; i++) {
            for (int j = 0; j < FW_STATES; j++) {
                double element = 0.0;
                for (int m = 0; m < FW_STATES; m++) {
                    element += (a[(i * FW_STATES) + m] / norms[k]) * (a[(m * FW_STATES) + j] / norms[k]);
                }
                square[(i * FW_STATES) + j] = element;
            }
        }
        fw_copy(a, square, FW_STATES * FW_STATES);
    }
    for (int k = FW_SQUARINGS; k > 0; k--) {
        bound = sqrt(norms[k] * bound);
    }
    return norms[0] * bound;
}

/* The longest step of the model at a speed, s: that of the exported parameters, less in proportion if other parameters
   make the model faster. */
static double longest_step(double speed, const double *parameters)
{
    double exported[FW_PARAMETERS + 1];
    double longest = fw_longest_step(speed);
    int changed = 0;
    for (int i = 0; i < FW_PARAMETERS; i++) {
        exported[i] = fmu_variables[FMU_FIRST_PARAMETER + i].start;
        changed = ((changed != 0) || (exported[i] < parameters[i]) || (exported[i] > parameters[i])) ? 1 : 0;
    }
    if (changed != 0) {
        const double before = fastest_eigenvalue(&speed, exported);
        const double now = fastest_eigenvalue(&speed, parameters);
        longest *= (now > before) ? (before / now) : 1.0;
    }
    return longest;
}

void fmu_start(fmu_state *state)
{
    fw_fill(state->model.x, 0.0, FW_STATES);
}

void fmu_outputs(fmu_state *state)
{
    fw_outputs(state->model.x, &state->value[FMU_FIRST_INPUT], &state->value[FMU_FIRST_PARAMETER],
               &state->value[FMU_FIRST_OUTPUT]);
}

const char *fmu_step(fmu_state *state, double step)
{
    const double *parameters = &state->value[FMU_FIRST_PARAMETER];
    double *inputs = &state->value[FMU_FIRST_INPUT];
    double change[FW_INPUTS];
    double row[1 + (2 * FW_INPUTS)];
    double x[FW_STATES];
    double first;
    double second;
    double count;
    double last = 0.0;
    for (int i = 0; i < FW_INPUTS; i++) {
        const fmu_variable *variable = &fmu_variables[FMU_FIRST_INPUT + i];
        change[i] = state->slope[FMU_FIRST_INPUT + i] * step;
        if (!(((inputs[i] + change[i]) >= variable->least) && ((inputs[i] + change[i]) <= variable->most))) {
            return variable->expected;
        }
    }
    first = longest_step(inputs[0], parameters);
    second = longest_step(inputs[0] + change[0], parameters);
    count = ceil(step / ((first < second) ? first : second));
    if (!(count < FW_MAX_STEPS)) {
        return "communicationStepSize: the model needs too many steps at this speed; use a shorter one, or check the "
               "unit of the speed, m/s";
    }
    fw_copy(x, state->model.x, FW_STATES);
    for (int k = 1; (double)k <= count; k++) {
        const double now = step * ((double)k / count);
        row[0] = now - last;
        for (int i = 0; i < FW_INPUTS; i++) {
            row[1 + i] = inputs[i] + (change[i] * ((double)(k - 1) / count));
            row[1 + FW_INPUTS + i] = inputs[i] + (change[i] * ((double)k / count));
        }
        fw_step(x, row, parameters, x);
        last = now;
    }
    for (int i = 0; i < FW_STATES; i++) {
        if (!(fabs(x[i]) < INFINITY)) {
            return "states: not finite; the vehicle is unstable at this speed, or a parameter is wrong";
        }
    }
    fw_copy(state->model.x, x, FW_STATES);
    for (int i = 0; i < FW_INPUTS; i++) {
        inputs[i] += change[i];
    }
    fmu_outputs(state);
    return NULL;
}
