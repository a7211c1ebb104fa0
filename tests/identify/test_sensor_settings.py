"""What an identification passes on: sensor errors and noise for an observer, and JSON."""

import json
import math
from types import SimpleNamespace
from typing import Any

import pytest

from fifthwheel.identify import Identification
from fifthwheel.identify.result.storage import _finite

STEER, YAW = "steer.tractor.front", "yaw_rate.tractor"


def error(name: str, value: float, log: str | None) -> SimpleNamespace:
    return SimpleNamespace(name=name, value=value, log=log)


IDENTIFICATION: Any = SimpleNamespace(
    sensors=[
        error(f"{STEER}.gain", 1.1, None),
        error(f"{YAW}.offset", 0.001, "first"),
        error(f"{YAW}.offset", 0.002, "second"),
        error("time_base.trailer.delay", 0.1, None),
    ],
    logs=[SimpleNamespace(name="first", noise={YAW: 1e-6}), SimpleNamespace(name="second", noise={YAW: 2e-6})],
)


@pytest.mark.parametrize(
    ("log", "offset", "noise"), [("first", 0.001, 1e-6), ("second", 0.002, 2e-6), (None, None, 1e-6), ("b", None, 1e-6)]
)
def test_sensor_errors_and_noise_of_a_log(log: str | None, offset: float | None, noise: float) -> None:
    """Of another log only what all logs share, with the noise of the first; an observer has one time base."""
    settings = Identification.sensor_settings(IDENTIFICATION, log)
    own = {} if offset is None else {f"{YAW}.offset": offset}
    assert settings == {"sensor_errors": {f"{STEER}.gain": 1.1, **own}, "noise": {YAW: noise}}


def test_json_has_no_number_that_is_not_finite() -> None:
    data = {"a": [1.0, math.nan, (math.inf, {"b": -math.inf})], "c": "nan", "d": None, "e": 3}
    assert _finite(data) == {"a": [1.0, None, [None, {"b": None}]], "c": "nan", "d": None, "e": 3}
    json.dumps(_finite(data), allow_nan=False)
