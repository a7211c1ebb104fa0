"""Which parameters are estimated, uncertain or fixed, by their names."""

import math

import pytest

from fifthwheel.apps.cheng_cebon_2011 import TwoStage
from fifthwheel.apps.cheng_cebon_2011.problem import parameter_unknowns, sensor_unknowns
from fifthwheel.apps.cheng_cebon_2011.stage import filter_sigmas
from fifthwheel.base.errors import VehicleError
from fifthwheel.estimate.identify import OneStage
from fifthwheel.estimate.identify.estimates import sensor_error_unit
from fifthwheel.estimate.identify.given import applied
from fifthwheel.estimate.identify.unknowns.parameters import (
    ROAD_FRICTION,
    SOFTENING,
    SOFTENING_PRIOR,
    estimated_parameters,
    lacks_roll_rate,
    one_stage_unknowns,
    softening_priors,
    stage_1_names,
    stage_2_names,
    time_base_delays,
)
from fifthwheel.estimate.identify.unknowns.unknown import Unknown
from fifthwheel.model.dynamics.sensors import sensor_parameters
from fifthwheel.truck import Vehicle
from fifthwheel.truck.quantities import quantity_of
from fifthwheel.truck.unit import Accelerometer

HEIGHT = "semitrailer.payload.height"
RATES = ("yaw_rate.tractor", "yaw_rate.semitrailer", "roll_rate.semitrailer")


def by_name(truck: Vehicle, settings: OneStage, outputs: tuple[str, ...] = RATES) -> dict[str, Unknown]:
    """The unknowns with what the settings state of the vehicle."""
    vehicle, settings = applied(truck, settings)
    return {u.name: u for u in one_stage_unknowns(vehicle, outputs, settings)}


def test_lacks_roll_rate() -> None:
    lacking = {"tractor.payload.height", "tractor.sprung.cog_height", "tractor.sprung.roll_inertia"}
    for name in (HEIGHT, "tractor.sprung.mass", "tractor.roll_axis_height", *lacking):
        assert lacks_roll_rate(name, RATES) is (name in lacking)


def test_each_parameter_is_one_kind_of_unknown(truck: Vehicle) -> None:
    given = {"others": "exact", "sensors": "exact", "relaxation_length": "+- 30 %", "roll_damping": "+- 20 %"}
    settings = OneStage(given=given)
    vehicle, stated = applied(truck, settings)
    unknowns = one_stage_unknowns(vehicle, RATES, stated)
    names = [u.name for u in unknowns]
    assert len(set(names)) == len(names)
    estimated = [u.name for u in unknowns if not (u.is_uncertain or not u.estimated or u.is_sensor_error)]
    assert estimated == estimated_parameters(truck, settings) == [*stage_1_names(truck), *stage_2_names(truck)]
    uncertain = {u.name.rpartition(".")[2] for u in unknowns if u.is_uncertain}
    assert uncertain == {"relaxation_length", "roll_damping"}
    assert all(u.estimated for u in unknowns)
    assert "tractor.yaw_inertia" not in names


def test_body_below_an_estimated_payload(truck: Vehicle) -> None:
    """Its CoG height is uncertain. Its roll inertia acts like the payload height; by its full path it is uncertain."""

    def uncertain(settings: OneStage) -> set[str]:
        return {name for name, u in by_name(truck, settings).items() if u.is_uncertain}

    assert "tractor.sprung.cog_height" in uncertain(OneStage())
    assert "semitrailer.sprung.cog_height" in uncertain(OneStage())
    inertia = "semitrailer.sprung.roll_inertia"
    assert inertia not in uncertain(OneStage())
    assert inertia in uncertain(OneStage(given={HEIGHT: "exact"}))
    assert uncertain(OneStage(given={"others": "exact", "sensors": "exact", inertia: "+- 10 %"})) == {inertia}
    height = "semitrailer.sprung.cog_height"
    assert by_name(truck.with_stated({height: 0.02}), OneStage())[height].prior_sigma == pytest.approx(0.02)


def test_softening_is_that_of_a_brush_tyre(truck: Vehicle) -> None:
    """Fiala (1954): F = C a - (C a)^2 / (3 mu Fz) + (C a)^3 / (27 mu^2 Fz^2); equal to second order in a."""
    priors, loads = softening_priors(truck), truck.axle_loads()
    for unit in truck.units:
        for group in unit.axle_groups:
            path, slip = unit.group_path(group), 1e-3
            linear, grip = group.cornering_stiffness * slip, ROAD_FRICTION * loads[path]
            fiala = linear - linear**2 / (3 * grip) + linear**3 / (27 * grip**2)
            (mean, sigma), (fraction, _) = priors[path], SOFTENING_PRIOR
            assert sigma < mean < mean / fraction
            softened = linear / (1 + mean / fraction * slip)
            assert linear - softened == pytest.approx(linear - fiala, rel=0.02)


def test_softening_without_static_loads(truck: Vehicle) -> None:
    """Two groups on one unit behind a coupling leave the loads open."""
    group = truck.units[1].axle_groups[0]
    axles = [group.model_copy(update={"name": f"part{i}", "axles": (axle,)}) for i, axle in enumerate(group.axles)]
    trailer = truck.units[1].model_copy(update={"axle_groups": tuple(axles)})
    undetermined = truck.model_copy(update={"units": (truck.units[0], trailer)})
    assert set(softening_priors(undetermined).values()) == {tuple(SOFTENING * x for x in SOFTENING_PRIOR)}


def test_a_change_of_the_vehicle_file_leaves_other_unknowns_alone(truck: Vehicle) -> None:
    """Estimated, uncertain and fixed parameters are not part of a change; one without any other is left out. The axle
    loads of saturating tyres change by the same fraction."""
    moved = by_name(truck, OneStage(tyres="linear"))["mass_scale"].slopes
    assert {"tractor.mass", "semitrailer.mass", "tractor.sprung.mass"} <= set(moved)
    assert "semitrailer.yaw_inertia" not in moved  # estimated
    assert "tractor.yaw_inertia" not in moved  # has an unknown of its own
    fixed = by_name(truck, OneStage(given={"tractor.mass": "exact", "tractor.cog": "exact"}))
    assert "tractor.mass" not in fixed["mass_scale"].slopes
    assert "tractor.cog" not in fixed
    saturating = by_name(truck, OneStage(tyres="saturating"))["mass_scale"]
    assert saturating.scale == pytest.approx(quantity_of("mass_scale").sigma)
    for path, load in truck.axle_loads().items():
        assert saturating.slopes[f"{path}.static_load"] == pytest.approx(load, rel=1e-6)
    assert "tractor.front.static_load" not in moved


def test_delays_of_time_bases(truck: Vehicle) -> None:
    """One for each time base but that of the steering; channels without a name are on the main one."""
    bases = {"yaw_rate.semitrailer": "trailer", "roll_rate.semitrailer": "trailer", "yaw_rate.tractor": "imu"}
    delays = {u.name: dict(u.slopes) for u in time_base_delays(bases, "", RATES, OneStage())}
    assert delays == {
        "time_base.trailer.delay": {"yaw_rate.semitrailer.delay": 1.0, "roll_rate.semitrailer.delay": 1.0},
        "time_base.imu.delay": {"yaw_rate.tractor.delay": 1.0},
    }
    by_imu = time_base_delays({"yaw_rate.tractor": "imu", "steer.tractor.front": "imu"}, "imu", RATES, OneStage())
    (main,) = by_imu
    assert main.name == "time_base.main.delay"
    assert set(main.slopes) == {"yaw_rate.semitrailer.delay", "roll_rate.semitrailer.delay"}
    assert time_base_delays(bases, "", RATES, OneStage(given={"sensors": "exact", "road.bank": "exact"})) == []


STEER, ACCELERATION = "steer.tractor.front", "lateral_acceleration.tractor"
GYRO, HITCH = "yaw_rate.tractor", "articulation.semitrailer"
WHEELS = "wheel_speed_difference.semitrailer"
OUTPUTS = (GYRO, "roll_rate.tractor", HITCH, ACCELERATION, WHEELS)


def test_sensor_errors_have_the_stated_prior(truck: Vehicle) -> None:
    """Bounds are at eight times its standard deviation; both methods have the same usual errors of those they share."""
    kinds = {
        "speed": "delay",
        STEER: "offset gain delay play",
        GYRO: "offset gain misalignment",
        "roll_rate.tractor": "offset gain misalignment",
        HITCH: "offset",
        ACCELERATION: "offset gain delay position height",
        WHEELS: "offset gain load_sensitivity delay",
    }
    names = {f"{signal}.{kind}" for signal, own in kinds.items() for kind in own.split()}
    steered = truck.with_logged_steering({STEER}, "")
    usual = {u.name: u for u in one_stage_unknowns(steered, OUTPUTS, OneStage())}
    assert {name for name, u in usual.items() if not (u.reported or u.is_uncertain)} == names
    assert {"mass_scale", f"{GYRO}.delay"} <= usual.keys()
    given = {name: f"+- 0.0123 {sensor_error_unit(name).removesuffix('1')}" for name in names}
    stated = by_name(truck, OneStage(given=given), OUTPUTS)
    for name in names - {f"{ACCELERATION}.position", f"{ACCELERATION}.height"}:
        unknown, mean = stated[name], float(name.endswith("gain"))
        assert (unknown.scale, unknown.centre, unknown.logarithmic) == (0.0123, mean, False)
        assert (unknown.is_uncertain, unknown.is_sensor_error) == (False, True)
        assert unknown.per_log == name.endswith("offset")
        bounds = (0.0 if name.endswith("play") else mean - 8 * 0.0123, mean + 8 * 0.0123)
        assert (unknown.lower, unknown.upper) == pytest.approx(bounds)
    two_stage = {u.name: u for u in sensor_unknowns(steered, OUTPUTS[:3], TwoStage())}
    offsets = {f"{name}.offset" for name in (STEER, GYRO, "roll_rate.tractor", HITCH)}
    assert two_stage.keys() == offsets | {f"{STEER}.gain", f"{STEER}.delay"}
    assert all(u.scale == usual[name].scale for name, u in two_stage.items())
    assert {name for name, u in two_stage.items() if u.per_log} == offsets
    assert sensor_unknowns(steered, OUTPUTS[:3], TwoStage(given={"sensors": "exact"})) == []


def test_the_places_of_several_accelerometers(truck: Vehicle) -> None:
    """A sensor with a name has its own place; one that the vehicle file does not name is where the unit's is."""
    front, rear = Accelerometer(position=-1.2, height=0.9), Accelerometer(position=-4.1, height=1.1)
    tractor = truck.unit("tractor").model_copy(update={"accelerometer": front, "accelerometers": {"rear": rear}})
    there = truck.model_copy(update={"units": (tractor, *truck.units[1:])})
    there = there.with_stated({"tractor.accelerometer.position": 0.03, "tractor.accelerometers.rear.position": 0.07})
    names = [ACCELERATION, f"{ACCELERATION}.rear", f"{ACCELERATION}.roof"]
    unknowns = by_name(there, OneStage(), (*OUTPUTS, *names[1:]))
    for name, place, sigma in zip(names, (front, rear, front), (0.03, 0.07, 0.03), strict=True):
        position = unknowns[f"{name}.position"]
        assert (position.centre, position.scale) == (place.position, sigma)
        assert sensor_parameters(there, name)[f"{name}.height"] == place.height


def test_the_filter_of_two_stages_starts_with_its_own_sigma(truck: Vehicle) -> None:
    """As a fraction of the prior, which `given` states; the random walk likewise. A number is a variance, SI."""
    names = ("tractor.front.cornering_stiffness", HEIGHT)
    settings = TwoStage(
        given={"cornering_stiffness": "+- 20 %", HEIGHT: "0.4 m +- 0.5 m"},
        P_p={"cornering_stiffness": "+- 2 %", names[0]: "+- 1 %", HEIGHT: "+- 100 mm"},
        Q_p={names[0]: 475**2, HEIGHT: 0.025**2},
    )
    stiffness, height = parameter_unknowns(truck, names, settings)
    assert filter_sigmas(stiffness, settings) == pytest.approx((0.05, 475 / (0.2 * stiffness.centre)))
    assert filter_sigmas(height, settings) == pytest.approx((0.2, 0.05))
    assert (height.centre, height.scale) == (0.4, 0.5)
    usual = parameter_unknowns(truck, names, TwoStage())
    assert {filter_sigmas(u, TwoStage()) for u in usual} == {(1.0, 0.0)}
    linear = parameter_unknowns(truck, names[:1], TwoStage(logarithmic=False, given={names[0]: "+- 20 %"}))[0]
    assert (linear.logarithmic, linear.scale) == (False, pytest.approx(0.2 * linear.centre))
    fixed = parameter_unknowns(truck, names, TwoStage(given={**dict.fromkeys(names[:1], "exact")}))
    assert [u.name for u in fixed] == [HEIGHT]


def test_estimates_are_within_the_range_of_a_vehicle_file(truck: Vehicle) -> None:
    """A value outside the range widens it."""
    unknowns, ranges = by_name(truck, OneStage()), truck.parameter_ranges()
    assert ranges["semitrailer.sprung.cog_height"] == (0.2, 5.0)
    for name in ranges.keys() & unknowns.keys():
        u = unknowns[name]
        if not u.moves:
            assert ranges[name][0] <= u.lower <= u.centre < u.upper <= ranges[name][1], name
    height = unknowns["semitrailer.sprung.cog_height"]
    assert (height.lower, height.upper) == (0.2, 5.0)
    wide, widest = height.reaching(12.0), height.reaching(99.0)
    assert (wide.lower, wide.upper) == pytest.approx((height.centre * math.exp(-1.2), height.centre * math.exp(1.2)))
    assert (widest.lower, widest.upper) == (0.2, 5.0)
    low = height.within(2.0, 3.0)
    assert (low.lower, low.upper, low.possible) == (height.centre, 3.0, (height.centre, 3.0))
    offset = unknowns["yaw_rate.tractor.offset"].reaching(30.0)
    assert (offset.lower, offset.upper) == pytest.approx((-0.12, 0.12))


PRODUCT = "tractor.sprung.roll_yaw_product"


def test_a_number_that_may_be_zero(truck: Vehicle) -> None:
    """It is reported with the standard deviation of the file or of every file; without one the error says so."""
    zero = truck.replace({PRODUCT: 0.0})
    stated = zero.with_stated({PRODUCT: 500.0})
    for vehicle, name, centre, scale in (
        (stated, PRODUCT, 0.0, 500.0),
        (truck, "tractor.cog", truck.parameters()["tractor.cog"], 0.05),
    ):
        u = by_name(vehicle, OneStage(reported=(name,)))[name]
        assert (u.reported, u.logarithmic, u.centre) == (True, False, centre)
        assert u.scale == pytest.approx(scale)
    u = by_name(stated, OneStage())[PRODUCT]
    assert (u.is_uncertain, u.logarithmic, u.centre, u.scale) == (True, False, 0.0, 500.0)
    with pytest.raises(VehicleError, match="product: nothing is known of its uncertainty; state it"):
        by_name(zero, OneStage(reported=(PRODUCT,)))
    with pytest.raises(VehicleError, match="product: may be 0; give its standard deviation"):
        by_name(zero, OneStage(given={PRODUCT: "free"}))
    with pytest.raises(VehicleError, match="percent of 0 is 0"):
        by_name(zero, OneStage(given={PRODUCT: "+- 30 %"}))


def test_what_is_reported_keeps_its_prior(truck: Vehicle) -> None:
    name = "tractor.yaw_inertia"
    uncertain, listed = by_name(truck, OneStage())[name], by_name(truck, OneStage(reported=("yaw_inertia",)))[name]
    assert (uncertain.reported, listed.reported) == (False, True)
    assert (uncertain.centre, uncertain.scale) == (listed.centre, listed.scale)
    assert by_name(truck, OneStage(given={name: "free"}))[name].scale == 0.3
    assert name not in by_name(truck, OneStage(reported=(name,), given={name: "exact"}))
    with pytest.raises(VehicleError, match=r"yaw_inerta: no such parameter.*yaw_inertia"):
        by_name(truck, OneStage(reported=("yaw_inerta",)))
