"""Which parameters are estimated, uncertain or fixed, by their names."""

import math

import pytest

from fifthwheel.apps.cheng_cebon_2011 import TwoStage
from fifthwheel.apps.cheng_cebon_2011.problem import parameter_unknowns, sensor_unknowns
from fifthwheel.apps.cheng_cebon_2011.stage import filter_sigmas
from fifthwheel.base.errors import VehicleError
from fifthwheel.estimate.design import DesignSettings, design_experiment, predict_sigmas
from fifthwheel.estimate.identify import OneStage, identify
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
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import Vehicle
from fifthwheel.truck.quantities import quantity_of
from fifthwheel.truck.unit import Accelerometer

HEIGHT = "semitrailer.payload.height"
RATES = ("yaw_rate.tractor", "yaw_rate.semitrailer", "roll_rate.semitrailer")


def in_vehicle(
    truck: Vehicle, settings: OneStage, outputs: tuple[str, ...] = RATES
) -> tuple[Vehicle, tuple[str, ...], OneStage]:
    """Arguments of `one_stage_unknowns` with what the settings state of the vehicle."""
    vehicle, settings = applied(truck, settings)
    return vehicle, outputs, settings


def test_the_vehicle_file_replaces_a_default_that_is_considered(truck: Vehicle) -> None:
    def sigma(settings: OneStage, stated: float) -> float | None:
        vehicle = truck.with_stated({"semitrailer.roll_stiffness": stated})
        unknowns = {u.name: u for u in one_stage_unknowns(*in_vehicle(vehicle, settings))}
        return unknowns["semitrailer.roll_stiffness"].scale if "semitrailer.roll_stiffness" in unknowns else None

    value = truck.parameters()["semitrailer.roll_stiffness"]
    assert sigma(OneStage(), 0.03 * value) == pytest.approx(0.03)
    assert sigma(OneStage(), 0.0) is None
    assert sigma(OneStage(given={"others": "exact", "roll_stiffness": "+- 20 %"}), 0.03 * value) == 0.2


def test_paths_by_their_end(truck: Vehicle) -> None:
    stiffnesses = [name for name in stage_1_names(truck) if name.endswith(".cornering_stiffness")]
    assert truck.paths(["cornering_stiffness", stiffnesses[0]]) == stiffnesses
    assert truck.paths(["payload.height"]) == [HEIGHT]
    with pytest.raises(VehicleError, match=r"ering_stiffness: no such parameter in .*cheng"):
        truck.paths(["ering_stiffness"])


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
    given = {"others": "exact", "sensors": "exact", "relaxation_length": "+- 30 %", "roll_damping": "+- 20 %"}
    settings = OneStage(given=given)
    unknowns = one_stage_unknowns(*in_vehicle(truck, settings))
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
        unknowns = one_stage_unknowns(*in_vehicle(truck, settings))
        return {u.name for u in unknowns if u.is_uncertain}

    assert "tractor.sprung.cog_height" in uncertain(OneStage())
    assert "semitrailer.sprung.cog_height" in uncertain(OneStage())
    inertia = "semitrailer.sprung.roll_inertia"
    assert inertia not in uncertain(OneStage())
    assert inertia in uncertain(OneStage(given={HEIGHT: "exact"}))
    assert uncertain(OneStage(given={"others": "exact", "sensors": "exact", inertia: "+- 10 %"})) == {inertia}
    height = "semitrailer.sprung.cog_height"
    assert by_name(truck.with_stated({height: 0.02}), OneStage())[height].prior_sigma == pytest.approx(0.02)


def test_priors(truck: Vehicle) -> None:
    """Standard deviation and slope agree with the transformation z -> p."""
    for settings in (TwoStage(), TwoStage(logarithmic=False)):
        for u in parameter_unknowns(truck, [*stage_1_names(truck), HEIGHT], settings):
            expected = 1.0 if u.name == HEIGHT else 0.3 * truck.parameters()[u.name]
            assert u.prior_sigma == pytest.approx(expected)
            assert u.slope(u.centre) == pytest.approx(expected)


def by_name(truck: Vehicle, settings: OneStage, outputs: tuple[str, ...] = RATES) -> dict[str, Unknown]:
    return {u.name: u for u in one_stage_unknowns(*in_vehicle(truck, settings, outputs))}


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


def test_a_small_sigma_of_the_softening_keeps_its_mean(truck: Vehicle) -> None:
    u = by_name(truck, OneStage(tyres="linear", given={"softening": "+- 0.01 1/rad"}))["tractor.front.softening"]
    assert u.centre == softening_priors(truck)["tractor.front"][0]
    assert u.lower < u.centre < u.upper


def test_softening_without_static_loads(truck: Vehicle) -> None:
    """Two groups on one unit behind a coupling leave the loads open."""
    group = truck.units[1].axle_groups[0]
    axles = [group.model_copy(update={"name": f"part{i}", "axles": (axle,)}) for i, axle in enumerate(group.axles)]
    trailer = truck.units[1].model_copy(update={"axle_groups": tuple(axles)})
    undetermined = truck.model_copy(update={"units": (truck.units[0], trailer)})
    assert set(softening_priors(undetermined).values()) == {tuple(SOFTENING * x for x in SOFTENING_PRIOR)}


def test_all_but_the_reported_parameters_can_be_exact(truck: Vehicle) -> None:
    gyros = {f"{rate}.delay" for rate in RATES}
    full = {name for name, u in by_name(truck, OneStage()).items() if u.is_uncertain}
    variation = "semitrailer.cornering_stiffness.variation"
    assert gyros | {"mass_scale", "tractor.front.softening", "time_base", variation} <= full
    others = by_name(truck, OneStage(given={"others": "exact"})).values()
    assert {u.name for u in others if u.is_uncertain} == {"time_base", *gyros}


def test_axle_loads_of_saturating_tyres_change_with_the_masses(truck: Vehicle) -> None:
    """All by the same fraction."""
    scale = by_name(truck, OneStage(tyres="saturating"))["mass_scale"]
    assert scale.scale == pytest.approx(quantity_of("mass_scale").sigma)
    for path, load in truck.axle_loads().items():
        assert scale.slopes[f"{path}.static_load"] == pytest.approx(load, rel=1e-6)
    assert "tractor.front.static_load" not in by_name(truck, OneStage(tyres="linear"))["mass_scale"].slopes


def test_a_change_of_the_vehicle_file_leaves_other_unknowns_alone(truck: Vehicle) -> None:
    """Estimated, uncertain and fixed parameters are not part of a change; one without any other is left out."""
    moved = by_name(truck, OneStage())["mass_scale"].slopes
    assert {"tractor.mass", "semitrailer.mass", "tractor.sprung.mass"} <= set(moved)
    assert "semitrailer.yaw_inertia" not in moved  # estimated
    assert "tractor.yaw_inertia" not in moved  # has an unknown of its own
    fixed = by_name(truck, OneStage(given={"tractor.mass": "exact", "tractor.cog": "exact"}))
    assert "tractor.mass" not in fixed["mass_scale"].slopes
    assert "tractor.cog" not in fixed


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


def test_parameters_of_both_methods_have_their_priors(truck: Vehicle) -> None:
    """Stiffness and inertia by a fraction, between an eighth and eight times the value; heights in metres."""
    values = truck.parameters()
    given = {"cornering_stiffness": "+- 21 %", "yaw_inertia": "+- 21 %", "payload.height": "0.3 m +- 0.7 m"}
    unknowns = by_name(truck, OneStage(given=given))
    stiffness, height = unknowns["tractor.front.cornering_stiffness"], unknowns[HEIGHT]
    value = values["tractor.front.cornering_stiffness"]
    assert (stiffness.centre, stiffness.scale, stiffness.logarithmic) == (value, 0.21, True)
    assert (stiffness.lower, stiffness.upper) == pytest.approx((value / 8, value * 8))
    assert (height.centre, height.scale, height.logarithmic) == (0.3, 0.7, False)
    assert (height.lower, height.upper) == (0.01, 3.5)
    assert by_name(truck, OneStage(given={"payload.height": "+- 0.75 m"}))[HEIGHT].centre == values[HEIGHT]
    body = "semitrailer.sprung.roll_inertia"
    given = {"sprung.roll_inertia": "+- 55 %", "sprung.cog_height": "+- 21 %"}
    separate = by_name(truck.lumped(), OneStage(uniform_payload=False, given=given))
    assert (separate[body].scale, separate["semitrailer.sprung.cog_height"].scale) == (0.55, 0.21)


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


def test_who_brakes_differs_from_log_to_log(truck: Vehicle) -> None:
    """The fraction of engine and retarder is about a half, for all tyre laws."""
    for tyres in ("linear", "saturating"):
        brakes = by_name(truck, OneStage(tyres=tyres))["brakes.drive_axle"]
        assert (brakes.centre, brakes.scale, brakes.lower, brakes.upper, brakes.per_log) == (0.5, 0.4, 0.0, 1.0, True)
        assert brakes.is_uncertain
    assert "brakes.drive_axle" not in by_name(truck, OneStage(given={"brakes.drive_axle": "exact"}))


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


@pytest.mark.slow
def test_a_number_that_may_be_zero_in_results(truck: Vehicle) -> None:
    """A result shows it, a prediction and a design of a test compare its sigma with its prior."""
    front, record = "tractor.front.cornering_stiffness", simulate(truck, count=1, seed=3)
    zero = truck.replace({PRODUCT: 0.0}).with_stated({PRODUCT: 500.0})
    stated = identify(
        [record], truck.replace({PRODUCT: 0.0}), OneStage(given={PRODUCT: "+- 500 kg m^2"}, tyres="linear")
    )
    assert 0 < stated[PRODUCT].sigma <= 500.0
    assert PRODUCT in stated.summary()
    given = {"cornering_stiffness": "exact", "yaw_inertia": "exact", "payload.height": "exact", front: "free"}
    settings = OneStage(given=given, reported=(PRODUCT,), tyres="linear")
    assert 0 < predict_sigmas([record], zero, settings)[PRODUCT].relative_sigma <= 1
    few = DesignSettings(speeds=(24.0,), frequencies=(0.4,), accelerations=(1.0,), repetitions=(1, 4))
    assert 0 < design_experiment(zero, {front: 0.1}, settings, planning=few).best.sigma[PRODUCT] <= 1
