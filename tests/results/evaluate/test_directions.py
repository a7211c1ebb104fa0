"""Left and right turns apart: gradients, their difference, and what the offsets of the steer angle indicate."""

import numpy as np
import pytest

import fifthwheel as fw
from fifthwheel.data.record import Record
from fifthwheel.model.dynamics import steady_steer
from fifthwheel.results.evaluate.steady_state import directions, gradients
from tests.results.evaluate.conftest import U
from tests.results.evaluate.test_steady_state import STEER, YAW_RATE, steady_turns

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


def test_one_direction_has_no_difference(truck):
    names = [m.name for m in evaluated(truck, steady_turns(truck, "constant speed"))]
    assert names == ["understeer_gradient"]


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


def test_the_curve_of_the_tyre_forces_is_no_play(truck):
    """The steer angles at no lateral acceleration then differ by a little, with the other sign."""
    found = evaluated(truck, both(truck, 1, play=-0.0005, offset=0.0))
    assert not any("play" in note for note in found.notes)


def test_straight_driving_does_not_bring_play_into_the_gradients():
    """About straight ahead the wheels are between both contacts, and the steer angle says nothing on the direction."""
    a = np.concatenate([np.linspace(-0.2, 0.2, 20), np.linspace(0.4, 2, 40), np.linspace(-0.4, -2, 40)])
    X = np.column_stack([a, np.zeros_like(a), np.ones_like(a)])
    steer = 0.003 * a + 0.002 * np.clip(a / 0.3, -1, 1)
    for direction in directions(X, steer, a / U**2).values():
        assert abs(direction.gradient[0] - 0.003) < 1e-9


def test_a_significant_difference_names_its_causes(truck):
    found = evaluated(truck, both(truck, 1, change=2e-3, offset=0.0))
    assert found["understeer_gradient.difference"].reason.startswith("significant: uneven steering, load to one side")
    assert not any("At no lateral acceleration" in note for note in found.notes)


def test_intervals_contain_the_gradients_and_few_differences_are_significant():
    """On blocks of 1 s, with the noise of their means."""
    inside, significant, count = dict.fromkeys(APART, 0), 0, 200
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


def test_the_wheelbase_hardly_changes_the_difference(truck):
    uncertain = truck.with_stated({"tractor.front.position": 0.05})
    exact, wide = (evaluated(v, both(truck, 1)) for v in (truck, uncertain))
    assert np.sqrt(wide[APART[0]].sigma ** 2 - exact[APART[0]].sigma ** 2) == pytest.approx(0.05 / U**2, rel=0.05)
    assert wide[APART[2]].sigma == pytest.approx(exact[APART[2]].sigma, rel=0.02)
