"""Accuracy of the states and consistency of their sigmas."""

import numpy as np
import pytest

from fifthwheel.base.errors import SignalError
from fifthwheel.estimate.observe import Observer, ObserverSettings, Status
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import Vehicle
from tests.estimate.observe.conftest import EXACT, ROLLS, STEER, YAWS, but_settling, pushed
from tests.model.dynamics.test_lagrangian import b_double as lagrangian_b_double

DEGREE = np.pi / 180


@pytest.fixture(scope="module")
def b_double() -> Vehicle:
    """Three units, the last one with one group and a steered axle in it whose angle is not logged."""
    fields = lagrangian_b_double().model_dump()
    fields["units"][2]["axle_groups"] = fields["units"][2]["axle_groups"][1:]
    return Vehicle(**fields)


def rms(error: np.ndarray) -> float:
    return float(np.sqrt(np.mean(error**2)))


def test_sideslip_roll_and_articulation_of_the_linear_truck(truck, lane_changes):
    actual = Observer(truck, lane_changes.signals).batch(lane_changes)
    assert {"sideslip.semitrailer", "roll.semitrailer", "articulation.semitrailer"} <= lane_changes.reference.keys()
    for name, truth in lane_changes.reference.items():
        assert np.ptp(truth) > 0.2 * DEGREE, name
        assert rms(actual.values[name] - truth) < 0.05 * DEGREE, name


def test_start_within_a_lane_change(truck, lane_changes):
    """For any first sample the errors agree with sigma, and few samples are rejected."""
    for start in np.arange(1.0, 4.5, 0.5):
        record = lane_changes.cut(start)
        actual = Observer(truck, record.signals).batch(record)
        for name, truth in record.reference.items():
            error = actual.values[name] - truth
            assert np.abs(error / actual.sigma[name]).max() < 4.5, (name, start)
            assert rms(error[100:]) < 0.05 * DEGREE, (name, start)
        for name, accepted in actual.accepted.items():
            assert accepted[:100].mean() > 0.95, (name, start)


@pytest.mark.slow
def test_three_units(b_double):
    record = simulate(b_double, count=1, seed=1, roll=False)
    assert "steer.last.steered" not in record.signals
    o = Observer(b_double, record.signals)
    assert o.inputs == ("speed", "steer.tractor.front")
    assert [n for n in o.reported if n.endswith(".last")] == ["sideslip.last", "yaw_rate.last", "articulation.last"]
    actual = o.batch(record)
    assert (but_settling(actual.status) == Status.OK).all()
    assert len(record.reference) == 5
    for name, truth in record.reference.items():
        assert rms(actual.values[name] - truth) < 0.1 * DEGREE, name
        assert np.abs((actual.values[name] - truth) / actual.sigma[name]).max() < 4, name


@pytest.mark.slow
def test_logged_steer_angle_of_a_trailer_axle(truck):
    """It is an input; an axle whose angle is not logged is locked."""
    axle = "steer.semitrailer.rear"
    assert axle in truck.steer_signals()
    record = simulate(truck, count=1, roll=False)
    locked, straight, steered = (
        Observer(truck, r.signals, ObserverSettings(**EXACT)).batch(r)
        for r in (record, *(record.with_signals({axle: np.full(len(record), angle)}) for angle in (0.0, 0.03)))
    )
    for name in locked.values:
        np.testing.assert_allclose(straight.values[name], locked.values[name], rtol=0, atol=1e-12)
    assert np.abs(steered.values["articulation.semitrailer"] - locked.values["articulation.semitrailer"])[0] > 0.01


@pytest.mark.slow
def test_sensors_of_articulation_and_roll_angles_are_used(truck):
    angles = {"articulation.semitrailer": 0.005**2, "roll.tractor": 1e-6, "roll.semitrailer": 1e-6}
    record = simulate(truck, count=1, sensors={YAWS[0]: 1.5e-5, **angles})
    o = Observer(truck, record.signals)
    assert o.roll
    assert o.outputs == (YAWS[0], "articulation.semitrailer", "roll.tractor", "roll.semitrailer")
    actual = o.batch(record)
    without = o.batch(record.with_signals({name: np.full(len(record), np.nan) for name in angles}))
    for name in angles:
        assert actual.sigma[name][-1] < 0.9 * without.sigma[name][-1], name
    for name, truth in record.reference.items():
        assert rms(actual.values[name] - truth) < 0.12 * DEGREE, name


def test_yaw_model_without_roll_signals(truck):
    record = simulate(truck, count=2, roll=False, seed=2)
    assert not any("roll" in name for name in (*record.signals, *record.reference))
    o = Observer(truck, record.signals)
    assert not o.roll
    assert o.reported == (
        "sideslip.tractor",
        "sideslip.semitrailer",
        "yaw_rate.tractor",
        "yaw_rate.semitrailer",
        "articulation.semitrailer",
    )
    actual = o.batch(record)
    for name, truth in record.reference.items():
        assert rms(actual.values[name] - truth) < 0.05 * DEGREE, name
    assert o.batch(record).innovation.keys() == set(YAWS)


def test_sensor_errors_are_corrected(truck, lane_changes):
    errors = {f"{STEER}.offset": 0.01, f"{STEER}.gain": 1.1} | {
        f"{name}.offset": offset for name, offset in zip((*YAWS, *ROLLS), (0.02, -0.015, 0.03, -0.01), strict=True)
    }
    measured = {name: lane_changes.signals[name] + errors[f"{name}.offset"] for name in (*YAWS, *ROLLS)}
    measured[STEER] = lane_changes.signals[STEER] / 1.1 + 0.01
    record = lane_changes.with_signals(measured)
    expected = Observer(truck, lane_changes.signals).batch(lane_changes)
    corrected = Observer(truck, record.signals, ObserverSettings(sensor_errors=errors)).batch(record)
    wrong, tolerance = Observer(truck, record.signals).batch(record), 1e-5
    for name in expected.values:
        # the initial state depends on the logged steer angle
        np.testing.assert_allclose(corrected.values[name][400:], expected.values[name][400:], rtol=0, atol=tolerance)
        # the least effect is that on the trailer's sideslip, 0.96e-3 rad
        assert np.abs(wrong.values[name] - expected.values[name])[400:].mean() > 90 * tolerance, name
    start = record.cut(0, 2)
    streamed = pushed(Observer(truck, record.signals, ObserverSettings(sensor_errors=errors)), start)
    np.testing.assert_array_equal(
        streamed["sideslip.semitrailer"], corrected.values["sideslip.semitrailer"][: len(start)]
    )


def test_steer_offset_is_corrected_in_the_initial_state(truck, lane_changes):
    record = lane_changes.with_signals({STEER: lane_changes.signals[STEER] + 0.03}).cut(0, 0.5)  # straight
    actual = Observer(truck, record.signals, ObserverSettings(sensor_errors={f"{STEER}.offset": 0.03})).batch(record)
    for name, truth in record.reference.items():
        assert abs(actual.values[name] - truth)[0] < 0.2 * DEGREE, name


def test_steer_delay_is_corrected(truck, lane_changes):
    delay = 0.05
    steer = np.interp(lane_changes.time - delay, lane_changes.time, lane_changes.signals[STEER])
    record = lane_changes.with_signals({STEER: steer})
    settings = ObserverSettings(sensor_errors={f"{STEER}.delay": delay})
    name = "sideslip.semitrailer"
    corrected, uncorrected = (
        rms(Observer(truck, record.signals, s).batch(record).values[name] - lane_changes.reference[name])
        for s in (settings, None)
    )
    assert corrected < 0.05 * DEGREE
    assert corrected < uncorrected


@pytest.mark.slow
def test_lower_noise_gives_lower_sigma(truck, lane_changes):
    """If the sensors are as good as they are said to be; otherwise the innovations show it, and sigma rises."""
    lane_changes = lane_changes.cut(0, 6)
    settings = ObserverSettings(noise={YAWS[0]: 1e-8, YAWS[1]: 1e-8})
    usual = Observer(truck, lane_changes.signals).batch(lane_changes)
    precise = lane_changes.with_signals({name: usual.values[name] for name in YAWS})
    low, contradicted = (Observer(truck, r.signals, settings).batch(r) for r in (precise, lane_changes))
    assert low.sigma[YAWS[0]][-1] < 1.1e-4 < contradicted.sigma[YAWS[0]][-1] < usual.sigma[YAWS[0]][-1]
    assert low.sigma["sideslip.semitrailer"][-1] < usual.sigma["sideslip.semitrailer"][-1]


@pytest.mark.parametrize(
    ("available", "starts"),
    [
        ({"speed", *YAWS}, r"^steer\.tractor\.front: not in the signals"),
        ({STEER, *YAWS}, r"^speed: not among the signals"),
        ({"speed", STEER}, r"^yaw_rate\.tractor: not among the signals"),
        ({"speed", STEER, "lateral_acceleration.tractor"}, r"^yaw_rate\.tractor: "),
        ({"speed", STEER, "yaw_rate.lorry"}, r"^yaw_rate\.tractor: "),
        ({"speed", STEER, "articulation.tractor"}, r"^yaw_rate\.tractor: "),
        ({"speed", "steer.tractor.drive", *YAWS}, r"^steer\.tractor\.front: "),
        (set(), r"^steer\.tractor\.front: "),
    ],
)
def test_missing_signals_are_refused(truck, available, starts):
    with pytest.raises(SignalError, match=starts):
        Observer(truck, available)


def test_record_without_a_signal_of_the_observer_is_refused(truck, lane_changes):
    o = Observer(truck, {*lane_changes.signals, "articulation.semitrailer"})
    with pytest.raises(SignalError, match=r"^articulation\.semitrailer: not in simulated"):
        o.batch(lane_changes)
