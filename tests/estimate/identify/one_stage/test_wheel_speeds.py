"""One stage with wheel speeds of a trailer axle on the nonlinear truck, whose rolling radii follow the wheel loads."""

from dataclasses import replace

import pytest

from fifthwheel.apps.cheng_cebon_2011 import TwoStage
from fifthwheel.data.channels import SignalName
from fifthwheel.data.channels.table import WHEEL_SPEED_DIFFERENCE
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify import Identification, OneStage, identify
from fifthwheel.model.manoeuvres import lane_changes
from fifthwheel.truck import Vehicle

pytest.importorskip("mujoco")
from fifthwheel.model.plant import Plant
from fifthwheel.model.plant.sensors import Sensor

AXLE, NAME = "semitrailer.middle", "wheel_speed_difference.semitrailer.middle"
DIFFERENCE = 0.006
"""Of the radii, right less left."""
EXACT = OneStage(tyres="linear", given={"others": "exact", "steer.*.gain": "+- 3 %"})
"""The vehicle file is exact."""


@pytest.fixture(scope="module")
def log(truck: Vehicle) -> Record:
    """Two lane changes with gyros of the tractor, and wheel speeds as on a bus: 1/256 km/h, 20 Hz."""
    bus = {"variance": 0.01**2, "quantisation": 1 / 256 / 3.6, "rate": 20.0}
    wheels = {"left": 1 - DIFFERENCE / 2, "right": 1 + DIFFERENCE / 2}
    sensors = {f"wheel_speed.{AXLE}.{side}": Sensor(scale=scale, **bus) for side, scale in wheels.items()}
    gyros = {"yaw_rate.tractor": Sensor(variance=1.5e-5), "roll_rate.tractor": Sensor(variance=4.5e-4)}
    exact = {"speed": Sensor(), "steer.tractor.front": Sensor()}
    return Plant(truck).drive(lane_changes(count=2)).record(exact | gyros | sensors, seed=11)


@pytest.fixture(scope="module")
def result(log: Record, truck: Vehicle) -> Identification:
    return identify([log], truck, EXACT)


@pytest.mark.slow
def test_it_finds_the_difference_of_the_radii(result: Identification) -> None:
    errors = {e.name.removeprefix(f"{NAME}."): e for e in result.sensors if e.name.startswith(NAME)}
    assert errors.keys() == {"offset", "gain", "load_sensitivity", "delay"}
    offset = errors["offset"]
    assert abs(offset.value - DIFFERENCE) < 3 * offset.sigma
    assert offset.sigma < 0.2 * WHEEL_SPEED_DIFFERENCE.error("offset").prior
    assert offset.log == result.logs[0].name
    assert errors["load_sensitivity"].value > 3 * errors["load_sensitivity"].sigma
    assert [e.unit for e in errors.values()] == ["1", "1", "1", "s"]
    settings = result.observer_settings(result.logs[0].name)
    assert settings.sensor_errors[f"{NAME}.offset"] == offset.value
    assert settings.wheel_speed_offset == 0.0


@pytest.mark.slow
def test_it_adds_information(result: Identification, log: Record, truck: Vehicle) -> None:
    """More signals do not enlarge a sigma, and the estimates are within three of it."""
    signals = {name: v for name, v in log.signals.items() if SignalName.of(name).quantity != "wheel_speed"}
    alone, truth = identify([replace(log, signals=signals)], truck, EXACT), truck.parameters()
    for name in ("semitrailer.cornering_stiffness", "semitrailer.yaw_inertia", "tractor.drive.cornering_stiffness"):
        assert result[name].sigma < 1.01 * alone[name].sigma
        assert abs(result[name].value - truth[name]) < 3 * result[name].sigma
    assert result["semitrailer.cornering_stiffness"].sigma < 0.97 * alone["semitrailer.cornering_stiffness"].sigma
    assert any(note.startswith("yaw_rate.semitrailer") for note in alone.notes)
    assert not any(note.startswith("yaw_rate.semitrailer") for note in result.notes)


def test_exchanged_sides_are_refused(log: Record, truck: Vehicle) -> None:
    """Of the nonlinear truck, whose load transfer adds to the difference."""
    left, right = (f"wheel_speed.{AXLE}.{side}" for side in ("left", "right"))
    exchanged = log.with_signals({left: log.signals[right], right: log.signals[left]})
    with pytest.raises(ValueError, match=f"^{right}: less {left} contradicts yaw_rate.tractor .* exchange the columns"):
        identify([exchanged], truck, EXACT)


@pytest.mark.slow
def test_two_stages_do_not_use_it(log: Record, truck: Vehicle) -> None:
    towed = {f"{rate}.semitrailer": log.signals[f"{rate}.tractor"] for rate in ("yaw_rate", "roll_rate")}
    result = identify([log.with_signals(towed)], truck, TwoStage(rounds=1, passes=1, check=False))
    assert len([note for note in result.notes if note.startswith(f"Two stages do not use {NAME}: ")]) == 1
    assert NAME not in {fit.signal for fit in result.fits}
