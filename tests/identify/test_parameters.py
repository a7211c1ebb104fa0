"""Which parameters are estimated, uncertain, considered or fixed, by their names."""

import pytest

from fifthwheel.errors import VehicleError
from fifthwheel.identify import OneStage, TwoStage
from fifthwheel.identify.parameters import (
    estimated_parameters,
    expand_names,
    lacks_roll_rate,
    longest_matching_key,
    one_stage_unknowns,
    sensor_error_unknowns,
    stage_1_names,
    stage_2_names,
    two_stage_unknowns,
)
from fifthwheel.vehicle import Vehicle

HEIGHT = "semitrailer.payload.height"
RATES = ("yaw_rate.tractor", "yaw_rate.semitrailer", "roll_rate.semitrailer")


def test_the_vehicle_file_replaces_a_default_that_is_considered(truck: Vehicle) -> None:
    def sigma(settings: OneStage, stated: float) -> float | None:
        vehicle = truck.with_stated({"semitrailer.roll_stiffness": stated})
        unknowns = {u.name: u for u in one_stage_unknowns(vehicle, RATES, settings)}
        return unknowns["semitrailer.roll_stiffness"].scale if "semitrailer.roll_stiffness" in unknowns else None

    value = truck.parameters()["semitrailer.roll_stiffness"]
    assert sigma(OneStage(), 0.03 * value) == pytest.approx(0.03)
    assert sigma(OneStage(), 0.0) is None
    assert sigma(OneStage(consider={"roll_stiffness": 0.2}), 0.03 * value) == 0.2


def test_longest_matching_key() -> None:
    table = {"roll_stiffness": 0.1, "front.roll_stiffness": 0.2, "tractor.front.roll_stiffness": 0.3, "stiffness": 0.4}
    assert longest_matching_key("tractor.front.roll_stiffness", table) == "tractor.front.roll_stiffness"
    assert longest_matching_key("other.front.roll_stiffness", table) == "front.roll_stiffness"
    assert longest_matching_key("tractor.drive.roll_stiffness", table) == "roll_stiffness"
    assert longest_matching_key("tractor.drive.tyre_roll_stiffness", table) is None


def test_expand_names(truck: Vehicle) -> None:
    stiffnesses = [name for name in stage_1_names(truck) if name.endswith(".cornering_stiffness")]
    assert expand_names(truck, ["cornering_stiffness", stiffnesses[0]]) == stiffnesses
    assert expand_names(truck, ["payload.height"]) == [HEIGHT]
    with pytest.raises(VehicleError, match=r"ering_stiffness: no such parameter in .*cheng"):
        expand_names(truck, ["ering_stiffness"])


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        (HEIGHT, False),
        ("tractor.payload.height", True),
        ("tractor.sprung.cog_height", True),
        ("tractor.sprung.roll_inertia", True),
        ("tractor.sprung.mass", False),
        ("tractor.roll_axis_height", False),
    ],
)
def test_lacks_roll_rate(name: str, expected: bool) -> None:
    assert lacks_roll_rate(name, RATES) is expected


def test_each_parameter_is_one_kind_of_unknown(truck: Vehicle) -> None:
    settings = OneStage(
        fixed=("tractor.yaw_inertia",), priors={"relaxation_length": 0.3}, consider={"roll_damping": 0.2}
    )
    unknowns = one_stage_unknowns(truck, RATES, settings)
    names = [u.name for u in unknowns]
    assert len(set(names)) == len(names)
    estimated = [u.name for u in unknowns if not (u.uncertain or u.considered or u.nuisance)]
    assert estimated == estimated_parameters(truck, settings) == [*stage_1_names(truck), *stage_2_names(truck)]
    assert {u.name.rpartition(".")[2] for u in unknowns if u.uncertain} == {"relaxation_length"}
    assert {u.name.rpartition(".")[2] for u in unknowns if u.considered} == {"roll_damping"}
    assert "tractor.yaw_inertia" not in names


def test_body_below_an_estimated_payload_is_not_considered(truck: Vehicle) -> None:
    """Its CoG height would be the payload height again; named by its full path it is considered."""

    def considered(settings: OneStage) -> set[str]:
        return {u.name for u in one_stage_unknowns(truck, RATES, settings) if u.considered}

    assert "tractor.sprung.cog_height" in considered(OneStage())
    assert "semitrailer.sprung.cog_height" not in considered(OneStage())
    assert "semitrailer.sprung.cog_height" in considered(OneStage(fixed=(HEIGHT,)))
    assert considered(OneStage(consider={"semitrailer.sprung.cog_height": 0.1})) == {"semitrailer.sprung.cog_height"}


def test_priors(truck: Vehicle) -> None:
    """Standard deviation and slope agree with the transformation z -> p."""
    for settings in (TwoStage(), TwoStage(logarithmic=False)):
        for u in two_stage_unknowns(truck, [*stage_1_names(truck), HEIGHT], settings):
            expected = settings.height_prior if u.name == HEIGHT else settings.prior * truck.parameters()[u.name]
            assert u.prior_sigma == pytest.approx(expected)
            assert u.slope(u.centre) == pytest.approx(expected)


def test_sensor_errors(truck: Vehicle) -> None:
    unknowns = sensor_error_unknowns(truck, RATES, TwoStage())
    names = {u.name for u in unknowns}
    assert {f"steer.tractor.front.{kind}" for kind in ("offset", "gain", "delay")} <= names
    assert {f"{rate}.offset" for rate in RATES} <= names
    assert {u.name for u in unknowns if u.per_log} == {name for name in names if name.endswith(".offset")}
    assert sensor_error_unknowns(truck, RATES, TwoStage(nuisances=False)) == []


def test_two_stages_fix_only_what_they_estimate(truck: Vehicle) -> None:
    with pytest.raises(VehicleError, match=r"tractor\.mass: cannot be fixed"):
        two_stage_unknowns(truck, stage_1_names(truck), TwoStage(fixed=("tractor.mass",)))
