"""The equations of motion against Lagrange's method, and evidence of the article's misprint."""

from collections.abc import Callable

import numpy as np
import pytest

from fifthwheel.model.dynamics import matrices
from fifthwheel.truck import Axle, AxleGroup, Coupling, Payload, SprungMass, Unit, Vehicle, get
from tests.model.dynamics.lagrangian import Array, linear

KMH_88 = 88 / 3.6


def with_relaxation(vehicle: Vehicle, *lengths: float) -> Vehicle:
    """The vehicle with one relaxation length for all axle groups, or one for each group from front to rear, m."""
    paths = [path for path in vehicle.parameters() if path.endswith(".relaxation_length")]
    return vehicle.replace(dict(zip(paths, lengths if len(lengths) > 1 else lengths * len(paths), strict=True)))


def with_trail(vehicle: Vehicle, *trails: float) -> Vehicle:
    """The vehicle with pneumatic trails of its first axle groups, m."""
    paths = [path for path in vehicle.locations() if path.endswith(".pneumatic_trail")]
    return vehicle.replace(dict(zip(paths, trails, strict=False)))


TRUCK = get("cheng_cebon_2011")
ARTICLE = with_relaxation(TRUCK, 0.0)


def group(name: str, stiffness: float, roll: float, *axles: Axle) -> AxleGroup:
    rolling = {"roll_stiffness": roll, "tyre_roll_stiffness": 2.5 * roll, "roll_damping": 0.04 * roll}
    return AxleGroup(name=name, axles=axles, cornering_stiffness=stiffness, **rolling)


def b_double() -> Vehicle:
    """Three units with non-zero values of everything that is zero in the article's truck."""
    front = group("front", 4.1e5, 3.4e5, Axle(name="front", position=0.1, steerable=True))
    drive = group("drive", 9.3e5, 9e5, Axle(name="second", position=-4.3), Axle(name="third", position=-5.6))
    axles = group("axles", 8.8e5, 2e6, Axle(name="one", position=-6.9), Axle(name="two", position=-8.2))
    lift, rigid = Axle(name="lift", position=-5.9), Axle(name="rigid", position=-7.3)
    steered = Axle(name="steered", position=-8.7, steerable=True)

    def sprung(mass: float, height: float, inertia: float, product: float) -> SprungMass:
        return SprungMass(mass=mass, cog_height=height, roll_inertia=inertia, roll_yaw_product=product)

    def wheel(name: str, ahead: float, behind: float, height: float, *numbers: float) -> Coupling:
        names = ("roll_stiffness", "roll_damping", "yaw_stiffness", "yaw_damping")
        place = {"leading_position": ahead, "trailing_position": behind, "height": height}
        return Coupling(name=name, **place, **dict(zip(names, numbers, strict=True)))

    tractor = {"mass": 8600, "cog": -1.9, "yaw_inertia": 41000, "roll_axis_height": 0.55}
    lead = {"mass": 24000, "cog": -4.3, "yaw_inertia": 150000, "roll_axis_height": 0.75}
    lead |= {"payload": Payload(mass=15500, height=1.4, width=2.3, floor_height=1.2)}
    last = {"mass": 21000, "cog": -5.2, "yaw_inertia": 210000, "roll_axis_height": 0.82}
    last |= {"payload": Payload(mass=11900, height=1.1, width=2.2, floor_height=1.15, shape="point")}
    of_last = (group("front", 3.9e5, 8e5, lift), group("rear", 7.7e5, 1.7e6, rigid, steered))
    units = (
        Unit(name="tractor", **tractor, sprung=sprung(6400, 1.12, 5100, 1900), axle_groups=(front, drive)),
        Unit(name="lead", **lead, sprung=sprung(6100, 1.3, 7900, -4100), axle_groups=(axles,)),
        Unit(name="last", **last, sprung=sprung(7300, 1.25, 8300, 6500), axle_groups=of_last),
    )
    wheels = (
        wheel("front_wheel", -4.8, 0.2, 1.2, 2.4e6, 1.3e4, 3.1e4, 2.7e4),
        wheel("rear_wheel", -7.6, -0.1, 1.3, 1.9e6, 2.1e4, 2.2e4, 1.9e4),
    )
    return Vehicle(name="b_double", units=units, couplings=wheels)


def changed(vehicle: Vehicle, draw: Callable[[float, float], float], *, masses: bool) -> Vehicle:
    """The vehicle with every parameter drawn from a plausible range; masses change only with `masses`."""
    values = {}
    eyes = {coupling.name for coupling in vehicle.couplings if coupling.kind == "drawbar_eye"}
    for path, value in vehicle.parameters().items():
        owner, _, quantity = path.rpartition(".")
        if quantity in ("position", "cog", "leading_position", "trailing_position"):
            values[path] = value + draw(-0.2, 0.2)
        elif quantity == "mass":  # the mass of a unit may only increase, its sprung mass only decrease
            is_unit = owner in {unit.name for unit in vehicle.units}
            values[path] = value * (draw(1.0, 1.2) if is_unit else draw(0.8, 1.0)) if masses else value
        elif "height" in quantity or quantity == "width":
            values[path] = value * draw(0.8, 1.2)
        else:
            values[path] = value * draw(0.7, 1.4)
        if quantity == "roll_damping" and not value and owner not in eyes:
            values[path] = draw(0.0, 5e4)
    result = vehicle.replace(values)
    for unit in result.units:  # a larger product would make the mass matrix singular
        body, m = result.derived(), unit.laden_sprung_mass
        moment = m * (body[f"{unit.name}.cog_height"] - unit.roll_axis_height)
        bound = np.sqrt(unit.yaw_inertia * (body[f"{unit.name}.roll_inertia"] - moment**2 / unit.mass))
        result = result.replace({f"{unit.name}.sprung.roll_yaw_product": draw(-0.9, 0.9) * float(bound)})
    return result


KINDS = {
    "article": ARTICLE,
    "truck": TRUCK,
    "b_double, some relaxation": with_relaxation(b_double(), 0.0, 0.52, 0.0, 0.0, 0.57),
    "truck_dolly_semitrailer": get("truck_dolly_semitrailer"),
    "truck, some trail": with_trail(TRUCK, 0.03, 0.06),
    "b_double, all relaxation, trail": with_trail(
        with_relaxation(b_double(), 0.41, 0.52, 0.48, 0.36, 0.57), 0.03, 0.06, 0.05, 0.04, 0.07
    ),
}
VEHICLES = KINDS | {
    f"{name}, all changed": changed(vehicle, np.random.default_rng(seed).uniform, masses=True)
    for seed, (name, vehicle) in enumerate(KINDS.items(), 1)
}


def difference(actual: Array, expected: Array) -> float:
    """Largest difference, relative to the largest element of its row; a row whose terms cancel counts as zero."""
    size = np.abs(expected)
    scale = np.maximum(size.max(axis=1, keepdims=True), 1e-6 * size.max())
    return float((np.abs(actual - expected) / scale).max())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "roll"),
    [
        ("article", True),
        ("truck, some trail", True),
        ("truck, some trail", False),
        ("truck_dolly_semitrailer", True),
        ("b_double, some relaxation", True),
        ("b_double, all relaxation, trail", False),
    ],
)
def test_equals_lagrange(name: str, roll: bool) -> None:
    vehicle = VEHICLES[f"{name}, all changed"]
    actual = matrices(vehicle, KMH_88, roll=roll)
    expected = linear(vehicle, KMH_88, roll=roll).ordered(actual.states)
    for matrix in "EFGAB":
        assert difference(getattr(actual, matrix), getattr(expected, matrix)) < 1e-9, matrix
    ours, theirs = np.linalg.eigvals(actual.A), np.linalg.eigvals(expected.A)
    distance = np.abs(ours[:, None] - theirs) / np.abs(theirs)
    assert max(distance.min(axis=0).max(), distance.min(axis=1).max()) < 1e-9


@pytest.mark.slow
def test_every_parameter_changes_both_derivations_equally() -> None:
    """A change of any parameter changes A or B of the library, and those of the oracle by the same amount."""
    vehicle = VEHICLES["b_double, all relaxation, trail, all changed"]
    without_value = vehicle.locations().keys() - vehicle.parameters().keys()
    assert {path.rpartition(".")[2] for path in without_value} == {"self_steering", "command_steering"}
    before = matrices(vehicle, 15.0, roll=True)
    for path, value in vehicle.parameters().items():
        if path == "last.payload.width":
            continue  # a point mass has no width
        other = vehicle.replace({path: value * 1.001 if value else 0.001})
        actual = matrices(other, 15.0, roll=True)
        expected = linear(other, 15.0).ordered(actual.states)
        change = max(difference(actual.A, before.A), difference(actual.B, before.B))
        assert change > 1e-9, path
        assert max(difference(actual.A, expected.A), difference(actual.B, expected.B)) < 1e-6 * change, path


@pytest.mark.slow
def test_misprint_of_the_roll_equation() -> None:
    """(A3) and (A6) as printed count m_s h^2 phi'' twice: the trailer's roll mode then has 1.09 instead of 1.44 Hz."""
    m = matrices(ARTICLE, KMH_88, roll=True)
    printed = m.E.copy()
    for unit in ARTICLE.units:
        i = m.states.index(f"roll_rate.{unit.name}")
        lever = ARTICLE.derived()[f"{unit.name}.cog_height"] - unit.roll_axis_height
        printed[i, i] += unit.laden_sprung_mass * lever**2
    for E, undamped, damped in ((m.E, 1.441, 1.394), (printed, 1.092, 1.072)):
        eigenvalues = np.linalg.eigvals(np.linalg.solve(E, m.F)) / (2 * np.pi)
        mode = min(eigenvalues, key=lambda value: abs(abs(value) - undamped))
        assert (abs(mode), abs(mode.imag)) == pytest.approx((undamped, damped), abs=0.001)
