"""The identified truck running free beside a log: how much of each channel it explains.

The model is linear in its initial state, in the road's bank if it has that, and in the zeros of its sensors, so all
come from one least-squares problem with their priors; nothing else is fitted. That makes logs comparable that were not
identified on.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from fifthwheel import dynamics
from fifthwheel.dynamics import ChainModel
from fifthwheel.identify.parameters import Unknown
from fifthwheel.identify.result import Fit
from fifthwheel.identify.stage import Log
from fifthwheel.logs import Record
from fifthwheel.observe import noise as variances
from fifthwheel.observe.prepare import in_time, swing
from fifthwheel.simulate import response
from fifthwheel.vehicle import Vehicle

Array = NDArray[np.float64]


def fits(
    model: ChainModel,
    vehicle: Vehicle,
    log: Log,
    unknowns: Sequence[Unknown],
    *,
    values: Mapping[str, float],
    identified_on: bool,
) -> list[Fit]:
    """Fit of every channel that the log has.

    Args:
        model: without free parameters.
        vehicle: as identified.
        values: steer gains and delays, shared by all logs.
    """
    pieces = [_free_run(model, vehicle, log, section, unknowns, values) for section in log.sections]
    found = []
    for i, name in enumerate(model.outputs):
        time, measured, predicted = (
            np.concatenate(arrays) for arrays in zip(*[(t, y[:, i], s[:, i]) for t, y, s in pieces], strict=True)
        )
        seen = np.isfinite(measured)
        if seen.sum() < 3 or np.var(measured[seen]) == 0:
            continue
        residual = (measured - predicted)[seen]
        found.append(
            Fit(
                log=log.name,
                signal=name,
                explained=float(1 - np.var(residual) / np.var(measured[seen])),
                rms=float(np.sqrt(np.mean(residual**2))),
                time=time,
                measured=measured,
                predicted=predicted,
                identified_on=identified_on,
            )
        )
    return found


def _free_run(
    model: ChainModel,
    vehicle: Vehicle,
    log: Log,
    section: Record,
    unknowns: Sequence[Unknown],
    values: Mapping[str, float],
) -> tuple[Array, Array, Array]:
    """Time (N,), measured and predicted outputs (N, m) of one section."""
    priors = {u.name: u for u in unknowns if u.each_log}
    p = dynamics.all_parameters(vehicle, model.outputs) | {k: v for k, v in values.items() if not k.endswith(".delay")}
    inputs = in_time(section, model.inputs, values)
    n, m = len(model.states), len(model.outputs)

    def run(x0: Array | None, steer: Mapping[str, Array]) -> Array:
        return response(model, p, section.time, inputs | dict(steer), x0)[1]

    first = {name: float(v[0]) for name, v in inputs.items()}
    bank = variances.INITIAL["bank"] if model.bank else None
    x0, P0 = variances.initial(vehicle, first, values, roll=model.roll, swing=swing(inputs), bank=bank)
    base = run(x0, {})
    still = {name: np.zeros_like(section.time) for name in model.inputs[1:]}
    quiet = run(None, still)
    columns = [run(row, still) - quiet for row in np.eye(n)]
    scales = list(np.sqrt(np.diag(P0)))
    for name in model.inputs[1:]:
        if f"{name}.offset" in priors:
            columns.append(run(None, still | {name: -np.ones_like(section.time)}) - quiet)
            scales.append(priors[f"{name}.offset"].scale)
    for i, name in enumerate(model.outputs):
        if f"{name}.offset" in priors:
            columns.append(np.tile(np.eye(m)[i], (len(section.time), 1)))
            scales.append(priors[f"{name}.offset"].scale)
    measured = np.column_stack(
        [section.signals.get(name, np.full(len(section.time), np.nan)) for name in model.outputs]
    )
    deviation = np.sqrt([variances.sensor(vehicle, name, log.noise) for name in model.outputs])
    design = np.stack(columns, axis=-1) * np.array(scales) / deviation[:, None]
    target = (measured - base) / deviation
    weight = np.isfinite(target).astype(float)
    for _ in range(3):  # outliers lose their weight, as they do at the filter's gate
        rows, right = design * weight[..., None], np.where(weight > 0, target, 0.0)
        normal = np.tensordot(rows, design, axes=([0, 1], [0, 1])) + np.eye(len(scales))
        solution = np.linalg.solve(normal, np.einsum("kmi,km->i", rows, right))
        misfit = np.abs(target - design @ solution)
        typical = max(1.0, float(np.nanmedian(misfit) / 0.6745))
        weight = (np.nan_to_num(misfit, nan=np.inf) < 6 * typical).astype(float)
    return section.time, measured, base + (design @ solution) * deviation
