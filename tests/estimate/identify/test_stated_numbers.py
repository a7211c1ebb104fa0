"""What a user states with a standard deviation is found by its name in all that shows a result."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fifthwheel.base.pages import html
from fifthwheel.estimate.design import predict_sigmas
from fifthwheel.estimate.identify import Identification, OneStage, Verdict, identify
from fifthwheel.estimate.identify.given import applied
from fifthwheel.estimate.identify.result.parts import Estimate
from fifthwheel.model.simulate import simulate
from fifthwheel.results.report import front_page, identification_document
from fifthwheel.truck import Vehicle, get
from fifthwheel.truck.spoken_names import spoken

TRUCK = get("cheng_cebon_2011")
STATED = {
    "semitrailer.mass": ("33.4 t +- 0.5 %", 167.0),
    "semitrailer.wheelbase": ("7.98 m +- 2 cm", 0.02),
    "semitrailer.rear.self_steering": ("+- 0.2", 0.2),
    "semitrailer.softening": ("0 1/rad +- 0.2 1/rad", 0.2),  # the simulated tyres are linear
    "steer.tractor.front.delay": ("+- 5 ms", 0.005),
    "yaw_rate.tractor.offset": ("+- 0.1 deg/s", np.deg2rad(0.1)),
    "time_base": ("+- 0.1 %", 0.001),
    "time_base.main.delay": ("+- 5 ms", 0.005),
    "road.bank": ("+- 1 deg", np.deg2rad(1.0)),
    "brakes.drive_axle": ("+- 0.2", 0.2),
    "discrepancy": ("+- 0.02", 0.02),
}
"""Statement and sigma."""


@pytest.mark.slow
def test_it_is_in_the_result(tmp_path: Path) -> None:
    fixed = TRUCK.replace({"semitrailer.rear.self_steering": 0.0})
    settings = OneStage(given={name: text for name, (text, _) in STATED.items()}, tyres="linear")
    result = identify([simulate(TRUCK, count=1, seed=3)], fixed, settings)
    page, texts = html.blocks(front_page.estimates(result)), (result.summary(), str(identification_document(result)))
    for name, (_, sigma) in STATED.items():
        found = result[name]
        assert found in result.stated_numbers
        assert found.prior == pytest.approx(sigma)
        assert 0 < found.sigma <= found.prior * 1.001
        assert abs(found.value - found.initial) < 4 * found.prior
        assert all(name in text for text in texts)
        assert spoken(name) in page
    numbers = result.vehicle.parameters() | result.vehicle.derived()
    for name in ("semitrailer.mass", "semitrailer.wheelbase"):
        assert result[name].value == pytest.approx(numbers[name])
    for name in ("semitrailer.mass", "semitrailer.softening"):
        i = result.covariance.names.index(name)
        assert result[name].sigma == pytest.approx(np.sqrt(result.covariance.covariance[i, i]), rel=0.02)
    shown = {e.name for e in result.stated_numbers}  # and not what a statement changes
    assert not {"semitrailer.cog", "semitrailer.rear.position", "semitrailer.payload.mass"} & shown
    assert len(shown) == len(result.stated_numbers)
    result.save(tmp_path)
    assert Identification.load(tmp_path).stated_numbers == result.stated_numbers


def test_the_settings_keep_a_wheelbase_as_it_is_stated() -> None:
    vehicle, settings = applied(TRUCK, OneStage(given={"semitrailer.wheelbase": "7.7 m +- 1 %"}))
    assert settings.given == {"semitrailer.wheelbase": "+- 1 %"}
    assert applied(vehicle, settings) == (vehicle, settings)


@pytest.mark.slow
def test_of_several_logs_each_has_its_own() -> None:
    given = {"yaw_rate.tractor.offset": "+- 0.1 deg/s", "others": "exact"}
    logs = [replace(simulate(TRUCK, count=1, seed=i), name=name) for i, name in enumerate(("a", "b"))]
    shown = identify(logs, TRUCK, OneStage(given=given, tyres="linear")).stated_numbers
    assert [e.name for e in shown] == ["yaw_rate.tractor.offset@a", "yaw_rate.tractor.offset@b"]
    prediction = predict_sigmas(logs, TRUCK, OneStage(given=given, tyres="linear"), checked=True)
    assert prediction["yaw_rate.tractor.offset@b"].verdict is Verdict.STATED


@pytest.mark.slow
def test_the_vehicle_file_states_it() -> None:
    """The mass of a unit, and the driveline, which does not act on lateral motion."""
    file = Vehicle.loads(TRUCK.to_toml() + '\n[driveline]\ntorque_scale = "1.02 +- 0.1 %"\n')
    log = simulate(TRUCK, count=1, seed=3)
    result = identify([log], file.with_stated({"semitrailer.mass": 100.0}), OneStage(tyres="linear"))
    assert result["semitrailer.mass"].prior == pytest.approx(100.0)
    assert result["driveline.torque_scale"].sigma == pytest.approx(0.00102)
    assert result.stated_numbers == []


def test_a_number_that_may_be_negative_has_no_per_cent() -> None:
    rest = {"value": 1.0, "sigma": 0.05, "unit": "1", "initial": 1.0, "verdict": Verdict.STATED, "stage": 1}
    for name in ("semitrailer.mass", "steer.tractor.front.gain"):
        assert Estimate(name=name, **rest).percent == "5 %"
    for name in ("steer.tractor.front.offset@run", "semitrailer.cog"):
        assert Estimate(name=name, **rest).percent == "–"
