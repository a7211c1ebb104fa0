"""Steady-state tests: gradients against the equations, by all three methods, with noise, and on a real truck."""

import os
from pathlib import Path

import numpy as np
import pytest

import fifthwheel as fw
from fifthwheel.base.errors import SignalError
from fifthwheel.data.logs import SignalMap, read_log
from fifthwheel.data.record import Record
from fifthwheel.model.dynamics import linear_system, steady_steer
from fifthwheel.results.evaluate.steady_state import directions, gradients
from fifthwheel.truck import get
from tests.estimate.identify.test_real_log import MAP
from tests.results.evaluate.conftest import NOISE, U

DATA = Path(os.environ.get("FIFTHWHEEL_DATA", Path(__file__).resolve().parents[4] / "shared" / "data")) / "real_truck"
STEER, YAW_RATE = "steer.tractor.front", "yaw_rate.tractor"


def steady_turns(truck, method, seed=None, rate=20.0, offset=0.01):
    """A log of steady turns by the closed form of the steer angle, to the left, with noise and a steering offset."""
    wheelbase, gradient = steady_steer(truck)
    time = np.arange(0, 40, 1 / rate)
    acceleration = np.linspace(0.2, 1.9, time.size)
    if method == "constant speed":
        speed = np.full_like(time, U)
    elif method == "constant radius":
        speed = np.sqrt(acceleration * 100.0)
        acceleration, speed = acceleration[speed > 6], speed[speed > 6]
    elif method == "mixed driving":
        speed = 18 + 4 * np.sin(2 * np.pi * time / 40)
    else:  # (L / u^2 + K) a is constant
        speed = np.sqrt(wheelbase * acceleration / (0.02 - gradient * acceleration))
        acceleration, speed = acceleration[speed > 6], speed[speed > 6]
    yaw_rate, steer = acceleration / speed, (wheelbase / speed**2 + gradient) * acceleration + offset
    if seed is not None:
        noise = np.random.default_rng(seed).normal(size=(2, speed.size))
        yaw_rate, steer = yaw_rate + 2e-3 * noise[0], steer + 1e-3 * noise[1]
    signals = {"speed": speed, STEER: steer, YAW_RATE: yaw_rate}
    return Record(time=time[: speed.size], signals=signals, name=method)


@pytest.mark.parametrize("method", ["constant speed", "constant radius", "constant steer", "mixed driving"])
def test_each_method_gives_the_gradient_of_the_equations(truck, method):
    found = fw.evaluate(steady_turns(truck, method), "steady_state", vehicle=truck)
    assert found["understeer_gradient"].value == pytest.approx(steady_steer(truck)[1], rel=1e-6)
    assert f"Method: {method}" in found.notes[0]
    assert [m.name for m in found] == ["understeer_gradient"]  # one direction has no difference
    assert list(found.plots()) == ["Steer angle less Ackermann angle"]
    if method == "constant speed":
        x, y = found.arrays["lateral_acceleration"], found.arrays["steer_less_ackermann"]
        assert y == pytest.approx(steady_steer(truck)[1] * x + 0.01, abs=1e-9)


def test_without_a_vehicle_there_is_no_understeer_gradient(truck):
    log = steady_turns(truck, "constant speed")
    with pytest.raises(SignalError, match="vehicle: needed for the understeer gradient"):
        fw.evaluate(log, "steady_state")
    found = fw.evaluate(log.with_signals({"roll.tractor": 0.03 * U * log.signals[YAW_RATE]}), "steady_state")
    assert [m.name for m in found] == ["roll_gradient.tractor"]
    assert found["roll_gradient.tractor"].value == pytest.approx(0.03)
    assert "no understeer gradient" in found.notes[-1]
    assert not any("A scale error of the steer angle" in note for note in found.notes)


def test_the_uncertainty_of_the_wheelbase_is_in_sigma(truck):
    uncertain = truck.with_stated({"tractor.front.position": 0.05})
    log = steady_turns(truck, "constant speed", 1)
    exact, wide = (fw.evaluate(log, "steady_state", vehicle=v)["understeer_gradient"] for v in (truck, uncertain))
    assert wide.value == exact.value
    assert np.sqrt(wide.sigma**2 - exact.sigma**2) == pytest.approx(0.05 / U**2, rel=0.05)
    assert "by the wheelbase" in wide.reason
    turned = steady_turns(truck, "constant radius", 1)
    exact, wide = (fw.evaluate(turned, "steady_state", vehicle=v)["understeer_gradient"] for v in (truck, uncertain))
    assert wide.sigma == pytest.approx(exact.sigma, rel=0.05)


@pytest.mark.parametrize("variances", [dict.fromkeys(NOISE, 0.0), NOISE], ids=["exact", "noisy"])
def test_the_slowly_increasing_steer_of_the_linear_model(truck, variances):
    """The lag of the ramp does not bias the gradients, whose closed form is the gain of the steady state."""
    log = fw.simulate(truck, manoeuvre="slowly_increasing_steer", speed=U, sensors=variances, seed=3)
    found = fw.evaluate(log, "steady_state", vehicle=truck, check=False)  # without noise both roll angles are equal
    names = ["yaw_rate.tractor", "sideslip.tractor", "roll.tractor", "roll.semitrailer"]
    rate, *gains = linear_system(truck, U, names).gain()[:, 0]
    exact = {"understeer_gradient": steady_steer(truck)[1]}
    exact |= {n.replace(".", "_gradient.", 1): gain / (U * rate) for n, gain in zip(names[1:], gains, strict=True)}
    for name, value in exact.items():
        sigma = found[name].sigma
        assert (sigma is None) == name.startswith("sideslip"), name  # a reference signal
        tolerance = 3 * sigma if sigma is not None and variances is NOISE else 0.01 * abs(value)
        assert found[name].value == pytest.approx(value, abs=tolerance), name
        assert sigma is None or 0 < sigma < 0.3 * abs(value), name


def test_one_acceleration_only_and_logs_without_slow_turns_are_refused(truck):
    """A straight entry and one circle; lane changes and random steering."""
    log = steady_turns(truck, "constant speed", 1)
    turn = np.interp(log.time, [2.0, 6.0], [0.0, 1.5 / U])
    steer = (steady_steer(truck)[0] / U + steady_steer(truck)[1] * U) * turn
    with pytest.raises(SignalError, match=r"without any tenth of it.* drive circles at several accelerations"):
        fw.evaluate(log.with_signals({YAW_RATE: turn, STEER: steer}), "steady_state", vehicle=truck, check=False)
    for manoeuvre in ("lane_changes", "random"):
        log = fw.simulate(truck, manoeuvre=manoeuvre, duration=48)
        with pytest.raises(SignalError, match=r"quasi-steady motion with a range of lateral acceleration .* slowly"):
            fw.evaluate(log, "steady_state", vehicle=truck)


@pytest.fixture(scope="module")
def bend() -> Record:
    if not DATA.is_dir():
        pytest.skip("the logs of the real truck are not present")
    return read_log(DATA / "run01_s_bend.csv", SignalMap.parse(MAP), name="bend")


def test_the_bend_of_a_real_truck(bend):
    """Bends to both sides at 10 Hz, whose lateral acceleration changes by up to 0.6 m/s^2 in 1 s: a wide sigma."""
    found = fw.evaluate(bend, "steady_state", vehicle=get("auburn_6x4"))
    gradient = found["understeer_gradient"]
    assert 0.001 < gradient.sigma < 0.004
    assert abs(gradient.value) < 0.01
    assert {c.name: c.met for c in found.conditions}["sampling rate"] is False
    assert any("changes by up to 0.5" in note for note in found.notes)


@pytest.mark.slow
def test_the_bend_agrees_with_the_identified_truck(bend):
    """With the identified gain of the steer angle, the gradient is that of the identified truck."""
    result = fw.identify([bend], get("auburn_6x4"))
    gain = next(e for e in result.sensors if e.name == "steer.tractor.front.gain")
    scaled = bend.with_signals({STEER: gain.value * bend.signals[STEER]})
    found = fw.evaluate(scaled, "steady_state", vehicle=result.vehicle)["understeer_gradient"]
    by_gain = gain.sigma * steady_steer(result.vehicle)[0] / 12.5**2
    assert abs(found.value - steady_steer(result.vehicle)[1]) < 2 * np.hypot(found.sigma, by_gain)


APART = ("understeer_gradient.left", "understeer_gradient.right", "understeer_gradient.difference")


def both(truck, seed=None, *, play=0.0, change=0.0, offset=0.01):
    """Steady turns at a constant speed to the left and then to the right, with a change of the gradient to the left."""
    time = np.arange(0, 80, 0.05)
    wheelbase, gradient = steady_steer(truck)
    a = np.interp(time, [0, 35, 45, 80], [0.2, 1.9, -1.9, -0.2])
    speed = np.full_like(time, U)
    yaw_rate = a / U
    steer = wheelbase / U**2 * a + gradient * a + change * np.maximum(a, 0) + play / 2 * np.sign(a) + offset
    if seed is not None:
        noise = np.random.default_rng(seed).normal(size=(2, time.size))
        yaw_rate, steer = yaw_rate + 2e-3 * noise[0], steer + 1e-3 * noise[1]
    return Record(time=time, signals={"speed": speed, STEER: steer, YAW_RATE: yaw_rate}, name="both")


def evaluated(truck, log):
    return fw.evaluate(log, "steady_state", vehicle=truck)


def test_each_direction_has_its_gradient(truck):
    found = evaluated(truck, both(truck, change=2e-3))
    left, right, difference = (found[name] for name in APART)
    assert right.value == pytest.approx(steady_steer(truck)[1], rel=1e-3)
    assert left.value == pytest.approx(steady_steer(truck)[1] + 2e-3, rel=1e-3)
    assert difference.value == pytest.approx(left.value - right.value)
    assert left.title == "understeer gradient, left"
    found = evaluated(truck, both(truck, 1, change=2e-3, offset=0.0))
    assert found["understeer_gradient.difference"].reason.startswith("significant: uneven steering, load to one side")
    assert not any("At no lateral acceleration" in note for note in found.notes)


def test_offset_and_play_are_named_and_not_in_the_gradients(truck):
    found = evaluated(truck, both(truck, 1, play=0.008, offset=0.01))
    notes = " ".join(found.notes)
    assert "the steer angle is 0.57" in notes
    assert "larger after turns to the left than to the right by 0.4" in notes
    assert "play of the steering, or bends that are banked inwards" in notes
    exact = steady_steer(truck)[1]
    assert abs(found["understeer_gradient.left"].value - exact) < 3 * found["understeer_gradient.left"].sigma
    assert found["understeer_gradient"].value - exact > 2e-3  # the play counts as understeer
    assert not found["understeer_gradient.difference"].reason
    curved = evaluated(truck, both(truck, 1, play=-0.0005, offset=0.0))  # by the tyre forces, with the other sign
    assert not any("play" in note for note in curved.notes)


def test_intervals_contain_the_gradients_and_few_differences_are_significant():
    """On blocks of 1 s, with the noise of their means."""
    inside, significant, count = dict.fromkeys(APART, 0), 0, 100
    a = np.interp(np.arange(80), [0, 35, 45, 80], [0.2, 1.9, -1.9, -0.2])
    X = np.column_stack([a, np.gradient(a), np.ones_like(a)])
    for seed in range(count):
        steer = 0.003 * a + 0.01 + 2e-4 * np.random.default_rng(seed).normal(size=a.size)
        for found in gradients(directions(X, steer, a / U**2), 0.0, YAW_RATE):
            exact = 0.0 if found.name == APART[2] else 0.003
            inside[found.name] += abs(found.value - exact) < 1.645 * found.sigma
            significant += bool(found.reason)
    assert all(0.82 * count <= number <= 0.97 * count for number in inside.values()), inside
    assert significant <= 0.03 * count
