"""Settings from the options of a user."""

import pytest

from fifthwheel.errors import FifthwheelError, VehicleError
from fifthwheel.identify import OneStage
from fifthwheel.options import IdentifyOptions
from fifthwheel.vehicle import get
from fifthwheel.workflow import SENSOR_PRIORS, chosen_one_stage

TRUCK = get("cheng_cebon_2011")


def chosen(**choices):
    """Vehicle and settings of the options."""
    return chosen_one_stage(TRUCK, IdentifyOptions(**choices))


def test_without_choices_they_are_the_defaults():
    assert chosen() == (TRUCK, OneStage())


def test_a_fraction_is_a_stated_sigma():
    vehicle, settings = chosen(statements=("semitrailer.roll_stiffness=+- 20 %",))
    assert vehicle.stated == {"semitrailer.roll_stiffness": pytest.approx(0.2 * 2.7e6)}
    assert settings == OneStage()
    vehicle, settings = chosen(statements=("semitrailer.roll_stiffness=exact",))
    assert vehicle.stated == {"semitrailer.roll_stiffness": 0.0}
    assert settings.fixed == ("semitrailer.roll_stiffness",)


def test_free_parameters_are_estimated_in_addition_to_the_usual_ones():
    _, settings = chosen(statements=("tractor.yaw_inertia=free", "semitrailer.payload.height=exact"), check=False)
    assert settings.free == (
        "tractor.front.cornering_stiffness",
        "tractor.drive.cornering_stiffness",
        "semitrailer.cornering_stiffness",
        "semitrailer.yaw_inertia",
        "tractor.yaw_inertia",
    )
    assert settings.fixed == ("semitrailer.payload.height",)
    assert not settings.check


def test_any_load_estimates_the_laden_body():
    _, settings = chosen(statements=("tractor.yaw_inertia=free",), any_load=True)
    assert not settings.uniform_payload
    assert {"semitrailer.sprung.cog_height", "semitrailer.sprung.roll_inertia"} < set(settings.free)
    assert "semitrailer.payload.height" not in settings.free


def test_every_sensor_prior_is_a_setting():
    priors = {name: 0.001 * (k + 1) for k, name in enumerate(SENSOR_PRIORS)}
    units = {name: SENSOR_PRIORS[name].removesuffix("1") for name in priors}
    _, settings = chosen(statements=tuple(f"{name}=+- {sigma!r} {units[name]}" for name, sigma in priors.items()))
    assert {name: getattr(settings, f"{name}_prior") for name in SENSOR_PRIORS} == pytest.approx(priors)


def test_wrong_choices_are_refused():
    with pytest.raises(FifthwheelError, match="steer_lag"):
        chosen(statements=("steer_lag=+- 0.1 s",))
    with pytest.raises(FifthwheelError, match="bank: expected a standard deviation above 0"):
        chosen(statements=("bank=exact",))
    with pytest.raises(VehicleError, match=r"tractor\.colour"):
        chosen(statements=("tractor.colour=exact",))
