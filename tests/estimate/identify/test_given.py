"""What a user states of a number: its forms, where it goes, what is refused, and its effect on a result."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as of_test
from hypothesis import strategies as st

from fifthwheel.apps.cheng_cebon_2011 import TwoStage
from fifthwheel.apps.cheng_cebon_2011.problem import parameter_unknowns
from fifthwheel.apps.workflow.start import chosen_one_stage, identification_settings
from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.options import IdentifyOptions, TyreLaw
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify import CommonSettings, OneStage
from fifthwheel.estimate.identify.given import applied, possible_names, require_signals
from fifthwheel.estimate.identify.setup import Setup
from fifthwheel.estimate.identify.statement import Statement, combined, parse, prior_of
from fifthwheel.estimate.identify.statement import stated as stated_on
from fifthwheel.estimate.identify.unknowns.parameters import estimated_parameters, one_stage_unknowns, time_base_delays
from fifthwheel.truck import Vehicle, changes, get
from fifthwheel.truck.quantities import ROADS, unit_of
from tests.truck.test_classes import TEXT

TRUCK = get("cheng_cebon_2011")
SATURATING = OneStage(tyres="saturating")
BODY, LOAD = "semitrailer.sprung.mass", "semitrailer.payload.mass"
HEIGHT, TRAILER = "semitrailer.payload.height", "semitrailer.cornering_stiffness"
GAIN, DELAY = "steer.tractor.front.gain", "yaw_rate.semitrailer.delay"
OUTPUTS = ("yaw_rate.tractor", "yaw_rate.semitrailer", "roll_rate.semitrailer")


def stated(*texts: str, settings: Any = None, vehicle: Vehicle = TRUCK) -> tuple[Vehicle, Any]:
    settings = settings or OneStage()
    return applied(vehicle, replace(settings, given={**settings.given, **combined(map(parse, texts))}))


def prior(name: str, *texts: str, settings: OneStage | None = None) -> tuple[float, float] | None:
    """Prior mean and standard deviation of an unknown; None where it is none."""
    vehicle, chosen = stated(*texts, settings=settings)
    unknowns = {u.name: u for u in one_stage_unknowns(vehicle, OUTPUTS, chosen)}
    return (unknowns[name].centre, unknowns[name].prior_sigma) if name in unknowns else None


@pytest.mark.parametrize(
    ("text", "statement"),
    [
        ("a.mass=31 t +- 1 %", Statement(name="a.mass", value="31 t", sigma="1 %", kind="sigma")),
        ("a.mass=31 t±1%", Statement(name="a.mass", value="31 t", sigma="1%", kind="sigma")),
        ("a.mass=+- 1 %", Statement(name="a.mass", sigma="1 %", kind="sigma")),
        ("a.mass = 31 t", Statement(name="a.mass", value="31 t")),
        ("a.mass=31 t exact", Statement(name="a.mass", value="31 t", kind="exact")),
        ("a.mass=exact", Statement(name="a.mass", kind="exact")),
        ("a.mass=free", Statement(name="a.mass", kind="free")),
        ("a.mass=31 t free", Statement(name="a.mass", value="31 t", kind="free")),
        ("road.friction=wet", Statement(name="road.friction", value="wet")),
    ],
)
def test_the_forms_of_a_statement(text: str, statement: Statement) -> None:
    assert parse(text) == statement
    assert parse(str(statement)) == statement


def test_numbers_of_the_vehicle() -> None:
    """Value and sigma may be two statements; the end of a path states each number by its own fraction."""
    assert stated(settings=OneStage()) == (TRUCK, OneStage())
    texts = ("semitrailer.mass=33.6 t +- 0.5 %", "fifth_wheel.height=+- 1 cm", "tractor.mass=7.3 t")
    vehicle, settings = stated(*texts)
    assert (vehicle.unit("semitrailer").mass, vehicle.unit("tractor").mass) == (33600.0, 7300.0)
    assert vehicle.stated == {"semitrailer.mass": pytest.approx(168.0), "fifth_wheel.height": pytest.approx(0.01)}
    assert settings.given == {"semitrailer.mass": "+- 0.5 %", "fifth_wheel.height": "+- 1 cm"}
    assert stated("semitrailer.mass=+- 0.5 %", "semitrailer.mass=33.6 t", *texts[1:]) == (vehicle, settings)
    assert stated("tractor.mass=7.3 t", "mass=+- 1 %")[0].stated["tractor.mass"] == pytest.approx(73)
    vehicle, _ = stated("roll_damping=+- 20 %")  # the fifth wheel has none
    assert set(vehicle.stated) == {f"{path}.roll_damping" for path in ("tractor.front", "tractor.drive", "semitrailer")}
    assert vehicle.stated["semitrailer.roll_damping"] == pytest.approx(24e3)


@pytest.mark.parametrize(
    ("texts", "body", "load"),
    [
        ([f"{LOAD}=15 t exact"], 33450 - 2250 - 15000, 15000),
        (["semitrailer.mass=35 t"], 11078, 35000 - 2250 - 11078),
        ([f"{LOAD}=21 t", "semitrailer.mass=35 t"], 35000 - 2250 - 21000, 21000),
        ([f"{LOAD}=+- 1 %", "semitrailer.mass=35 t"], 35000 - 2250 - 20122, 20122),
        ([f"{LOAD}=15 t", f"{BODY}=12 t"], 12000, 15000),
        ([f"{LOAD}=+- 1 %"], 11078, 20122),
    ],
)
def test_axles_keep_their_mass(texts: list[str], body: float, load: float) -> None:
    for settings in (OneStage(), TwoStage()) if "+-" not in texts[0] else (OneStage(),):
        parameters = stated(*texts, settings=settings)[0].parameters()
        assert (parameters[BODY], parameters[LOAD]) == pytest.approx((body, load))
    body_alone, _ = stated("tractor.mass=7.5 t")
    assert body_alone.unit("tractor").sprung.mass == pytest.approx(TRUCK.unit("tractor").sprung.mass + 300)


@pytest.mark.parametrize("statement", ["15 t", "26.1 t +- 100 kg"])
def test_a_mass_is_as_in_the_vehicle_file(statement: str) -> None:
    """The numbers that classes give follow from it, with their sigmas and sources."""
    without = Vehicle.loads(TEXT.replace('[unit.payload]\nmass = "20 t +- 300 kg"', "[unit.payload]"))
    assert {LOAD, BODY} <= without.assumed.keys()
    expected = Vehicle.loads(TEXT.replace("20 t +- 300 kg", statement))
    assert stated(f"{LOAD}={statement}", vehicle=without)[0] == expected
    lighter = Vehicle.loads(TEXT.replace("33.45 t", "31 t").replace("20 t +- 300 kg", statement))
    assert stated(f"{LOAD}={statement}", "semitrailer.mass=31 t +- 1 %", vehicle=without)[0] == lighter


@pytest.mark.parametrize(
    ("statement", "shift", "sigma"),
    [
        ("7.7 m +- 10 cm", 0.3, 0.1),
        ("7.7 m +- 1 %", 0.3, 0.077),
        ("+- 40 cm", 0.0, 0.4),
        ("free", 0.0, 0.5),
        ("7.7 m exact", 0.3, 0.0),
        ("7.7 m", 0.3, None),
    ],
)
def test_a_wheelbase_moves_all_axles_of_the_unit_together(statement: str, shift: float, sigma: float | None) -> None:
    paths = [f"semitrailer.{axle}.position" for axle in ("front", "middle", "rear")]
    vehicle, _ = stated(f"semitrailer.wheelbase={statement}")
    before, after = TRUCK.parameters(), vehicle.parameters()
    assert [after[path] - before[path] for path in paths] == pytest.approx([shift] * 3)
    assert [vehicle.stated.get(path) for path in paths] == ([None] * 3 if sigma is None else pytest.approx([sigma] * 3))
    (change,) = [change for change in changes(vehicle) if change.name == "semitrailer.axle_positions"] or [None]
    assert (change is None) == (sigma == 0)


def test_the_cog_is_as_uncertain_as_the_wheelbase_that_it_was_weighed_with() -> None:
    """By the same fraction, beside its own uncertainty; unless it is stated too, or exact."""
    cog, length = TRUCK.parameters()["semitrailer.cog"], TRUCK.derived()["semitrailer.wheelbase"]
    (own,) = [change.slopes["semitrailer.cog"] for change in changes(TRUCK) if change.name == "semitrailer.cog"]
    vehicle, _ = stated("semitrailer.wheelbase=+- 40 cm")
    assert vehicle.stated["semitrailer.cog"] == pytest.approx(math.hypot(own, 0.4 * abs(cog) / length))
    vehicle, _ = stated("semitrailer.wheelbase=+- 40 cm", "semitrailer.cog=+- 2 cm")
    assert vehicle.stated["semitrailer.cog"] == pytest.approx(0.02)
    vehicle, _ = stated("semitrailer.wheelbase=exact")
    assert vehicle.stated["semitrailer.cog"] == pytest.approx(own)


ROLL, KINDS = (
    "semitrailer.roll_stiffness",
    ("steer.*.delay=+- 5 ms", "yaw_rate.*.gain=exact", "misalignment=+- 0.5 deg"),
)


@pytest.mark.parametrize(
    ("name", "texts", "expected"),
    [
        (ROLL, (), (2.7e6, 0.27e6)),
        (ROLL, (f"{ROLL}=2600 kN m/rad +- 100 kN m/rad",), (2.6e6, 0.1e6)),
        (ROLL, (f"{ROLL}=exact",), None),
        (TRAILER, (f"{TRAILER}=1300 kN/rad",), (1.3e6, 0.39e6)),
        (HEIGHT, (), (1.4, 0.75)),
        (HEIGHT, (f"{HEIGHT}=+- 10 %",), (1.23, 0.123)),
        (HEIGHT, (f"{HEIGHT}=2 m",), (2.0, 0.75)),
        (GAIN, (f"{GAIN}=1.03",), (1.03, 0.15)),
        (GAIN, ("steer.*.gain=1.03 +- 2 %",), (1.03, 0.0206)),
        (DELAY, (f"{DELAY}=20 ms +- 5 ms",), (0.02, 0.005)),
        ("yaw_rate.tractor.delay", (f"{DELAY}=20 ms +- 5 ms",), (0.0, 0.01)),
        ("steer.tractor.front.play", ("steer.tractor.front.play=0.3 deg +- 0.1 deg",), (0.00523599, 0.00174533)),
        ("steer.tractor.front.delay", KINDS, (0.0, 0.005)),
        ("yaw_rate.tractor.gain", KINDS, None),
        ("roll_rate.semitrailer.misalignment", KINDS, (0.0, 0.00872665)),
        # an exact sensor error reaches the model, and the logs cannot change it
        (GAIN, (f"{GAIN}=1.03 exact",), (1.03, 0.0)),
        (DELAY, (f"{DELAY}=20 ms exact",), (0.02, 0.0)),
        ("yaw_rate.tractor.gain", ("yaw_rate.tractor.gain=1.01 exact",), (1.01, 0.0)),
    ],
)
def test_the_prior_is_as_stated(name: str, texts: tuple[str, ...], expected: tuple[float, float] | None) -> None:
    assert prior(name, *texts) == (expected and pytest.approx(expected, abs=1e-6))


def test_exact_and_free_parameters() -> None:
    vehicle, settings = stated(f"{HEIGHT}=2 m exact")
    assert (vehicle.parameters()[HEIGHT], settings.given, vehicle.stated[HEIGHT]) == (2.0, {HEIGHT: "exact"}, 0.0)
    article = IdentifyOptions(method="article", statements=(f"{HEIGHT}=exact",))
    assert identification_settings(TRUCK, article)[1].given == {"sensors": "exact", HEIGHT: "exact"}
    assert prior("tractor.yaw_inertia", "tractor.yaw_inertia=24000 kg m^2 free") == pytest.approx((24e3, 7.2e3))
    assert prior("tractor.cog", "tractor.cog=free") == (-1.03, 0.5)
    names = estimated_parameters(*stated("tractor.cog=free", "tractor.front.cornering_stiffness=exact"))
    assert "tractor.cog" in names
    assert "tractor.front.cornering_stiffness" not in names
    with pytest.raises(FifthwheelError, match="expected a standard deviation below 100 % of the value"):
        prior(TRAILER, f"{TRAILER}=+- 100 %")


def test_the_road_and_errors_of_the_model() -> None:
    linear = OneStage(tyres="linear")
    assert Setup.of(TRUCK, OUTPUTS, replace(linear, given={"bank": "+- 0.01 rad"})).bank_sigma == 0.01
    level = Setup.of(TRUCK, OUTPUTS, replace(linear, given={"road.bank": "exact"}))
    assert (level.bank_sigma, level.model.bank) == (0.0, False)
    expected = {(): (0.75, 0.3), ("road.friction=0.6 +- 10 %",): (0.6, 0.06), ("friction=wet exact",): None}
    expected |= {(f"road.friction={name}",): (road.value, road.sigma * road.value) for name, road in ROADS.items()}
    for texts, friction in expected.items():
        assert prior("road.friction", *texts, settings=SATURATING) == (friction and pytest.approx(friction))
    vehicle, settings = stated("friction=wet exact", settings=SATURATING)
    assert Setup.of(vehicle, OUTPUTS, settings).given["road.friction"] == 0.5
    assert prior("tyre.shape", "tyre.shape=+- 5 %", settings=SATURATING) == pytest.approx((1.1, 0.055))
    assert prior("tyre.shape", "tyre.shape=1.2", settings=SATURATING) == pytest.approx((1.2, 0.144))
    assert prior("tractor.front.softening", "softening=exact", settings=linear) is None
    assert prior("tractor.front.softening", "tractor.front.softening=3 1/rad +- 10 %", settings=linear) == (3.0, 0.3)
    assert prior(f"{TRAILER}.variation", "variation=+- 3 %") == (0.0, 0.03 * 1.0)
    assert prior("time_base", "time_base=exact") is None
    _, settings = stated("discrepancy=+- 2 %", "road.bank_variation=+- 1 deg")
    assert prior_of(settings.given, "discrepancy")[1] == 0.02
    assert prior_of(settings.given, "road.bank_variation")[1] == pytest.approx(math.radians(1))
    delays = time_base_delays({"yaw_rate.tractor": "gps"}, "", OUTPUTS, stated("time_base.*.delay=+- 20 ms")[1])
    assert [u.prior_sigma for u in delays] == [0.02]


OF_GROUPS = {
    "others": {HEIGHT, TRAILER, "semitrailer.yaw_inertia", GAIN, DELAY, "time_base"},
    "truck": {GAIN, DELAY, "time_base"},
    "sensors": {HEIGHT, TRAILER, "semitrailer.yaw_inertia", "tractor.mass", "semitrailer.roll_stiffness"},
    "*": set(),
}


@pytest.mark.parametrize("group", OF_GROUPS)
def test_a_group_is_exact(group: str) -> None:
    """What is uncertain beside it; a more specific statement counts."""
    vehicle, settings = stated(f"{group}=exact", settings=OneStage(tyres="linear"))
    uncertain = {u.name for u in one_stage_unknowns(vehicle, OUTPUTS, settings)}
    assert OF_GROUPS[group] <= uncertain
    shown = {HEIGHT, TRAILER, "semitrailer.yaw_inertia", GAIN, DELAY, "time_base", "tractor.mass"}
    assert uncertain & (shown - OF_GROUPS[group]) == set()
    assert prior("tractor.mass", "truck=exact", "tractor.mass=+- 1 %") == (7200.0, pytest.approx(72))
    if group != "*":
        return
    assert estimated_parameters(*stated("*=exact", "tractor.cog=free")) == ["tractor.cog"]


def test_the_most_specific_statement_counts() -> None:
    """Value and sigma each; by the letters of the pattern, in any order."""
    texts = (f"{TRAILER}=+- 1 %", "cornering_stiffness=+- 2 %", "semitrailer.*=+- 3 %")
    for order in (texts, texts[::-1]):
        given = combined(map(parse, order))
        assert stated_on(given, TRAILER, "N/rad", 1e6).sigma == 1e4
        assert stated_on(given, "tractor.front.cornering_stiffness", "N/rad", 1e6).sigma == 2e4
        assert stated_on(given, "semitrailer.yaw_inertia", "kg m^2", 1e5).sigma == 3e3
    assert stated_on({"tyre.*": "1.2", "*.shape": "+- 5 %"}, "tyre.shape", "1", 1.1).value == 1.2
    with pytest.raises(FifthwheelError, match=r"tyre.shape: expected one statement, got 'tyre.\*=.*; remove one"):
        stated_on({"tyre.*": "+- 4 %", "*shape": "+- 5 %"}, "tyre.shape", "1", 1.1)


def test_twice_is_once() -> None:
    texts = ("semitrailer.wheelbase=7.7 m +- 10 cm", "tractor.mass=7.3 t", "others=exact", "tractor.cog=free")
    once = stated(*texts, f"{GAIN}=1.02 +- 1 %", f"{HEIGHT}=1.5 m")
    assert applied(*once) == once


def test_every_number_that_can_be_stated_is_used_or_refused() -> None:
    for law, first in ((OneStage(tyres="linear"), 0), (SATURATING, 3)):
        for name in list(possible_names(TRUCK, law))[first::7]:
            assert prior(name, f"{name}=exact", settings=law) is None


def test_two_stages_take_values_exact_numbers_and_priors_of_what_they_estimate() -> None:
    texts = ("tractor.mass=7.3 t", "payload.height=0.2 m +- 0.5 m", "cornering_stiffness=+- 20 %")
    vehicle, settings = stated(*texts, settings=TwoStage())
    assert vehicle.unit("tractor").mass == 7300.0
    front, height = parameter_unknowns(vehicle, ["tractor.front.cornering_stiffness", HEIGHT], settings)
    assert (front.scale, height.centre, height.scale) == (0.2, 0.2, 0.5)
    with pytest.raises(FifthwheelError, match=r"payload\.height: two stages need its standard deviation, or exact"):
        stated("payload.height=0.2 m", settings=TwoStage())


LINEAR: dict[str, str] = {
    "mass": "expected NAME=",
    "tractor.mass=+-": "expected a standard deviation behind",
    "tractor.mass=7 t +- 1 % exact": "keep only one",
    "semitrailer.pneumatic_trail=+- 1 cm": "semitrailer.pneumatic_trail has no value in the vehicle file; state one",
    "tractor.mas=+- 5 %": "no such parameter.*did you mean 'tractor.mass'",
    "yaw_inertia=24000 kg m^2": "fits tractor.yaw_inertia, semitrailer.yaw_inertia; give the whole path",
    "tractor.mass=7200": "expected a number with a unit.*add its unit",
    "tractor.mass=-7 t": r"tractor\.mass: expected more than 1900 kg, the mass of axles, got -7000 kg; correct",
    "semitrailer.mass=free": "semitrailer.mass: lateral motion alone does not determine a mass; give its standard dev",
    "semitrailer.axle_positions=free": r"share; state these with .*, such as semitrailer\.front\.position='\+- 2",
    "mass_scale=+- 1 %": r"got the error that tractor\.mass, .* share; .* such as tractor\.mass='\+- 1 %'",
    "tractor.mass=+- -5 %": "0 or more, got .*; give its magnitude",
    "steer.*.gain=+- -5 %": "0 or more, got .*; give its magnitude",
    "tractor.mass=+- 5": "expected a unit.*write '\\+- 5 kg'",
    "fifth_wheel.roll_damping=+- 10 %": "percent of 0 is 0",
    "yaw_rate.tractor.colour=exact": "has no error 'colour'; available: offset",
    "steer.tractor.rear.gain=exact": "no steer angle of cheng.*did you mean 'steer.tractor.front'",
    "roll.tractor.offset=exact": "expected a signal that is compared with the model",
    "yaw_rate.tractor.gain=free": r"is estimated already; give .* '\+- 0.005'",
    "steer.tractor.front.play=-1 deg exact": "expected 0 or more",
    "speed.gain=1 +- 1 %": r"speed has no error 'gain'; .*delay",
    "road.bank=1 deg +- 1 deg": "has the mean 0; state only its standard deviation",
    "time_base=0.1 +- 1 %": "has the mean 0; state only its standard deviation",
    "road.friction=wet": 'linear tyres have no friction.*tyres="saturating"',
    "tyre.shape=+- 5 %": "linear tyres have no such parameter",
}
OF_SATURATING_TYRES = {
    "road.friction=dusty": "expected a number or one of dry, wet, snow, ice, unknown, got 'dusty'",
    "road.friction=7": "friction: expected between 0.05 and 6, got 7",
    "road.friction=0": "friction: expected between 0.05 and 6, got 0",
    "tyre.shape=free": "is no number of a vehicle file",
    "softening=+- 50 %": 'saturating tyres soften by their law.*tyres="linear"',
}
OF_TWO_STAGES = (
    *("tractor.mass=+- 1 %", "tractor.yaw_inertia=free", "yaw_inertia=+- 20 %"),
    *("road.bank=+- 1 deg", "steer.tractor.front.play=+- 1 deg", "speed.delay=+- 5 ms", "yaw_rate.*.gain=exact"),
    *("road.friction=wet", "softening=exact", "tyre.shape=+- 5 %"),
)


@pytest.mark.parametrize(
    ("text", "message", "settings"),
    [
        *[(text, message, OneStage(tyres="linear")) for text, message in LINEAR.items()],
        *[(text, message, OneStage()) for text, message in OF_SATURATING_TYRES.items()],
        *[(text, message, SATURATING) for text, message in OF_SATURATING_TYRES.items()],
        *[(text, "needs one stage", TwoStage()) for text in OF_TWO_STAGES],
    ],
)
def test_what_cannot_be_used_is_refused(text: str, message: str, settings: CommonSettings) -> None:
    with pytest.raises(FifthwheelError, match=message) as refused:
        stated(text, settings=settings)
    assert text.partition("=")[0].rpartition(".")[2] in str(refused.value), "the message names the key"


def test_statements_that_disagree_are_refused() -> None:
    pairs = [("tractor.mass=7 t", "tractor.mass=7.1 t"), ("tractor.mass=exact", "tractor.mass=+- 1 %")]
    for pair in (*pairs, (f"{GAIN}=1 +- 1 %", f"{GAIN}=1 +- 2 %")):
        with pytest.raises(FifthwheelError, match=r"expected one statement, got .*; remove one"):
            stated(*pair)


def test_a_sensor_that_no_log_has_is_refused() -> None:
    record = Record(time=[0.0, 1.0], signals={"speed": [20.0, 20.0], "yaw_rate.tractor": [0.0, 0.1]})
    _, settings = stated(f"{DELAY}=20 ms", f"{HEIGHT}=2 m", "tractor.cog=free")
    with pytest.raises(FifthwheelError, match=r"semitrailer\.delay: expected .*they have yaw_rate\.tractor; map"):
        require_signals(settings, record)
    _, settings = stated("yaw_rate.tractor.delay=20 ms", f"{HEIGHT}=2 m", "tractor.cog=free")
    require_signals(settings, record)
    require_signals(TwoStage(), record)
    _, settings = stated("wheel_speed_difference.semitrailer.gain=1 +- 1 %")
    with pytest.raises(FifthwheelError, match="they have none"):
        require_signals(settings, record)
    wheels = {f"wheel_speed.semitrailer.{side}": np.array([20.0, 20.0]) for side in ("left", "right")}
    require_signals(settings, record.with_signals(wheels))


# Nothing that is stated is dropped

FULL = TRUCK.with_logged_steering({"steer.tractor.front"}, "log").replace(
    {
        "tractor.sprung.roll_yaw_product": 250.0,
        "tractor.drive.pneumatic_trail": 0.05,
        "semitrailer.front.command_steering": 0.0,
        "semitrailer.middle.self_steering": 0.3,
    }
)
VEHICLES = (FULL, get("a_double"), get("truck_full_trailer"))
numbers = st.sampled_from([(vehicle, path) for vehicle in VEHICLES for path in vehicle.parameters()])
laws = st.sampled_from([OneStage(tyres="linear"), SATURATING])


def total_prior(path: str, vehicle: Vehicle, settings: OneStage) -> float:
    """Prior sigma of a number of the truck by all unknowns that the logs share, SI."""
    outputs = [f"yaw_rate.{unit.name}" for unit in vehicle.units]
    unknowns = [u for u in one_stage_unknowns(vehicle, outputs, settings) if not (u.is_sensor_error or u.per_log)]
    return math.hypot(*[u.slopes.get(path, 0.0) * u.prior_sigma for u in unknowns])


def stating(vehicle: Vehicle, path: str, sigma: float, how: str, tyres: TyreLaw) -> tuple[Vehicle, OneStage]:
    """A sigma, or exact at 0, in one of both ways to state it."""
    text = f"{path}=+- {sigma!r} {unit_of(path).removesuffix('1')}" if sigma else f"{path}=exact"
    options = IdentifyOptions(tyres=tyres, statements=(text,) if how == "--set" else ())
    return chosen_one_stage(vehicle.with_stated({path: sigma}) if how == "file" else vehicle, options)


@of_test(deadline=None, max_examples=20)
@given(numbers, laws, st.sampled_from(["file", "--set"]))
def test_a_stated_sigma_is_the_prior_sigma(number: tuple[Vehicle, str], settings: OneStage, how: str) -> None:
    """Of every number of a vehicle file, in both ways to state it; an exact one has no prior."""
    vehicle, path = number
    value = vehicle.parameters()[path]
    sigma = 0.013 * abs(value) or 0.013
    try:
        found, message = total_prior(path, *stating(vehicle, path, sigma, how, settings.tyres)), ""
    except FifthwheelError as error:
        found, message = math.nan if value else sigma, str(error)
    assert found == pytest.approx(sigma)
    assert not message or path in message
    exact = stating(vehicle, path, 0.0, how, settings.tyres)
    assert total_prior(path, *exact) == 0.0
    assert path not in estimated_parameters(*exact)


@of_test(deadline=None, max_examples=6)
@given(numbers, laws)
def test_a_free_number_is_estimated_or_refused(number: tuple[Vehicle, str], settings: OneStage) -> None:
    vehicle, path = number
    chosen = IdentifyOptions(tyres=settings.tyres, statements=(f"{path}=free",))
    sigma, priors = 0.01 * abs(vehicle.parameters()[path]), set()
    for stated in (vehicle, vehicle.with_stated({path: sigma}), vehicle.with_stated({path: 0.0})):
        try:
            found = chosen_one_stage(stated, chosen)
        except FifthwheelError as error:
            message = str(error)
        else:
            message = ""
            assert path in estimated_parameters(*found)
            priors.add(total_prior(path, *found))
        assert not message or path in message
    assert len(priors) < 2, "what the file states has no effect on a wide prior"
    assert min(priors, default=math.inf) > sigma


def test_what_the_file_states_of_an_estimated_parameter() -> None:
    """A value of a class is a guess, and so is one of a simulated vehicle, whose numbers are all exact."""
    known = TRUCK.with_stated({HEIGHT: 0.02, TRAILER: 4e4})
    (height, stiffness) = (
        {u.name: u for u in one_stage_unknowns(known, OUTPUTS, OneStage())}[n] for n in (HEIGHT, TRAILER)
    )
    assert (height.centre, height.prior_sigma) == (1.23, 0.02)
    assert (stiffness.prior_sigma, stiffness.tail) == (pytest.approx(4e4), math.inf)
    simulated = TRUCK.with_stated(dict.fromkeys(TRUCK.parameters(), 0.0))
    assert estimated_parameters(simulated, OneStage()) == estimated_parameters(TRUCK, OneStage())
    guess = Vehicle(**known.model_dump() | {"assumed": {HEIGHT: "class", TRAILER: "class"}})
    assert total_prior(TRAILER, guess, OneStage()) == pytest.approx(0.3 * 1.273e6)
    assert total_prior(HEIGHT, guess, OneStage()) == 0.75


def test_a_statement_replaces_what_was_stated_before() -> None:
    """Settings of an earlier result are the base of the next identification."""
    before = OneStage(tyres="linear", given={TRAILER: "+- 20 %", "roll_stiffness": "+- 20 %", HEIGHT: "1 m +- 0.1 m"})
    assert total_prior(TRAILER, *stated(f"{TRAILER}=exact", settings=before)) == 0.0
    assert total_prior(HEIGHT, *stated(f"{HEIGHT}=free", settings=before)) == 0.75
    path = "semitrailer.roll_stiffness"
    assert total_prior(path, *stated(f"{path}=+- 5 %", settings=before)) == pytest.approx(0.05 * 2.7e6)
    moved = stated("tractor.cog=free")[1]
    assert total_prior("tractor.cog", *stated("tractor.cog=+- 5 cm", settings=moved)) == pytest.approx(0.05)
