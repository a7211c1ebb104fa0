"""Evaluations of the nonlinear truck are near those of the linear model."""

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


def test_a_circle_a_ramp_and_an_ordinary_drive_give_similar_understeer_gradients(truck, driven):
    """Load transfer softens the front tyres more, so the gradient rises with the lateral acceleration: the circle, from
    0.6 m/s^2 on, has a larger one than the ramp from 0."""
    circle = driven(constant_radius(radius=100.0, speed=8.0, acceleration=0.1, duration=70.0))
    rising = driven(course("slowly_increasing_steer", truck, speed=U))
    drive = driven(course("everyday", truck, seed=1, duration=120.0))
    *found, everyday = (fw.evaluate(log, "steady_state", vehicle=truck) for log in (circle, rising, drive))
    assert ["constant radius" in found[0].notes[0], "constant speed" in found[1].notes[0]] == [True, True]
    one, other = (e["understeer_gradient"] for e in found)
    linear = fw.summarize(truck).understeer_gradient
    assert linear < other.value < one.value < linear + 0.0015  # rad s^2/m
    assert max(one.sigma, other.sigma) < 1e-4
    assert "Method: mixed driving" in everyday.notes[0]
    gradient = everyday["understeer_gradient"]
    assert 0 < gradient.sigma < 6e-4  # 0.34 deg/g
    assert abs(gradient.value - other.value) < 2 * gradient.sigma
    rolls = [e["roll_gradient.semitrailer"].value for e in found]
    assert rolls[0] == pytest.approx(rolls[1], rel=0.05)


@pytest.mark.parametrize(
    ("test", "manoeuvre", "measure", "tolerance"),
    [
        ("step", "step", "steady_gain.yaw_rate.tractor", 0.12),
        ("lane_change", "lane_changes", "rearward_amplification_yaw_rate", 0.05),
        ("pulse", "pulse", "yaw_damping", 0.1),
    ],
)
def test_its_dynamics_are_near_those_of_the_linear_model(truck, driven, test, manoeuvre, measure, tolerance):
    """Its tyres are softer in the manoeuvres by up to 8 %."""
    options = {"count": 2} if test == "lane_change" else {}
    linear = fw.simulate(truck, manoeuvre=manoeuvre, speed=U, rate=50.0, **options)
    logs = [driven(course(manoeuvre, truck, speed=U, **options)), linear]
    angle = "articulation.semitrailer"  # measured: a yaw rate has another decay
    plant, linear = (fw.evaluate(r.with_signals({angle: r.reference[angle]}), test, vehicle=truck) for r in logs)
    assert plant[measure].value == pytest.approx(linear[measure].value, rel=tolerance)
