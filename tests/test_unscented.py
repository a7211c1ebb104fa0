"""The unscented filters of the benchmark benchmarks/filters.py."""

import sys
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from fifthwheel.data.record import Record
from fifthwheel.estimate.observe import ObserverSettings, offline
from fifthwheel.model.simulate import simulate

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "benchmarks"))
import unscented
from filters import TRUCK, Filter, Samples, correlations, covariances, observer_model

WITHOUT_LAG = TRUCK.replace({f"{path}.relaxation_length": 0.0 for path in TRUCK.axle_loads()})
SIGNALS = ("speed", "steer.tractor.front", "yaw_rate.tractor", "yaw_rate.semitrailer")
"""Of the yaw model, whose step is compiled fast."""


def lane_change(seed: int = 1) -> Record:
    """One lane change with missing and wrong measurements."""
    record = simulate(WITHOUT_LAG, count=1, seed=seed)
    signals = {name: record.signals[name].copy() for name in SIGNALS}
    signals["yaw_rate.tractor"][50:90] = np.nan
    signals["yaw_rate.semitrailer"][70:120:7] = 1.0  # outside the gate
    return Record(time=record.time, signals=signals, name="lane change")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("form", "settings"),
    [("square root", ObserverSettings()), ("covariance", ObserverSettings(bank=0.0, steer_offset=0.0))],
    ids=["square root, uncertain", "covariance, exact"],
)
def test_linear_tyres_give_the_kalman_filter(form: Filter, settings: ObserverSettings) -> None:
    """Also with a considered bank, missing and rejected measurements, and a singular covariance."""
    record = lane_change()
    expected, actual = (
        offline.states(record, observer_model(WITHOUT_LAG, SIGNALS, settings, kind), None, smooth=False)
        for kind in ("linear", form)
    )
    assert not all(accepted.all() for accepted in expected.accepted.values())
    for name, values in expected.values.items():
        np.testing.assert_allclose(actual.values[name], values, rtol=0, atol=1e-9 * np.abs(values).max())
        np.testing.assert_allclose(actual.sigma[name], expected.sigma[name], rtol=1e-6)
    np.testing.assert_allclose(actual.nis, expected.nis, rtol=1e-6)


def test_mean_and_variance_of_a_square() -> None:
    """x^2 and x y of a normal distribution: the means are exact, and so is the covariance with the state."""
    mean, root = np.array([1.0, -2.0]), np.array([[0.3, 0.0], [0.2, 0.4]])
    x, S = ca.SX.sym("x", 2), ca.SX.sym("S", 2, 2)
    spread = unscented.unscented(lambda state: ca.vertcat(state[0] ** 2, state[0] * state[1]), x, S)
    function = ca.Function("spread", [x, S], list(spread))
    y, odd, even = (np.array(part) for part in function(mean, root))
    P = root @ root.T
    np.testing.assert_allclose(y[:, 0], [1.0 + P[0, 0], -2.0 + P[0, 1]])
    slope = np.array([[2.0, 0.0], [-2.0, 1.0]])
    np.testing.assert_allclose(odd @ root.T, slope @ P)
    assert np.abs(even).max() > 0.01
    assert np.linalg.eigvalsh(odd @ odd.T + even @ even.T).min() > 0


def test_square_roots_of_singular_matrices() -> None:
    wide = np.random.default_rng(1).normal(size=(4, 6))
    wide[2] = 2 * wide[0] - wide[1]
    P = wide @ wide.T
    P[3], P[:, 3] = 0.0, 0.0
    matrix = ca.SX.sym("P", 4, 4)
    lower = np.array(ca.Function("cholesky", [matrix], [ca.densify(unscented.cholesky(matrix))])(P))
    np.testing.assert_allclose(lower @ lower.T, P, atol=1e-12)
    wide[3] = 0.0
    matrix = ca.SX.sym("W", 4, 6)
    lower = np.array(ca.Function("lower", [matrix], [ca.densify(unscented.lower_triangular(matrix))])(wide))
    np.testing.assert_allclose(lower @ lower.T, P, atol=1e-12)
    np.testing.assert_array_equal(lower, np.tril(lower))


@pytest.mark.parametrize("form", ["extended", pytest.param("square root", marks=pytest.mark.slow)])
def test_no_covariance_becomes_indefinite(form: Filter) -> None:
    """On ice with violent steering and arbitrary measurements, all of them accepted."""
    rng = np.random.default_rng(3)
    settings = ObserverSettings(friction=0.05, gate=1e6)
    model = observer_model(WITHOUT_LAG, SIGNALS, settings, form)
    time = np.arange(300) * 0.01
    signals = {
        "speed": np.full(300, 25.0),
        "steer.tractor.front": 0.4 * np.sin(2 * time),
        **{name: 0.5 * rng.normal(size=300) for name in SIGNALS[2:]},
    }
    carry, rows, constant = Samples.of(model, Record(time=time, signals=signals, name="noise"))
    carries = np.array([carry := model.scan(carry, row[None], constant)[0] for row in rows])
    assert np.isfinite(carries).all()
    assert np.linalg.eigvalsh(correlations(covariances(carries, model))).min() > 0
