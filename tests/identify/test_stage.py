"""What feeds every sigma: the start's derivative, and how much a coloured residual is worth."""

import numpy as np
import pytest

from fifthwheel import dynamics
from fifthwheel.errors import SignalError
from fifthwheel.identify import TwoStage, Verdict, identify, parameters
from fifthwheel.identify.stage import begin, colour, moved
from fifthwheel.observe.noise import steady
from fifthwheel.observe.prepare import locked_but, prepare
from fifthwheel.simulate import response, simulate
from fifthwheel.vehicle import Vehicle

from .conftest import without


@pytest.mark.parametrize("roll", [False, True])
def test_the_start_follows_the_parameters(truck: Vehicle, roll: bool) -> None:
    record = simulate(truck, count=1).cut(1.5)
    own = locked_but(truck, record.signals, "record")
    outputs = ("yaw_rate.tractor", "yaw_rate.semitrailer")
    settings = TwoStage()
    unknowns = parameters.sought(own, parameters.stage_1_names(own), settings)
    unknowns += parameters.nuisances(own, outputs, settings)
    names = [u.name for u in unknowns]
    scaling = parameters.scaling(unknowns)
    rows = prepare(dynamics.model(own, outputs, roll=roll), own, record)
    z = np.random.default_rng(0).normal(size=len(names)) * 0.1
    x0, P0, derivative = begin(own, names, scaling, z, rows, roll=roll)

    def start(z: np.ndarray) -> np.ndarray:
        return steady(own, rows.first, dict(zip(names, scaling.to_p(z).tolist(), strict=True)), roll=roll)[0]

    np.testing.assert_allclose(x0, start(z))
    central = [(start(z + 1e-4 * e) - start(z - 1e-4 * e)) / 2e-4 for e in np.eye(len(z))]
    np.testing.assert_allclose(derivative, np.column_stack(central), atol=1e-4 * np.abs(derivative).max())
    assert np.abs(derivative).max() > 1e-3
    assert np.linalg.eigvalsh(P0).min() > 0


def test_colour_of_white_and_of_coloured_noise() -> None:
    random = np.random.default_rng(1)
    white = random.normal(size=20_000)
    assert colour(white, 100) == pytest.approx(1.0, abs=0.2)
    for rho in (0.5, 0.8):  # AR(1): long-run variance over variance is (1 + rho) / (1 - rho)
        series = np.empty_like(white)
        series[0] = white[0]
        for k in range(1, len(series)):
            series[k] = rho * series[k - 1] + white[k]
        assert colour(series, 200) == pytest.approx((1 + rho) / (1 - rho), rel=0.2)
    assert colour(np.tile([1.0, -1.0], 1000), 10) == 1.0  # worth more than white noise is not believed


def test_moved() -> None:
    settings = TwoStage(tolerance=0.01)
    assert not moved(0.0009, 1.0, 0.0, settings)
    assert moved(0.0011, 1.0, 0.0, settings)
    assert not moved(0.0011, 1.0, 0.1, settings)


def test_a_log_to_predict_does_not_change_what_is_identified(truck: Vehicle) -> None:
    record = simulate(truck, count=3, seed=1, name="steered")
    rear = 0.3 * record.signals["steer.tractor.front"]
    own = locked_but(truck, {"steer.tractor.front", "steer.semitrailer.rear"}, "")
    outputs = tuple(name for name in record.signals if "rate" in name)
    inputs = {n: record.signals[n] for n in ("speed", "steer.tractor.front")} | {"steer.semitrailer.rear": rear}
    model = dynamics.model(own, outputs, roll=True)
    _, y = response(model, dynamics.all_parameters(own, outputs), record.time, inputs)
    noise = np.random.default_rng(0).normal(size=y.shape) * [2e-2, 7e-3, 4e-3, 3.3e-3]
    steered = record.with_signals(inputs | {name: y[:, i] + noise[:, i] for i, name in enumerate(outputs)})
    other = simulate(truck, count=1, seed=2, name="other")
    found = identify([steered], truck)
    assert not any("steer.semitrailer.rear" in note for note in found.notes)
    for e in found.parameters:
        assert e.sigma is not None
        assert abs(e.value - truck.parameters()[e.name]) < 3 * e.sigma, e.name
        assert e.verdict is Verdict.CONVERGED
    for call in (lambda: identify([steered], truck, validate=[other]), lambda: identify([steered, other], truck)):
        with pytest.raises(SignalError, match=r"steer\.semitrailer\.rear: not in other, but in another log"):
            call()


def test_the_same_log_twice(truck: Vehicle) -> None:
    record = simulate(truck, count=1)
    with pytest.raises(SignalError, match="simulated given more than once"):
        identify([record, record], truck)


def test_settings_that_cannot_be() -> None:
    for wrong in ({"passes": 0}, {"prior": 0.0}, {"forgetting": 0.0}, {"noise": {"yaw_rate.tractor": 0.0}}):
        with pytest.raises(SignalError, match=next(iter(wrong)) if "noise" not in wrong else "yaw_rate"):
            TwoStage(**wrong)


def test_speed_about_the_limit(truck: Vehicle) -> None:
    record = without(simulate(truck, count=1))
    speed = np.where(np.arange(len(record)) % 2, 4.0, 6.0)
    with pytest.raises(SignalError, match="never at 5 m/s or above for two samples"):
        identify([record.with_signals({"speed": speed})], truck, TwoStage(check=False))
