"""Compiled derivatives against central differences."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from fifthwheel import dynamics, vehicle
from fifthwheel.filters import Noise, tangent
from fifthwheel.filters.model import sizes
from fifthwheel.filters.step_rows import step_rows
from fifthwheel.filters.variances import PROCESS_VARIANCE, process_covariance
from fifthwheel.simulate import simulate

OUTPUTS = ("yaw_rate.tractor", "yaw_rate.semitrailer", "roll_rate.semitrailer")


@pytest.fixture(scope="module")
def setting() -> tuple[dynamics.ChainModel, np.ndarray, np.ndarray]:
    """A model with all parameters free, the rows of a record with a gap in one channel, and the parameters."""
    truck = vehicle.get("cheng_cebon_2011")
    record = simulate(truck, count=1, seed=1).cut(0.5, 4.0)
    truck = truck.with_logged_steering(record.signals, "the record")
    given = dynamics.all_parameters(truck, OUTPUTS)
    model = dynamics.model(truck, OUTPUTS, roll=True, bank=True, free=tuple(given))
    rows = step_rows(model, truck, record).rows.copy()
    rows[100:150, -1] = 0.0  # the weight of the last channel
    return model, rows, model.free_values(given)


def outputs(
    run: Callable[..., Iterator[tangent.Chunk]],
    start: np.ndarray,
    p: np.ndarray,
    starts: np.ndarray,
    directions: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    chunks = list(run(start=start, start_directions=starts, p=p, directions=directions))
    return np.concatenate([c.values for c in chunks]), np.concatenate([c.slopes for c in chunks], axis=1)


@pytest.mark.parametrize("form", ["simulation", "innovations"])
def test_derivatives(setting: tuple[dynamics.ChainModel, np.ndarray, np.ndarray], form: str, monkeypatch) -> None:
    model, rows, p = setting
    n, n_d, _, _, m = sizes(model)
    rng = np.random.default_rng(0)
    monkeypatch.setattr(tangent, "CHUNK", 97)  # several chunks, the last one shorter
    x0 = 0.01 * rng.normal(size=n)
    if form == "simulation":
        scan, rows, others, start = tangent.simulation_tangent(model), rows[:, : 1 + n_d], np.zeros(0), x0
    else:
        noise = Noise(
            process=process_covariance(model.states, PROCESS_VARIANCE), measurement=np.full(m, 1e-4), gate=5.0
        )
        scan, others = tangent.innovations_tangent(model), noise.vector()
        start, _ = tangent.initial_carry(x0, 1e-4 * np.eye(n), np.zeros((1, n)))
    count = 6
    starts = np.zeros((count, len(start)))
    starts[:, :n] = 0.01 * rng.normal(size=(count, n))
    directions = 0.02 * np.maximum(np.abs(p), 1e-3) * rng.normal(size=(count, len(p)))

    def run(**arguments: Any) -> Iterator[tangent.Chunk]:
        return tangent.run_in_chunks(scan, rows, others=others, **arguments)

    values, slopes = outputs(run, start, p, starts, directions)
    assert len(values) == len(rows)
    none = np.zeros((1, len(p)))
    step = 1e-4
    for j in range(count):
        ends = [
            outputs(run, start + s * starts[j], p + s * directions[j], np.zeros((1, len(start))), none)[0]
            for s in (step, -step)
        ]
        expected = (ends[0] - ends[1]) / (2 * step)
        scale = np.abs(expected).max(axis=0) + 1e-12
        assert np.abs((slopes[j] - expected) / scale).max() < 1e-5
