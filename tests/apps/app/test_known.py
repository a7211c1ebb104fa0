"""Sentences on what is known before an identification."""

import pytest

from fifthwheel.apps.app.pages import identify
from fifthwheel.apps.app.workspace import Choices, Workspace
from fifthwheel.truck import get

TRUCK = get("cheng_cebon_2011")


@pytest.fixture
def workspace(tmp_path) -> Workspace:
    signals = '[signals]\nspeed = "v"\n[signals."yaw_rate.tractor"]\ncolumn = "w"\nsensor = "mems"\n'
    made = Workspace(tmp_path / "w")
    made.write({"signals.toml": signals}, "a map")
    return made


def test_truck_and_sensors_are_sentences(workspace):
    assert identify.of_truck_and_sensors(workspace, TRUCK) == [
        "Truck: cheng_cebon_2011; no number is assumed.",
        "Tractor, yaw rate: a sensor of the class mems.",
        "All other sensors: the usual errors and noise of their kind.",
    ]


def test_statements_and_settings_are_sentences(workspace):
    statements = ["semitrailer.mass=33.4 t +- 0.5 %", "tractor.yaw_inertia=free", "road.friction=wet"]
    choices = Choices(identify={"statements": statements, "any_load": True, "form": "output-error"})
    assert list(identify.stated_numbers(workspace, choices).values()) == [
        "Trailer, mass: 33.4 t ± 0.5 %.",
        "Tractor, yaw inertia: unknown; only the logs determine it.",
        "Road, friction: wet.",
    ]
    assert identify.changed_settings(choices) == [
        "Load of any shape: yes.",
        "Compare the logs with: Free-running model: robust to model error.",
    ]


def test_numbers_of_truck_road_and_sensors_can_be_stated(workspace):
    numbers = identify.numbers(workspace, TRUCK)
    assert {"semitrailer.yaw_inertia", "road.friction", "yaw_rate.tractor.gain", "road.bank"} <= set(numbers)
    assert "yaw_rate.semitrailer.gain" not in numbers  # the signal map has no such sensor
    assert numbers["time_base"] == "Time base, rate (time_base)"
    misalignment = "yaw_rate.tractor.misalignment"
    assert numbers[misalignment] == f"Tractor, yaw rate misalignment ({misalignment})"
    assert numbers["semitrailer.mass"] == "Trailer, mass (semitrailer.mass)"
    assert numbers["semitrailer.wheelbase"] == "Trailer, wheelbase (semitrailer.wheelbase)"
