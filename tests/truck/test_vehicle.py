"""Paths of parameters, validation, and chains of units."""

import subprocess
import sys
from typing import Any

import pytest

from fifthwheel.base.errors import SignalError, VehicleError
from fifthwheel.truck import Axle, AxleGroup, Coupling, SprungMass, Unit, Vehicle, catalogue, unit_of
from fifthwheel.truck.component import Component, NonNegative, number

ARTICLE = catalogue.get("cheng_cebon_2011")
PATHS = tuple(ARTICLE.parameters())


def group(name: str = "axles", *positions: float) -> AxleGroup:
    axles = tuple(Axle(name=f"{name}{i}", position=x) for i, x in enumerate(positions))
    return AxleGroup(
        name=name, axles=axles, cornering_stiffness=4e5, roll_stiffness=4e5, tyre_roll_stiffness=2e6, roll_damping=1e4
    )


def unit(name: str = "truck", **changes: Any) -> Unit:
    sprung = SprungMass(mass=5000, cog_height=1.1, roll_inertia=3000)
    fields: dict[str, Any] = {
        "mass": 7000,
        "cog": -2,
        "yaw_inertia": 2e4,
        "roll_axis_height": 0.6,
        "sprung": sprung,
        "axle_groups": (group("front", 0), group("drive", -4)),
    }
    return Unit(name=name, **(fields | changes))


def b_double() -> Vehicle:
    middle = unit("middle", cog=-4, axle_groups=(group("axles", -6, -8),))
    last = unit("last", cog=-4, axle_groups=(group("axles", -7, -9),))
    wheels = (
        Coupling(name="front_wheel", leading_position=-3.5, trailing_position=0, height=1.2, roll_stiffness=3e6),
        Coupling(name="rear_wheel", leading_position=-7, trailing_position=0, height=1.2, roll_stiffness=3e6),
    )
    return Vehicle(name="b_double", units=(unit("tractor"), middle, last), couplings=wheels)


def test_a_number_without_a_unit_cannot_exist() -> None:
    """Every number of a component is a parameter: a class with one that is not cannot be defined."""
    for annotation in (float, NonNegative, NonNegative | None):
        with pytest.raises(TypeError, match=r"Bad\.camber: a number"):
            type("Bad", (Component,), {"__annotations__": {"camber": annotation}, "camber": None})
    with pytest.raises(TypeError, match=r"Bad\.tyres: a number"):
        type("Bad", (Component,), {"__annotations__": {"tyres": int}, "tyres": number("1", "Their number.")})
    with pytest.raises(TypeError, match=r"^mass: expected kg, as mass elsewhere, got t"):
        type("Bad", (Component,), {"__annotations__": {"mass": float}, "mass": number("t", "Of the load.")})


def test_replace_changes_one_value() -> None:
    before = ARTICLE.parameters()
    assert len(PATHS) == 8 + 2 * 6 + 8 + 4 + 5 + 3 + 5
    for path in PATHS:
        value = before[path] * 1.001 or 1e-3
        assert ARTICLE.replace({path: value}).parameters() == before | {path: value}
    assert ARTICLE.parameters() == before


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        ("tractor.mass", -1.0, r"tractor\.mass: expected a number > 0, got -1"),
        ("tractor.mass", float("inf"), r"tractor\.mass: expected a finite number"),
        ("tractor.sprung.mass", 7200.0, r"tractor\.sprung\.mass: expected less than the mass of the unit"),
        ("semitrailer.payload.mass", 3e4, r"semitrailer\.sprung\.mass \+ payload\.mass: expected less"),
        ("tractor.drive.cornering_stiffness", -7e5, r"tractor\.drive\.cornering_stiffness: expected a number >"),
        ("tractor.cog", 1.03, r"tractor\.cog: expected between -3\.7 and 0 m"),
        ("semitrailer.middle.position", float("nan"), r"semitrailer\.middle\.position: expected a finite number"),
        ("semitrailer.roll_damping", -1.0, r"semitrailer\.roll_damping: expected a number >= 0"),
        ("fifth_wheel.leading_position", 3.1, r"fifth_wheel\.leading_position: expected between"),
        ("fifth_wheel.trailing_position", -10.0, r"fifth_wheel\.trailing_position: expected between"),
        ("tractor.front.cornering_stifness", 1.0, r"tractor\.front\.cornering_stifness: .*front\.cornering_stiffness"),
    ],
)
def test_impossible_values_name_the_path(path: str, value: float, message: str) -> None:
    with pytest.raises(VehicleError, match=f"^{message}[^\n]*$"):
        ARTICLE.replace({path: value})


def test_wrong_names_and_structures_are_refused() -> None:
    with pytest.raises(VehicleError, match="lower-case"):
        Axle(name="Front axle", position=0)
    with pytest.raises(VehicleError, match=r"cog_height: expected a value, got none"):
        SprungMass(mass=1, roll_inertia=1)  # type: ignore[call-arg]
    with pytest.raises(VehicleError, match="couplings: expected 1 between 2 units, got 0"):
        Vehicle(name="uncoupled", units=ARTICLE.units)
    with pytest.raises(VehicleError, match="did you mean 'semitrailer'"):
        ARTICLE.unit("trailer")
    with pytest.raises(VehicleError, match="did you mean 'cornering_stiffness'"):
        unit_of("tractor.front.cornering_stifness")
    with pytest.raises(VehicleError, match="axle_groups: expected different names, got front"):
        unit(axle_groups=(group("front", 0), group("front", -4)))
    with pytest.raises(VehicleError, match="sprung: expected another name"):
        unit(axle_groups=(group("front", 0), group("sprung", -4)))
    with pytest.raises(VehicleError, match="expected different names, got tractor"):
        Vehicle(**(ARTICLE.model_dump() | {"couplings": [ARTICLE.couplings[0].model_dump() | {"name": "tractor"}]}))


def test_axles_without_a_logged_steer_angle_are_locked() -> None:
    front = "steer.tractor.front"
    locked = ARTICLE.with_logged_steering({front, "speed"}, "the log")
    assert ARTICLE.steer_signals() == (front, *(f"steer.semitrailer.{axle}" for axle in ("front", "middle", "rear")))
    assert locked.steer_signals() == (front,)
    assert locked.parameters() == ARTICLE.parameters()
    two = {front, "steer.semitrailer.rear"}
    assert set(ARTICLE.with_logged_steering(two, "the log").steer_signals()) == two
    with pytest.raises(SignalError, match=r"^steer\.tractor\.front: not in the log; map"):
        ARTICLE.with_logged_steering({"speed"}, "the log")
    with pytest.raises(VehicleError, match="set steerable = true"):
        Vehicle(name="unsteered", units=(unit(),)).with_logged_steering({front}, "the log")


def test_the_engine_drives_what_the_file_states_or_the_fixed_axles_of_the_first_unit() -> None:
    assert catalogue.get("cheng_cebon_2011").driven_groups() == ("tractor.drive",)
    bus = catalogue.get("articulated_bus")
    assert bus.driven_groups() == ("rear",)
    puller = Vehicle.loads(bus.to_toml().replace("driven = true", ""))
    assert puller.driven_groups() == ("front.middle",)


def test_axle_loads_of_a_chain_balance_weight_and_moment() -> None:
    vehicle = b_double()
    loads = vehicle.axle_loads()
    assert list(loads) == ["tractor.front", "tractor.drive", "middle", "last"]
    assert sum(loads.values()) == pytest.approx(21000 * 9.80665, rel=1e-13)
    offsets = {"tractor": 0.0, "middle": -3.5, "last": -3.5 - 7}  # origins of the straight vehicle
    at = {u.group_path(g): g.position + offsets[u.name] for u in vehicle.units for g in u.axle_groups}
    weight = sum(u.mass * 9.80665 * (u.cog + offsets[u.name]) for u in vehicle.units)
    assert sum(loads[path] * x for path, x in at.items()) == pytest.approx(weight, rel=1e-13)


def test_axle_loads_need_two_supports() -> None:
    three = Vehicle(name="three", units=(unit(axle_groups=(group("a", 0), group("b", -3), group("c", -5))),))
    with pytest.raises(VehicleError, match=r"truck: expected two supports .*, got 3"):
        three.axle_loads()


def test_import_is_light() -> None:
    """A vehicle needs neither NumPy nor CasADi, and imports only some of the base."""
    program = (
        "import sys, fifthwheel.truck as v; v.get('cheng_cebon_2011');"
        "print(*[m for m in sys.modules if m in ('numpy', 'casadi') or m.startswith('fifthwheel.')])"
    )
    loaded = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout.split()
    assert {m for m in loaded if not m.startswith("fifthwheel.truck")} == {
        "fifthwheel.base",
        "fifthwheel.base.lazy",
        "fifthwheel.base.errors",
        "fifthwheel.base.names",
        "fifthwheel.base.options",
        "fifthwheel.base.settings",
        "fifthwheel.base.spelling",
        "fifthwheel.base.units",
        "fifthwheel.base.formatting",
        "fifthwheel.base.atomic",
        "fifthwheel.base.input_files",
    }
