"""The load transfer ratio of axle groups, and the warning before a wheel lifts."""

import numpy as np
import pytest

from fifthwheel.base.errors import SignalError
from fifthwheel.data.channels.table import HORIZON
from fifthwheel.data.record import Record
from fifthwheel.estimate.observe import (
    Observer,
    ObserverSettings,
    Status,
    Uncertainty,
    parameter_variance,
    time_to_lift,
)
from fifthwheel.model.manoeuvres import braked
from fifthwheel.model.manoeuvres.courses import OpenLoop
from fifthwheel.model.manoeuvres.open_loops import single_sine, step_input
from fifthwheel.model.plant import Plant, article_sensors, measure
from fifthwheel.model.simulate import simulate
from fifthwheel.results.report import conclude_states
from fifthwheel.truck import Vehicle, get
from tests.estimate.observe.conftest import EXACT

pytestmark = pytest.mark.slow

TRUCK = get("cheng_cebon_2011")
SENSORS = article_sensors(TRUCK)
LANE_CHANGES = simulate(TRUCK, count=1, seed=3)
FRICTION = 0.74
"""Of the nonlinear truck's tyres at large slip."""


def driven(vehicle: Vehicle, course: OpenLoop) -> tuple[Record, dict[str, np.ndarray]]:
    """A run with the article's sensors, and the true load transfer ratio of each axle group."""
    run = Plant(vehicle).drive(course, until_rollover=True)
    truth = {}
    for unit in vehicle.units:
        for group in unit.axle_groups:
            axles = [f"{unit.name}.{axle.name}" for axle in group.axles]
            loads = [run.truth[f"vertical_force.{axle}"] for axle in axles]
            moved = sum(load * run.truth[f"load_transfer.{axle}"] for axle, load in zip(axles, loads, strict=True))
            truth[f"load_transfer.{unit.group_path(group)}"] = moved / sum(loads)
    signals = measure(run.time, run.truth, {n: s for n, s in SENSORS.items() if n in LANE_CHANGES.signals}, seed=1)
    lifted = np.any([np.abs(v) > 0.995 for n, v in run.truth.items() if n.startswith("load_transfer.")], axis=0)
    return Record(time=run.time, signals=signals, name="run"), truth | {"lifted": lifted}


def test_a_warning_before_the_first_wheel_of_the_nonlinear_truck_lifts() -> None:
    """In a sine; the ratio of the trailer is right until then. Errors are 0.04."""
    vehicle, name = TRUCK.replace({"semitrailer.payload.height": 3.2}), "load_transfer.semitrailer"
    record, truth = driven(vehicle, single_sine(vehicle, acceleration=3.0, duration=6.0))
    states = Observer(vehicle, record.signals, ObserverSettings(friction=FRICTION, **EXACT)).batch(record)
    assert truth["lifted"].any()
    end = int(truth["lifted"].argmax())
    assert np.abs(states.values[name] - truth[name])[100:end].max() < 0.05
    assert np.abs(truth[name][:end]).max() > 0.4
    warned = states.lift_warning[100:]
    assert warned.any()
    assert record.time[end] - record.time[100 + int(warned.argmax())] > 0.5
    (line,) = [line for line in conclude_states([states], [record]).results if "lift" in line]
    first = states.time[states.lift_warning.argmax()]
    assert line == f"run: a wheel of semitrailer is about to lift at {first:.1f} s."


def test_a_single_wrong_steer_angle_is_no_warning() -> None:
    observer = Observer(TRUCK, LANE_CHANGES.signals)
    assert not observer.batch(LANE_CHANGES).lift_warning.any()
    for k, error in zip(range(50, len(LANE_CHANGES), 97), [0.03, -0.03] * 9, strict=False):
        steer = LANE_CHANGES.signals["steer.tractor.front"].copy()
        steer[k] += error
        states = observer.batch(LANE_CHANGES.with_signals({"steer.tractor.front": steer}))
        assert not states.lift_warning.any(), k


def test_load_transfer_in_a_turn() -> None:
    """With a sideslip of 3.5 deg the trailer pulls back, which takes 5 % of the load off the front axle.

    Without this load, errors are 0.04, 0.09 and 0.08, and the observer is inconsistent in half of the turn.
    """
    record, truth = driven(TRUCK, step_input(TRUCK, acceleration=4.0, duration=6.0))
    states = Observer(TRUCK, record.signals, ObserverSettings(friction=FRICTION, **EXACT)).batch(record)
    assert not (states.status == Status.INCONSISTENT).any()
    for name in (name for name in truth if name != "lifted"):
        assert np.abs(states.values[name] - truth[name])[100:].max() < 0.04, name


def test_load_transfer_while_braking() -> None:
    """At 3 m/s^2 and up to 0.56; without the load that braking moves, errors are 0.05, 0.04 and 0.08."""
    course = braked(single_sine(TRUCK, acceleration=2.5, lead=2.0, duration=8.0), 3.0)
    record, truth = driven(TRUCK, course)
    states = Observer(TRUCK, record.signals, ObserverSettings(friction=FRICTION, **EXACT)).batch(record)
    for group, limit in (("tractor.front", 0.03), ("tractor.drive", 0.035), ("semitrailer", 0.06)):
        name = f"load_transfer.{group}"
        assert np.abs(states.values[name] - truth[name])[100:].max() < limit


def test_the_prediction_is_the_ratio_at_its_horizon() -> None:
    """After a step of the steer angle, which then stays as the prediction assumes."""
    exact = simulate(TRUCK, manoeuvre="step", sensors={n: 1e-12 for n, s in SENSORS.items() if s.variance})
    states = Observer(TRUCK, exact.signals, ObserverSettings(**EXACT)).batch(exact)
    later = round(HORIZON / 0.01)
    for name in (name for name in states.values if name.startswith("load_transfer.")):
        ahead, predicted = states.values[name][later:], states.values[f"predicted_{name}"][:-later]
        turned = states.time[:-later] > 1.15
        assert np.abs(predicted - ahead)[turned].max() < 0.03 * np.abs(ahead).max()


@pytest.mark.parametrize(
    ("now", "later", "sigma", "time"),
    [
        (0.5, 0.85, 0.05, 0.6),  # s; the limit is 0.9 less sigma
        (-0.5, -0.85, 0.04, np.inf),
        (-0.5, -0.9, 0.25, 0.3),  # sigma counts up to 0.2
        (0.91, 0.7, 0.0, 0.0),
        (0.1, 0.2, 9.0, np.inf),
        (np.nan, np.nan, np.nan, np.nan),
    ],
)
def test_time_to_lift(now: float, later: float, sigma: float, time: float) -> None:
    answer = {"load_transfer.x": now, "predicted_load_transfer.x": later, "predicted_load_transfer.x.sigma": sigma}
    answer |= {"load_transfer.y": 0.1, "predicted_load_transfer.y": -0.1, "predicted_load_transfer.y.sigma": 0.1}
    assert time_to_lift(answer) == pytest.approx(time, nan_ok=True)


def test_the_time_to_lift_is_unknown_without_ratios() -> None:
    assert np.isnan(time_to_lift({"yaw_rate.tractor": 0.1}))
    with pytest.raises(SignalError, match=r"^predicted_load_transfer\.x\.sigma: needed beside"):
        time_to_lift({"load_transfer.x": 0.1, "predicted_load_transfer.x": 0.2})


def test_half_track() -> None:
    narrow, wide = (
        Observer(TRUCK, LANE_CHANGES.signals, ObserverSettings(half_track=b)).batch(LANE_CHANGES) for b in (0.9, 1.0)
    )
    for name in ("load_transfer.tractor.drive", "predicted_load_transfer.semitrailer"):
        np.testing.assert_allclose(0.9 * narrow.values[name], wide.values[name], rtol=1e-9)
    with pytest.raises(SignalError, match="half_track: expected"):
        ObserverSettings(half_track=25.0)


def test_uncertain_half_track_and_mass_are_in_sigma(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parameter_variance, "SPACING", 0.0)  # no interpolation
    observer = Observer(TRUCK, LANE_CHANGES.signals, ObserverSettings(**EXACT))
    known = observer.batch(LANE_CHANGES)
    name = "load_transfer.semitrailer"

    def part(parameter: str, sigma: float) -> np.ndarray:
        uncertain = observer.batch(LANE_CHANGES, Uncertainty(names=(parameter,), covariance=[[sigma**2]]))
        return np.sqrt(np.maximum(uncertain.sigma[name] ** 2 - known.sigma[name] ** 2, 0.0))

    np.testing.assert_allclose(part("body.half_track", 0.03), 0.03 * np.abs(known.values[name]), rtol=1e-4, atol=1e-7)
    heavier = TRUCK.replace({"semitrailer.mass": 1.001 * TRUCK.parameters()["semitrailer.mass"]})
    change = Observer(heavier, LANE_CHANGES.signals, ObserverSettings(**EXACT)).batch(LANE_CHANGES).values[name]
    ratio = part("semitrailer.mass", 33.45) / np.abs(change - known.values[name])
    assert 0.8 < np.median(ratio) < 1.25


def test_none_without_roll_and_where_the_static_loads_are_not_determined() -> None:
    """A trailer whose axles are two groups has three supports."""
    yaw_only = [name for name in LANE_CHANGES.signals if not name.startswith("roll_rate")]
    assert not any("load_transfer" in name for name in Observer(TRUCK, yaw_only).reported)
    fields = TRUCK.model_dump()
    (group,) = fields["units"][1]["axle_groups"]
    first, *others = group["axles"]
    fields["units"][1]["axle_groups"] = [{**group, "name": "lift", "axles": [first]}, {**group, "axles": others}]
    vehicle = Vehicle(**fields)
    states = Observer(vehicle, LANE_CHANGES.signals).batch(LANE_CHANGES)
    assert not any("load_transfer" in name for name in states.values)
    assert not states.lift_warning.any()
