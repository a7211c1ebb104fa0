"""Evaluations of the nonlinear truck are near those of the linear model."""

import numpy as np
import pytest

import fifthwheel as fw
from fifthwheel.data.record import Record
from fifthwheel.model.manoeuvres import constant_radius, course
from fifthwheel.model.plant import Plant
from tests.results.evaluate.conftest import U

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def driven(truck):
    """The log of a course with the article's gyros, and roll angles as reference."""
    plant, logs = Plant(truck), dict[str, Record]()

    def log(driven_course):
        if driven_course.name not in logs:
            run = plant.drive(driven_course, rate=50.0, seed=1).record(seed=1)
            kept = {name: run.reference[name] for name in run.reference if name.startswith(("roll.", "articulation."))}
            logs[driven_course.name] = Record(time=run.time, signals=run.signals, reference=kept, name="driven")
        return logs[driven_course.name]

    return log


def test_constant_radius_and_constant_speed_give_similar_understeer_gradients(truck, driven):
    """Load transfer softens the front tyres more, so the gradient rises with the lateral acceleration: the circle, from
    0.6 m/s^2 on, has a larger one than the ramp from 0."""
    circle = driven(constant_radius(radius=100.0, speed=8.0, acceleration=0.1, duration=70.0))
    rising = driven(course("slowly_increasing_steer", truck, speed=U))
    found = [fw.evaluate(log, "steady_state", vehicle=truck) for log in (circle, rising)]
    assert ["constant radius" in found[0].notes[0], "constant speed" in found[1].notes[0]] == [True, True]
    one, other = (e["understeer_gradient"] for e in found)
    linear = fw.summarize(truck).understeer_gradient
    assert linear < other.value < one.value < linear + 0.0015  # rad s^2/m
    assert max(one.sigma, other.sigma) < 1e-4
    rolls = [e["roll_gradient.semitrailer"].value for e in found]
    assert rolls[0] == pytest.approx(rolls[1], rel=0.05)


def test_an_ordinary_drive_informs_on_the_understeer_gradient(truck, driven):
    drive = driven(course("everyday", truck, seed=1, duration=120.0))
    rising = driven(course("slowly_increasing_steer", truck, speed=U))
    found, ramp = (fw.evaluate(log, "steady_state", vehicle=truck) for log in (drive, rising))
    assert "Method: mixed driving" in found.notes[0]
    gradient = found["understeer_gradient"]
    assert 0 < gradient.sigma < 6e-4  # 0.34 deg/g
    assert abs(gradient.value - ramp["understeer_gradient"].value) < 2 * gradient.sigma


@pytest.mark.parametrize(
    ("test", "manoeuvre", "measure", "tolerance"),
    [
        ("step", "step", "steady_gain.yaw_rate.tractor", 0.12),
        ("step", "step", "response_time.yaw_rate.semitrailer", 0.12),
        ("lane_change", "lane_changes", "rearward_amplification_yaw_rate", 0.05),
        ("pulse", "pulse", "yaw_damping", 0.1),
        ("frequency_response", "random", "bandwidth.articulation.semitrailer", 0.1),
    ],
)
def test_its_dynamics_are_near_those_of_the_linear_model(truck, driven, test, manoeuvre, measure, tolerance):
    """Its tyres are softer in the manoeuvres by up to 8 %."""
    options = {"count": 2} if test == "lane_change" else {}
    logs = [
        driven(course(manoeuvre, truck, speed=U, **options)),
        fw.simulate(truck, manoeuvre=manoeuvre, speed=U, rate=50.0, **options),
    ]
    angle = "articulation.semitrailer"  # measured: a yaw rate has another decay
    plant, linear = (fw.evaluate(r.with_signals({angle: r.reference[angle]}), test, vehicle=truck) for r in logs)
    assert plant[measure].value == pytest.approx(linear[measure].value, rel=tolerance)


def test_the_yaw_rate_decays_after_a_sine_with_dwell(truck, driven):
    found = fw.evaluate(driven(course("sine_with_dwell", truck, speed=U)), "sine_with_dwell", vehicle=truck)
    ratios = [found[f"yaw_rate_ratio_{t}ms.yaw_rate.semitrailer"].value for t in (1000, 1750)]
    assert max(np.abs(ratios)) < 0.5
