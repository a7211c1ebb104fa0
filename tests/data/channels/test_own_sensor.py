"""Sensors that a user registers: what is refused, and that estimators use them as they use their own."""

import importlib
import math
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import casadi as ca
import numpy as np
import pytest

from fifthwheel.base.errors import SignalError
from fifthwheel.data.channels import CHANNELS, IDENTIFIED, MEASURED, MODELLED, own_channels, register
from fifthwheel.data.channels.channel import Channel, ErrorKind, SensorModel, SignalLimits
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify import Identification, OneStage, identify
from fifthwheel.estimate.observe import Observer, ObserverSettings
from fifthwheel.model.dynamics import linear_system, model
from fifthwheel.model.simulate import simulate
from fifthwheel.results.report import write_report
from fifthwheel.truck import get

TRUCK = get("cheng_cebon_2011")
RATE = Channel(
    quantity="optical_rate",
    unit="rad/s",
    limit=SignalLimits(magnitude=1.0, jump=0.5),
    noise=CHANNELS["yaw_rate"].noise,
    model=SensorModel(value=lambda now, i, name: now.motion.r[i]),
)
"""The yaw rate under another name."""


@pytest.fixture(autouse=True, scope="module")
def registered() -> Iterator[None]:
    """Registers nothing for other tests."""
    before = [(listed, listed[:]) for listed in (MEASURED, IDENTIFIED, MODELLED)]
    quantities = set(CHANNELS)
    yield
    for listed, channels in before:
        listed[:] = channels
    for quantity in set(CHANNELS) - quantities:
        del CHANNELS[quantity]


@pytest.fixture(scope="module")
def example(registered: None) -> Iterator[ModuleType]:
    """examples/optical_sensor.py, which registers its sensor."""
    folder = str(Path(__file__).parents[3] / "examples")
    sys.path.insert(0, folder)
    yield importlib.import_module("optical_sensor")
    sys.path.remove(folder)
    del sys.modules["optical_sensor"]


@pytest.fixture(scope="module")
def record(example: ModuleType) -> Record:
    """The simulated record of the example."""
    made: Record = example.simulated(TRUCK)
    return made


INCOMPLETE: list[tuple[dict[str, object], str]] = [
    ({"quantity": "yaw_rate"}, "yaw_rate: is a quantity of fifthwheel; give yours another name"),
    ({"quantity": "Optical rate"}, "quantity: expected small letters, digits and _, got 'Optical rate'"),
    ({"quantity": "a.b"}, "quantity: expected small letters"),
    ({"unit": "rad per second"}, "optical_rate, unit: expected a unit in SI, got 'rad per second'"),
    ({"of": "part"}, "optical_rate, model: expected a value of a unit"),
    ({"model": None}, "optical_rate, model: expected a value of a unit"),
    ({"limit": None}, "optical_rate, limit: expected a value, got none; add it"),
    ({"noise": None}, "optical_rate, noise: expected a value, got none; add it"),
    ({"errors": (ErrorKind(kind="delay", prior=0.01),)}, "optical_rate, errors: expected offset or gain, got 'delay'"),
    ({"errors": (ErrorKind(kind="gain", prior=-0.1),)}, "optical_rate, gain: expected a prior of 0 or more, got -0.1"),
]


def test_an_incomplete_sensor_is_refused() -> None:
    for changes, message in INCOMPLETE:
        with pytest.raises(SignalError) as e:
            register(replace(RATE, **changes))  # type: ignore[arg-type]
        assert str(e.value).startswith(message)
        assert "optical_rate" not in CHANNELS


def test_a_value_that_is_no_expression_is_refused() -> None:
    for value in (lambda now, i, name: math.tanh(now.motion.r[i]), lambda *_: 1.0, lambda now, i, name: now.motion):
        register(replace(RATE, quantity="wrong", model=SensorModel(value=value)))  # type: ignore[arg-type, misc]
        with pytest.raises(SignalError, match=r"wrong\.tractor: expected one expression of CasADi from the value"):
            assert model(TRUCK, ["wrong.tractor"], roll=False).observation


def test_a_later_channel_of_the_same_quantity_replaces_the_model() -> None:
    """In the same process, and without machine code of the first."""
    outputs = []
    for factor in (1.0, 2.0):
        scaled = SensorModel(value=lambda now, i, name, factor=factor: factor * now.motion.r[i])
        register(replace(RATE, quantity="scaled_rate", model=scaled))
        record = simulate(TRUCK, count=1, sensors={"scaled_rate.tractor": 0.0}, roll=False)
        outputs.append(record.signals["scaled_rate.tractor"])
    assert [channel.quantity for channel in MEASURED].count("scaled_rate") == 1
    assert np.abs(outputs[0]).max() > 0.01
    np.testing.assert_allclose(outputs[1], 2 * outputs[0])


def test_an_observer_gives_the_states_of_the_same_sensor_by_another_name() -> None:
    register(RATE)
    record = simulate(TRUCK, count=1, sensors={"yaw_rate.tractor": 1e-6, "yaw_rate.semitrailer": 1e-6})
    signals = {**record.signals, "optical_rate.tractor": record.signals["yaw_rate.tractor"]}
    del signals["yaw_rate.tractor"]
    own = Observer(TRUCK, signals, ObserverSettings()).batch(replace(record, signals=signals))
    expected = Observer(TRUCK, record.signals, ObserverSettings()).batch(record)
    for name, values in expected.values.items():
        np.testing.assert_allclose(own.values[name], values, rtol=0, atol=1e-9 * np.abs(values).max())
        np.testing.assert_allclose(own.sigma[name], expected.sigma[name], rtol=1e-9)
    own_C, C = (linear_system(TRUCK, 20.0, [f"{name}.tractor"]).C for name in ("optical_rate", "yaw_rate"))
    np.testing.assert_allclose(own_C, C)


def test_a_sensor_that_is_not_linear_is_linearised() -> None:
    atan = SensorModel(value=lambda now, i, name: ca.atan(now.motion.r[i]))
    register(replace(RATE, quantity="atan_rate", model=atan))
    own, linear = (linear_system(TRUCK, 20.0, [f"{name}.tractor"]).C for name in ("atan_rate", "yaw_rate"))
    np.testing.assert_allclose(own, linear)


@pytest.mark.slow
def test_an_identification_estimates_the_errors_of_the_sensor(
    example: ModuleType, record: Record, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert [c.quantity for c in own_channels(["speed", example.SIGNAL, "yaw_rate.tractor"])] == ["optical_angle"]
    settings = OneStage(tyres="linear", check=False)
    result = identify([record], TRUCK, settings)
    errors = {error.name: error for error in result.sensors}
    offset = errors[f"{example.SIGNAL}.offset"]
    assert offset.log == record.name
    assert abs(offset.value - example.OFFSET) < 3 * offset.sigma < 3 * 0.4 * 0.01  # of the prior
    assert {f"{example.SIGNAL}.gain", f"{example.SIGNAL}.delay"} <= errors.keys()
    assert example.SIGNAL in {fit.signal for fit in result.fits}
    write_report(tmp_path / "report.html", result, [record], title="own sensor")
    result.save(tmp_path)
    assert Identification.load(tmp_path).observer_settings(record.name) == result.observer_settings(record.name)
    monkeypatch.delitem(CHANNELS, "optical_angle")
    with pytest.raises(SignalError, match=r"optical_angle\.tractor: not the name of a signal"):
        Identification.load(tmp_path)
