"""Compiled derivatives against central differences."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from fifthwheel.estimate.filters import Noise, tangent
from fifthwheel.estimate.filters.model import sizes
from fifthwheel.estimate.filters.step_rows import step_rows
from fifthwheel.estimate.filters.variances import PROCESS_VARIANCE, process_covariance
from fifthwheel.model import dynamics
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import get

YAW_RATES = ("yaw_rate.tractor", "yaw_rate.semitrailer")
Setting = tuple[dynamics.ChainModel, np.ndarray, np.ndarray]


def setting_of(third: str, *, roll: bool) -> Setting:
    """A model with all parameters free, the rows of a record with a gap in its third channel, and the parameters."""
    truck = get("cheng_cebon_2011")
    record = simulate(truck, count=1, seed=1).cut(0.5, 4.0)
    record = record.with_signals({"articulation.semitrailer": record.reference["articulation.semitrailer"]})
    truck = truck.with_logged_steering(record.signals, "the record")
    outputs = (*YAW_RATES, third)
    given = dynamics.all_parameters(truck, outputs)
    model = dynamics.model(truck, outputs, roll=roll, bank=True, free=tuple(given))
    rows = step_rows(model, truck, record)[:]
    rows[100:150, -1] = 0.0  # the weight of the last channel
    return model, rows, model.free_values(given)


@pytest.fixture(scope="module")
def setting() -> Setting:
    return setting_of("roll_rate.semitrailer", roll=True)


def outputs(
    run: Callable[..., Iterator[tangent.TangentChunk]],
    start: np.ndarray,
    p: np.ndarray,
    starts: np.ndarray,
    directions: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Outputs (N, n_output) and their derivatives (N, n_output_dot, k)."""
    values, slopes = [], []
    for chunk in run(start=start, start_directions=starts, p=p, directions=directions):
        values.append(chunk.values)
        slopes.append(np.zeros((*chunk.slopes.shape[:2], len(directions))))
        slopes[-1][..., chunk.directions] = chunk.slopes
    return np.concatenate(values), np.concatenate(slopes)


@pytest.mark.slow
@pytest.mark.parametrize("form", ["simulation_directions", "simulation_adjoint", "innovations"])
def test_derivatives(setting: Setting, form: str, monkeypatch) -> None:
    """Innovations of the yaw model: the code for the covariance of a yaw-roll model takes half a minute to compile."""
    model, rows, p = setting if form != "innovations" else setting_of("articulation.semitrailer", roll=False)
    n, _, _, _, m = sizes(model)
    rng = np.random.default_rng(0)
    monkeypatch.setattr(tangent, "CHUNK", 97)  # several chunks, the last one shorter
    count, x0 = 10, 0.01 * rng.normal(size=n)
    x0_directions = 0.01 * rng.normal(size=(count, n))
    if form != "innovations":
        discrepancy = np.array([1e-5, 0.0, 1e-4])
        scan, others = getattr(tangent, form)(model), np.concatenate([np.full(m, 1e-4), discrepancy, np.ones(m)])
        start, starts = tangent.simulation_start(x0, discrepancy, x0_directions)
    else:
        noise = Noise(
            process=process_covariance(model.states, PROCESS_VARIANCE), measurement=np.full(m, 1e-4), gate=5.0
        )
        scan, others = tangent.innovations_tangent(model), noise.vector()
        start, starts = tangent.innovations_start(x0, 1e-4 * np.eye(n), x0_directions)
    directions = 0.02 * np.maximum(np.abs(p), 1e-3) * rng.normal(size=(count, len(p)))
    directions[0] = 0.0  # along the initial state alone; its effect decays

    def run(*, p: np.ndarray, **arguments: Any) -> Iterator[tangent.TangentChunk]:
        return tangent.run_in_chunks(scan, rows, constant=np.concatenate([p, others]), **arguments)

    values, slopes = outputs(run, start, p, starts, directions)
    assert len(values) == len(rows)
    step, differentiated = 1e-4, slopes.shape[1]
    for j in range(count):
        shift = np.zeros_like(start)
        shift[: starts.shape[1]] = starts[j]
        ends = [
            outputs(
                run, start + s * shift, p + s * directions[j], np.zeros((0, starts.shape[1])), np.zeros((0, len(p)))
            )
            for s in (step, -step)
        ]
        expected = (ends[0][0] - ends[1][0])[:, :differentiated] / (2 * step)
        scale = np.abs(expected).max(axis=0) + 1e-12
        assert np.abs((slopes[..., j] - expected) / scale).max() < 1e-5


@pytest.mark.slow
def test_free_running_innovations_are_those_of_generalised_least_squares(
    setting: Setting,
) -> None:
    model, rows, p = setting
    n, _, _, _, m = sizes(model)
    r, q, tau = np.array([1e-4, 2e-4, 1e-4]), np.array([1e-5, 0.0, 1e-4]), np.array([0.5, 1.0, 0.05])

    def run(q: np.ndarray) -> np.ndarray:
        start, _ = tangent.simulation_start(np.zeros(n), q, np.zeros((0, n)))
        constant = np.concatenate([p, r, q, tau])
        nothing = np.zeros((0, n + m)), np.zeros((0, len(p)))
        scan = tangent.simulation_directions(model)
        return scan(start, rows, constant, *nothing).output

    white, coloured, time = run(np.zeros(m)), run(q), np.cumsum(rows[:, 0])
    for c in range(m):
        used = rows[:, c - m] > 0
        lags = np.abs(time[used][:, None] - time[used])
        covariance = q[c] * np.exp(-lags / tau[c]) + r[c] * np.eye(len(lags))
        factor = np.linalg.cholesky(covariance)
        innovation, variance = coloured[used, c], coloured[used, m + c]
        np.testing.assert_allclose(np.linalg.solve(factor, white[used, c]), innovation / np.sqrt(variance), atol=1e-8)
        np.testing.assert_allclose(variance, np.diag(factor) ** 2, rtol=1e-9)
