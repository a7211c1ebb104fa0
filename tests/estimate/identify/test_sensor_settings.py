"""What an identification passes on: sensor errors and noise for an observer, and JSON."""

import json
import math
from types import SimpleNamespace
from typing import Any

import pytest

from fifthwheel.estimate.identify import Identification, OneStage
from fifthwheel.estimate.identify.result.storage import _finite
from fifthwheel.truck import get
from fifthwheel.truck.quantities import BANK_VARIATION, quantity_of

STEER, YAW, LATERAL = "steer.tractor.front", "yaw_rate.tractor", "lateral_acceleration.tractor"


def error(name: str, value: float, log: str | None) -> SimpleNamespace:
    return SimpleNamespace(name=name, value=value, log=log, sigma=0.003)


class Fields(SimpleNamespace):
    """Some fields of an identification, with what an observer gets from them."""

    friction = Identification.friction
    sensor_settings = Identification.sensor_settings
    prior_of_sensor_error = Identification.prior_of_sensor_error
    _uncertainties = Identification._uncertainties


IDENTIFICATION: Any = Fields(
    sensors=[
        error(f"{STEER}.gain", 1.1, None),
        error(f"{YAW}.offset", 0.001, "first"),
        error(f"{YAW}.offset", 0.002, "second"),
        error("time_base.trailer.delay", 0.1, None),
    ],
    logs=[
        SimpleNamespace(name="first", noise={YAW: 1e-6}, bank=None, drive_axle_braking=(0.7, 0.1)),
        SimpleNamespace(name="second", noise={YAW: 2e-6}, bank=None, drive_axle_braking=None),
    ],
    signals=(STEER, YAW, LATERAL),
    initial_vehicle=get("cheng_cebon_2011"),
    settings=OneStage(given={"sensors": "exact", "road.bank": "exact"}),
    surroundings={"tyre.shape": 1.2, "body.half_track": 0.9},
    covariance=None,
)

VARYING = math.hypot(0.02, quantity_of(BANK_VARIATION).sigma)
"""Standard deviation of the bank at a place of the first log, rad."""


@pytest.mark.parametrize(
    ("log", "offset", "noise"), [("first", 0.001, 1e-6), ("second", 0.002, 2e-6), (None, None, 1e-6), ("b", None, 1e-6)]
)
def test_sensor_errors_and_noise_of_a_log(log: str | None, offset: float | None, noise: float) -> None:
    """Of another log only what all logs share, with the noise of the first; an observer has one time base. The first
    log informs who brakes, of another log nothing is known of it."""
    settings = IDENTIFICATION.sensor_settings(log)
    own = {} if offset is None else {f"{YAW}.offset": offset}
    brakes = {} if log == "second" else {"brakes.drive_axle": 0.7 if log == "first" else 0.5}
    road = {"friction": None, "half_track": 0.9, "surroundings": {"tyre.shape": 1.2} | brakes}
    exact = dict.fromkeys(("bank_mean", "bank", "steer_offset", "acceleration_offset", "wheel_speed_offset"), 0.0)
    assert settings == {"sensor_errors": {f"{STEER}.gain": 1.1, **own}, "noise": {YAW: noise}} | road | exact


@pytest.mark.parametrize(
    ("log", "joint", "bank_mean", "bank", "offset"),
    [
        ("first", True, 0.01, VARYING, 0.0),
        ("first", False, 0.01, VARYING, 0.003),
        ("second", True, 0.0, 0.03, 0.01),
        (None, True, 0.0, 0.03, 0.01),
        ("b", True, 0.0, 0.03, 0.01),
    ],
)
def test_bank_and_offsets_of_a_log(log: str | None, joint: bool, bank_mean: float, bank: float, offset: float) -> None:
    """The joint covariance contains the offsets of a log that has them; other logs have the priors. The bank varies
    within a log."""
    sensors = [*IDENTIFICATION.sensors, *(error(f"{name}.offset", 0.004, "first") for name in (STEER, LATERAL))]
    first, *others = IDENTIFICATION.logs
    logs = [SimpleNamespace(**{**vars(first), "bank": (0.01, 0.02)}), *others]
    changes = {"sensors": sensors, "logs": logs, "settings": OneStage(), "covariance": object() if joint else None}
    identification: Any = Fields(**{**vars(IDENTIFICATION), **changes})
    settings = identification.sensor_settings(log)
    assert [settings[name] for name in ("bank_mean", "bank", "steer_offset")] == [bank_mean, bank, offset]
    assert settings["acceleration_offset"] == (0.3 if offset == 0.01 else offset)


def test_json_has_no_number_that_is_not_finite() -> None:
    data = {"a": [1.0, math.nan, (math.inf, {"b": -math.inf})], "c": "nan", "d": None, "e": 3}
    assert _finite(data) == {"a": [1.0, None, [None, {"b": None}]], "c": "nan", "d": None, "e": 3}
    json.dumps(_finite(data), allow_nan=False)
