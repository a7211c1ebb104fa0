"""Tracking ability on a straight path: the plant on the rough road, and what it adds to the linear model."""

import importlib

import numpy as np
import pytest

import fifthwheel as fw
from fifthwheel.assess import nonlinear, steady_motion
from fifthwheel.assess.measures import STRAIGHT, TRACKING
from fifthwheel.assess.truck import Truck
from fifthwheel.plant.rough_road import STEP, tracks
from tests.plant.golden_car import roughness_index

TRUCK = fw.vehicle("cheng_cebon_2011")


def test_the_road_has_the_roughness_index_of_the_standard() -> None:
    """3.8 m/km on each track over the 1000 m, which is class B of ISO 8608: 32e-6 to 128e-6 m^3."""
    height, _ = tracks(nonlinear.ROUGHNESS, 2.0, seed=0)
    start = round((nonlinear.SETTLED + 2.0) * steady_motion.TRACKING_SPEED / STEP)
    end = start + round(nonlinear.STRAIGHT_LENGTH / STEP)
    assert [roughness_index(side[start:end], STEP) for side in height] == pytest.approx([3.8, 3.8], rel=0.05)
    assert 32e-6 < nonlinear.ROUGHNESS < 128e-6


def test_the_mean_positions_sweep_the_width_of_the_linear_model() -> None:
    pytest.importorskip("mujoco")
    truck = Truck(vehicle=TRUCK, speed=steady_motion.TRACKING_SPEED)
    widths = nonlinear.straight_path(truck)
    assert widths[STRAIGHT] == pytest.approx(steady_motion.measure_straight_path(truck)[STRAIGHT], abs=1e-3)
    assert 0.004 < widths[TRACKING] - widths[STRAIGHT] < 0.015


@pytest.mark.slow
@pytest.mark.parametrize("name", ["a_double", "truck_full_trailer"])
def test_other_roads_of_this_roughness_add_nearly_the_same(name: str) -> None:
    """Standard deviation of the added width of three roads below 3 mm; all units on average as in the linear model."""
    pytest.importorskip("mujoco")
    truck = Truck(vehicle=fw.vehicle(name), speed=steady_motion.TRACKING_SPEED)
    widths = [nonlinear.straight_path(truck, seed) for seed in range(3)]
    linear = steady_motion.measure_straight_path(truck)[STRAIGHT]
    assert [w[STRAIGHT] for w in widths] == pytest.approx([linear] * 3, abs=1e-3)
    assert np.std([w[TRACKING] for w in widths]) < 0.003


@pytest.fixture
def simulated(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fixed widths of the nonlinear truck, and no measures of the linear one but the width on the crossfall."""
    module = importlib.import_module("fifthwheel.assess.assess")
    monkeypatch.setattr(module, "FAMILIES", (steady_motion.measure_straight_path,))
    monkeypatch.setattr(nonlinear, "measures", lambda truck: ({STRAIGHT: 2.61, TRACKING: 2.91}, {}, ()))


@pytest.mark.usefixtures("simulated")
def test_the_roughness_adds_to_the_linear_width() -> None:
    """At 90 km/h, with its sigma, against thresholds that are not confirmed."""
    assessment = fw.assess(TRUCK, speed=15.0)
    at_speed = Truck(vehicle=TRUCK, speed=25.0)
    measure, smooth = assessment[TRACKING], assessment[STRAIGHT]
    assert measure.value == pytest.approx(steady_motion.measure_straight_path(at_speed)[STRAIGHT] + 0.3)
    assert (measure.nonlinear, smooth.nonlinear) == (2.91, 2.61)
    assert measure.sigma == pytest.approx(smooth.sigma, rel=0.05)
    assert [(t.value, t.confirmed) for t in measure.thresholds] == [(v, False) for v in (2.9, 3.0, 3.1, 3.3)]
    assert measure.best_threshold().level == "2"
    assert measure.thresholds[0].probability < 0.5 < measure.thresholds[1].probability


@pytest.mark.usefixtures("simulated")
def test_a_truck_that_is_unstable_at_that_speed_has_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(steady_motion, "TRACKING_SPEED", 30.0)
    assessment = fw.assess(fw.vehicle("auburn_6x4"), speed=15.0)
    assert [m.name for m in assessment] == [STRAIGHT]
    assert any("unstable at 108 km/h" in note for note in assessment.notes)
