"""The equations of motion against Lagrange's method, and evidence of the article's misprint."""

from collections.abc import Callable

import numpy as np
import pytest

from fifthwheel.model.dynamics import matrices, modes
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
    return AxleGroup(
        name=name,
        axles=axles,
        cornering_stiffness=stiffness,
        roll_stiffness=roll,
        tyre_roll_stiffness=2.5 * roll,
        roll_damping=0.04 * roll,
    )


def b_double() -> Vehicle:
    """Three units with non-zero values of everything that is zero in the article's truck."""
    tractor = Unit(
        name="tractor",
        mass=8600,
        cog=-1.9,
        yaw_inertia=41000,
        roll_axis_height=0.55,
        sprung=SprungMass(mass=6400, cog_height=1.12, roll_inertia=5100, roll_yaw_product=1900),
        axle_groups=(
            group("front", 4.1e5, 3.4e5, Axle(name="front", position=0.1, steerable=True)),
            group("drive", 9.3e5, 9e5, Axle(name="second", position=-4.3), Axle(name="third", position=-5.6)),
        ),
    )
    lead = Unit(
        name="lead",
        mass=24000,
        cog=-4.3,
        yaw_inertia=150000,
        roll_axis_height=0.75,
        sprung=SprungMass(mass=6100, cog_height=1.3, roll_inertia=7900, roll_yaw_product=-4100),
        payload=Payload(mass=15500, height=1.4, width=2.3, floor_height=1.2),
        axle_groups=(group("axles", 8.8e5, 2e6, Axle(name="one", position=-6.9), Axle(name="two", position=-8.2)),),
    )
    last = Unit(
        name="last",
        mass=21000,
        cog=-5.2,
        yaw_inertia=210000,
        roll_axis_height=0.82,
        sprung=SprungMass(mass=7300, cog_height=1.25, roll_inertia=8300, roll_yaw_product=6500),
        payload=Payload(mass=11900, height=1.1, width=2.2, floor_height=1.15, shape="point"),
        axle_groups=(
            group("front", 3.9e5, 8e5, Axle(name="lift", position=-5.9)),
            group(
                "rear",
                7.7e5,
                1.7e6,
                Axle(name="rigid", position=-7.3),
                Axle(name="steered", position=-8.7, steerable=True),
            ),
        ),
    )
    wheels = (
        Coupling(
            name="front_wheel",
            leading_position=-4.8,
            trailing_position=0.2,
            height=1.2,
            roll_stiffness=2.4e6,
            roll_damping=1.3e4,
            yaw_stiffness=3.1e4,
            yaw_damping=2.7e4,
        ),
        Coupling(
            name="rear_wheel",
            leading_position=-7.6,
            trailing_position=-0.1,
            height=1.3,
            roll_stiffness=1.9e6,
            roll_damping=2.1e4,
            yaw_stiffness=2.2e4,
            yaw_damping=1.9e4,
        ),
    )
    return Vehicle(name="b_double", units=(tractor, lead, last), couplings=wheels)


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
    angles = [i for i, name in enumerate(m.states) if name.startswith(("articulation", "roll."))]

    def trailer_roll(A: Array) -> complex:
        """The least damped oscillation in which the trailer's roll angle is larger than any other angle."""
        values, vectors = np.linalg.eig(A)
        modes_of_trailer = [
            complex(value)
            for value, vector in zip(values, vectors.T, strict=True)
            if value.imag > 0 and m.states[max(angles, key=lambda i: abs(vector[i]))] == "roll.semitrailer"
        ]
        return min(modes_of_trailer, key=lambda value: -value.real / abs(value))

    corrected, misprinted = (trailer_roll(np.asarray(np.linalg.solve(E, m.F))) for E in (m.E, printed))
    undamped = np.abs([corrected, misprinted]) / (2 * np.pi)
    damped = np.array([corrected.imag, misprinted.imag]) / (2 * np.pi)
    assert undamped == pytest.approx([1.441, 1.092], abs=0.001)
    assert damped == pytest.approx([1.394, 1.072], abs=0.001)
    assert any(mode.frequency == pytest.approx(undamped[0]) for mode in modes(ARTICLE, KMH_88))
    expected = linear(ARTICLE, KMH_88).ordered(m.states)
    assert trailer_roll(expected.A) == pytest.approx(corrected, rel=1e-9)  # Lagrange agrees with the correction
