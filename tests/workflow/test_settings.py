"""One-stage settings from the choices for single parameters."""

import pytest

from fifthwheel.errors import SignalError, VehicleError
from fifthwheel.identify import OneStage
from fifthwheel.identify.settings import DEFAULT_CONSIDERED
from fifthwheel.vehicle import get
from fifthwheel.workflow import SENSOR_PRIORS, one_stage_settings

TRUCK = get("cheng_cebon_2011")


def test_without_choices_they_are_the_defaults():
    assert one_stage_settings(TRUCK) == OneStage()


def test_a_choice_replaces_the_default_for_the_same_name():
    learned = one_stage_settings(TRUCK, prior={"roll_stiffness": 0.2})
    assert learned.priors == {"roll_stiffness": 0.2}
    assert learned.consider == {name: x for name, x in DEFAULT_CONSIDERED.items() if name != "roll_stiffness"}
    considered = one_stage_settings(TRUCK, consider={"roll_stiffness": 0.05, "mass": 0.01}, base=learned)
    assert considered.priors == {}
    assert considered.consider == {**DEFAULT_CONSIDERED, "roll_stiffness": 0.05, "mass": 0.01}
    exact = one_stage_settings(TRUCK, consider={"roll_stiffness": 0.0})
    assert "roll_stiffness" not in exact.consider


@pytest.mark.parametrize("name", ["road.friction", "drive.cornering_stiffness"])
def test_an_estimated_parameter_is_fixed_and_not_considered_with_0(name):
    with pytest.raises(VehicleError, match=rf"{name}: is estimated; .* \(--fix {name}\)"):
        one_stage_settings(TRUCK, consider={name: 0.0}, base=OneStage(tyres="saturating"))
    fixed = one_stage_settings(TRUCK, fix=[name], consider={name: 0.0}, base=OneStage(tyres="saturating"))
    assert fixed.fixed == (name,)


def test_free_parameters_are_estimated_in_addition_to_the_usual_ones():
    settings = one_stage_settings(
        TRUCK, free=["tractor.yaw_inertia"], fix=["semitrailer.payload.height"], base=OneStage(check=False)
    )
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
    settings = one_stage_settings(TRUCK, free=["tractor.yaw_inertia"], any_load=True)
    assert not settings.uniform_payload
    assert settings.free is not None
    assert {"semitrailer.sprung.cog_height", "semitrailer.sprung.roll_inertia"} < set(settings.free)
    assert "semitrailer.payload.height" not in settings.free


def test_every_sensor_prior_is_a_setting():
    priors = {name: 0.001 * (k + 1) for k, name in enumerate(SENSOR_PRIORS)}
    settings = one_stage_settings(TRUCK, sensors=priors)
    assert {name: getattr(settings, f"{name}_prior") for name in SENSOR_PRIORS} == priors


def test_wrong_choices_are_refused():
    with pytest.raises(SignalError, match="steer_lag: not a sensor error"):
        one_stage_settings(TRUCK, sensors={"steer_lag": 0.1})
    with pytest.raises(SignalError, match="steer_delay: expected a prior sigma above 0, got 0 s"):
        one_stage_settings(TRUCK, sensors={"steer_delay": 0.0})
    with pytest.raises(VehicleError, match=r"tractor\.colour"):
        one_stage_settings(TRUCK, fix=["tractor.colour"])
