"""Response of a model to speed and steer angles, without noise."""

from collections.abc import Mapping

import casadi as ca
import numpy as np

from fifthwheel.base.native import Scan, compiled
from fifthwheel.base.types import Array
from fifthwheel.model.dynamics import ChainModel, steps


def free_response(
    model: ChainModel, values: Mapping[str, float], time: Array, inputs: Mapping[str, Array], x0: Array | None = None
) -> tuple[Array, Array]:
    """States (N, n) and outputs (N, m) of a model without free parameters, from its state x0 at the first sample.

    `values` are all its parameters, `inputs` speed and steer angles (N,), by name, SI. A SignalError as in
    `steps.step_counts`.
    """
    columns = steps.input_columns(inputs, model.inputs)
    vehicle = model.vehicle.replace({name: values[name] for name in model.vehicle.parameters()})
    limit = steps.step_limit(vehicle, model.roll)(columns[:, 0])
    fine, columns, indices = steps.subdivide(time, columns, limit)
    dt, d = steps.step_inputs(fine, columns)
    start = np.zeros(len(model.states)) if x0 is None else x0
    _, out = _simulator(model)(start, np.column_stack([dt, d]), model.known_values(values))
    samples = out[indices]
    return samples[:, : len(model.states)], samples[:, len(model.states) :]


@compiled(Scan)
def _simulator(model: ChainModel) -> ca.Function:
    """The compiled step: carry = x; sample = [dt, d]; constant = c; output = [x+, y]."""
    n, k, c = len(model.states), 2 * len(model.inputs), len(model.known)
    x, row, constant = ca.SX.sym("x", n), ca.SX.sym("row", 1 + k), ca.SX.sym("c", c)
    no_p = ca.SX(0, 1)
    later = model.transition(x, row[0], row[1:], no_p, constant)
    y = model.observation(later, row[1:], no_p, constant)
    return ca.Function("simulate", [x, row, constant], [later, ca.vertcat(later, y)], {"cse": True})
