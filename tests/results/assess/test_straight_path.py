"""Tracking ability and stop on a straight path: the nonlinear truck, and what it adds to the linear model."""

import importlib

import numpy as np
import pytest

import fifthwheel as fw
from fifthwheel.base.errors import SignalError
from fifthwheel.base.units import STANDARD_GRAVITY as GRAVITY
from fifthwheel.model.plant import Plant
from fifthwheel.model.plant.rough_road import STEP, tracks
from fifthwheel.results.assess import longitudinal, nonlinear, steady_motion
from fifthwheel.results.assess.measures import STOP, STRAIGHT, TRACKING
from fifthwheel.results.assess.truck import Body, Truck
from tests.model.plant.golden_car import roughness_index

TRUCK = fw.vehicle("cheng_cebon_2011")


def test_the_road_has_the_roughness_index_of_the_standard() -> None:
    """3.8 m/km on each track over the 1000 m, which is class B of ISO 8608: 32e-6 to 128e-6 m^3."""
    height, _ = tracks(nonlinear.ROUGHNESS, 2.0, seed=0)
    start = round((nonlinear.SETTLED + 2.0) * nonlinear.TRACKING_SPEED / STEP)
    end = start + round(nonlinear.TRACKING_LENGTH / STEP)
    assert [roughness_index(side[start:end], STEP) for side in height] == pytest.approx([3.8, 3.8], rel=0.05)
    assert 32e-6 < nonlinear.ROUGHNESS < 128e-6


@pytest.mark.slow
def test_the_mean_positions_sweep_the_width_of_the_linear_model() -> None:
    pytest.importorskip("mujoco")
    truck = Truck(vehicle=TRUCK, speed=nonlinear.TRACKING_SPEED)
    widths = nonlinear.straight_path(truck)
    assert widths[STRAIGHT] == pytest.approx(steady_motion.measure_straight_path(truck)[STRAIGHT], abs=1e-3)
    assert 0.004 < widths[TRACKING] - widths[STRAIGHT] < 0.015


@pytest.fixture
def simulated(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fixed widths of the nonlinear truck, and two measures of the linear one."""
    module = importlib.import_module("fifthwheel.results.assess.assessment")
    monkeypatch.setattr(module, "FAMILIES", (steady_motion.measure_straight_path, steady_motion.measure_understeer))
    monkeypatch.setattr(nonlinear, "measures", lambda truck: ({STRAIGHT: 2.61, TRACKING: 2.91, STOP: 2.71}, {}, ()))


@pytest.mark.usefixtures("simulated")
def test_the_roughness_adds_to_the_linear_width() -> None:
    """With its sigma, at any speed alike, against thresholds that are not confirmed."""
    assessment = fw.assess(TRUCK, speed=15.0)
    at_speed = Truck(vehicle=TRUCK, speed=nonlinear.TRACKING_SPEED)
    measure, smooth = assessment[TRACKING], assessment[STRAIGHT]
    assert measure.value == pytest.approx(steady_motion.measure_straight_path(at_speed)[STRAIGHT] + 0.3)
    assert (measure.nonlinear, smooth.nonlinear) == (2.91, 2.61)
    assert assessment[STOP].value == pytest.approx(smooth.value + 0.1)
    assert not assessment[STOP].thresholds
    assert measure.sigma == pytest.approx(smooth.sigma, rel=1e-9)
    assert [(t.value, t.confirmed) for t in measure.thresholds] == [(v, False) for v in (2.9, 3.0, 3.1, 3.3)]
    assert measure.best_threshold().level == "2"
    assert measure.thresholds[0].probability < 0.5 < measure.thresholds[1].probability


@pytest.mark.usefixtures("simulated")
def test_a_truck_that_is_unstable_at_its_speed_has_none() -> None:
    assessment = fw.assess(fw.vehicle("auburn_6x4"), speed=30.0)
    assert [m.name for m in assessment] == ["understeer_gradient"]
    assert any("unstable at 108 km/h" in note for note in assessment.notes)


@pytest.mark.slow
def test_the_truck_holds_the_deceleration_of_the_stop() -> None:
    """0.39 to 0.42 g between 50 and 28 km/h; then it falls, and the stop ends at 10 km/h."""
    pytest.importorskip("mujoco")
    speed = Plant(TRUCK).drive(nonlinear.stop_course()).truth["speed"]
    within = (speed < 50 / 3.6) & (speed > 28 / 3.6)
    deceleration = -np.gradient(speed, 0.01)[within] / GRAVITY
    assert 0.39 < deceleration.min() < deceleration.max() < 0.42
    assert speed[: round(nonlinear.SETTLED * 100) - 20] == pytest.approx(60 / 3.6, abs=0.1)
    assert speed.min() < nonlinear.STOPPED


@pytest.mark.slow
def test_the_wheels_lock_that_need_more_friction_than_there_is() -> None:
    """The braking efficiency is the deceleration over the friction that the first group to lock needs.

    Within 15 %, as the friction of a tyre depends on its load, and the truck overshoots its deceleration.
    """
    pytest.importorskip("mujoco")
    brakes = {"tractor.front": 0.1, "tractor.drive": 0.5, "semitrailer": 0.4}
    truck = Truck(vehicle=TRUCK, body=Body(brakes=brakes))
    needed = longitudinal.DECELERATION / longitudinal.measure_braking(truck)["braking_efficiency"]
    factor = needed / 0.74  # of the peak friction
    widths, locked = nonlinear.stop(truck, 1.15 * factor)
    assert locked == ()
    assert widths[STOP] < widths[STRAIGHT] + 0.1
    widths, locked = nonlinear.stop(truck, 0.85 * factor)
    assert locked[0] == "tractor.drive"


@pytest.mark.slow
def test_a_truck_that_jackknifes_has_no_width() -> None:
    """All brakes on the drive axle, whose wheels lock on a dry road too."""
    pytest.importorskip("mujoco")
    with pytest.raises(SignalError, match="the semitrailer jackknifes"):
        nonlinear.stop(Truck(vehicle=TRUCK, body=Body.of({"brakes.tractor.drive": "100 %"})))


@pytest.mark.parametrize(("locked", "measured"), [((), True), (("tractor.drive", "semitrailer"), False)])
def test_a_stop_with_locked_wheels_is_only_a_note(
    locked: tuple[str, ...], measured: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("mujoco")
    monkeypatch.setattr(nonlinear, "stop", lambda truck: ({STRAIGHT: 2.6, STOP: 4.16}, locked))
    for manoeuvre in ("drive_lane_change", "pulse", "steady_off_tracking", "rollover_threshold", "straight_path"):
        monkeypatch.setattr(nonlinear, manoeuvre, _refused)
    values, _, notes = nonlinear.measures(Truck(vehicle=TRUCK))
    assert (STOP in values) == measured
    expected = (
        "Not assessed: swept width in a stop; without anti-lock control wheels lock, in this order: drive axle, trailer"
        " axle; the nonlinear truck then sweeps 4.2 m"
    )
    assert (expected in notes) != measured


def _refused(*_: object) -> None:
    raise SignalError("not driven")
