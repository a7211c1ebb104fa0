"""Vehicle classes: values and standard deviations for the numbers that a vehicle file does not have.

The value of a figure is near the middle of published sets, and sigma is their spread; where only one set has the
figure, or where the sets chose it, sigma is wider. The sets:

    article    C. Cheng, D. Cebon (2011), Vehicle System Dynamics 49: the vehicles `cheng_cebon_2011` and
               `cheng_cebon_2011_vehicle` of the catalogue, 4x2 tractor and three-axle semitrailer
    Auburn     GAVLab, Auburn University, five-axle TruckSim set: `auburn_6x4` and `auburn_6x4_unladen`
    Kraz       Project Chrono, Kraz 64431 (6x4) and three-axle semitrailer; BSD-3-Clause, see plant/LICENSE.chrono
    GOPS       iDLab, Tsinghua University, GOPS, Semitruck7DoF: 4x2 tractor and semitrailer; Apache-2.0

`complete` gives a vehicle the numbers that its file leaves to the class of a unit. Masses follow from each other,
inertias from masses and lengths, cornering stiffness from static axle loads.
"""

import copy
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from fifthwheel.base.errors import VehicleError, suggestion
from fifthwheel.truck.loads import Joint, SupportedBody, static_axle_loads
from fifthwheel.truck.unit import CouplingKind

LOAD_EXPONENT = 0.25
"""Standard deviation of the exponent to which the cornering coefficient changes with the load, chosen: the cornering
stiffness of a tyre rises less than in proportion to its load."""


class Figure(NamedTuple):
    """A number of a class with its standard deviation and its source."""

    value: float
    sigma: float
    source: str

    @property
    def relative(self) -> float:
        """Standard deviation as a fraction of the value."""
        return self.sigma / self.value if self.value else 0.0


class AxleFigures(NamedTuple):
    """Figures of one axle."""

    unsprung_mass: Figure  # kg
    roll_stiffness: Figure  # of the suspension, N m/rad
    tyre_roll_stiffness: Figure  # N m/rad
    cornering_coefficient: Figure  # cornering stiffness by static load, 1/rad
    nominal_load: float  # static load in the published sets, N


class BodyFigures(NamedTuple):
    """Figures of the body of a unit."""

    yaw_gyration: Figure  # radius of gyration of the unit in yaw, as a fraction of the wheelbase
    roll_gyration: Figure  # radius of gyration of the unladen sprung body in roll, m
    cog_height: Figure  # of the unladen sprung body, m
    roll_axis_height: Figure  # m


class CouplingFigures(NamedTuple):
    """Figures of the coupling in front of a unit."""

    height: Figure  # m
    roll_stiffness: Figure  # N m/rad
    kind: CouplingKind = "fifth_wheel"


@dataclass(frozen=True, kw_only=True)
class VehicleClass:
    """Figures of a kind of unit. The wheelbase is the distance of the front reference, which is the first axle of the
    first unit and the front coupling of the others, and the mean position of the other axles."""

    description: str
    groups: Mapping[str, tuple[AxleFigures, int]]
    """Figures of an axle of each group, front to rear, and usual number of axles, by the usual name of the group."""
    tare: Figure
    """Mass without payload, kg."""
    cog: Figure
    """Distance of the CoG from the front reference, as a fraction of the wheelbase."""
    body: BodyFigures
    coupling: CouplingFigures | None = None
    """The front coupling; None for a first unit."""
    steers_last: bool = False
    """Whether the last axle has a steer angle as an input; the first axle of a first unit has one."""

    @property
    def axle_counts(self) -> tuple[int, ...]:
        """Usual number of axles in each group."""
        return tuple(count for _, count in self.groups.values())

    def unsprung_mass(self, counts: Iterable[int]) -> tuple[float, float]:
        """Mass of axles and wheels with its standard deviation, kg, by the number of axles in each group; one error
        for all axles."""
        axles = [(n, figures.unsprung_mass) for n, (figures, _) in zip(counts, self.groups.values(), strict=True)]
        return sum(n * figure.value for n, figure in axles), sum(n * figure.sigma for n, figure in axles)


DAMPING_TIME = Figure(
    0.045, 0.02, "roll damping by roll stiffness: article 0.038 to 0.044 s, Auburn 0.043 to 0.05 s; Kraz up to 0.16 s"
)
"""s."""
RELAXATION_LENGTH = Figure(0.45, 0.1, "truck tyres at 30 to 50 kN: 0.4 to 0.6 m")
"""m."""
TYRES = {
    "single": Figure(1900e3, 250e3, "article 1900 kN m/rad and axle, chosen"),
    "twin": Figure(3500e3, 550e3, "Auburn and drive axle of the article 3500 kN m/rad and axle, chosen"),
}
"""Roll stiffness of the tyres of an axle, N m/rad."""

STEER_AXLE = AxleFigures(
    unsprung_mass=Figure(680, 120, "Auburn 570 kg, article 1900 kg for two axles, Kraz about 990 kg"),
    roll_stiffness=Figure(340e3, 60e3, "article 380, Kraz 331, Auburn 300 kN m/rad"),
    tyre_roll_stiffness=Figure(1900e3, 300e3, "article and Auburn 1900 kN m/rad, both chosen; 2 k y^2"),
    cornering_coefficient=Figure(7.0, 1.4, "article 6.8 and 7.0, Auburn 7.5 times the load of the axle"),
    nominal_load=65e3,
)
DRIVE_AXLE = AxleFigures(
    unsprung_mass=Figure(1150, 180, "article 1900 kg for two axles, Auburn 785 kg, Kraz about 1100 kg"),
    roll_stiffness=Figure(700e3, 180e3, "article 800, Kraz 378 kN m/rad and axle of a tandem"),
    tyre_roll_stiffness=Figure(3500e3, 550e3, "article and Auburn 3500 kN m/rad and axle, both chosen; twin tyres"),
    cornering_coefficient=Figure(7.0, 2.3, "Auburn 3.6 and 4.8, article 7.2 and 11 times the load of the axle"),
    nominal_load=105e3,
)
TANDEM_AXLE = AxleFigures(
    unsprung_mass=Figure(900, 150, "Auburn 785 kg, Kraz about 1100 kg"),
    roll_stiffness=Figure(420e3, 110e3, "Kraz 378, Auburn 400 kN m/rad and axle"),
    tyre_roll_stiffness=DRIVE_AXLE.tyre_roll_stiffness,
    cornering_coefficient=Figure(6.0, 2.0, "Auburn 3.6 and 4.8, article 7.2 and 11 times the load of the axle"),
    nominal_load=65e3,
)
TRAILER_AXLE = AxleFigures(
    unsprung_mass=Figure(720, 80, "article 700 and 750, Auburn 665 kg and axle"),
    roll_stiffness=Figure(800e3, 180e3, "article 900, Kraz 755, Auburn 700 kN m/rad and axle"),
    tyre_roll_stiffness=Figure(2500e3, 700e3, "article 1900, Auburn 3500 (twin tyres) kN m/rad and axle, both chosen"),
    cornering_coefficient=Figure(5.7, 1.7, "Auburn 2.0 and 5.1, article 5.7 and 8.1 times the load of the axle"),
    nominal_load=70e3,
)
FIFTH_WHEEL = CouplingFigures(
    height=Figure(1.2, 0.1, "article 1.2 m; Kraz 1.35 m"),
    roll_stiffness=Figure(3300e3, 1200e3, "article 3000 (chosen), GOPS 3550 kN m/rad; Kraz rigid in roll"),
)
DRAWBAR_EYE = CouplingFigures(
    height=Figure(0.6, 0.15, "chosen"),
    roll_stiffness=Figure(0.0, 0.0, "a drawbar eye carries no roll moment"),
    kind="drawbar_eye",
)
TURNTABLE = FIFTH_WHEEL._replace(
    roll_stiffness=Figure(3300e3, 1500e3, f"as a fifth wheel, wider: {FIFTH_WHEEL.roll_stiffness.source}"),
    kind="turntable",
)
TRACTOR = BodyFigures(
    yaw_gyration=Figure(0.45, 0.05, "Auburn and Kraz 0.41, article 0.47 and 0.48 of the wheelbase; GOPS 0.63"),
    roll_gyration=Figure(0.8, 0.15, "Kraz 0.59, GOPS 0.72, article 0.75, Auburn 1.03 m"),
    cog_height=Figure(1.12, 0.12, "article 1.05, Auburn 1.18, Kraz 1.33 m"),
    roll_axis_height=Figure(0.6, 0.1, "article and Auburn 0.6 m, both chosen"),
)
TRAILER = BodyFigures(
    yaw_gyration=Figure(
        0.46, 0.07, "Auburn 0.33 laden and 0.51 unladen, GOPS 0.43, article 0.44, Kraz 0.5 of the wheelbase"
    ),
    roll_gyration=Figure(1.2, 0.3, "article 1.0 m, Auburn 1.77 m; laden 1.06 m (GOPS) and 1.09 m (Kraz)"),
    cog_height=Figure(1.3, 0.2, "article 1.2 m, Auburn 1.6 m (chosen)"),
    roll_axis_height=Figure(0.79, 0.08, "article 0.77 and 0.81, Auburn 0.8 m (chosen)"),
)
RIGID = BodyFigures(
    yaw_gyration=Figure(0.48, 0.08, f"as a tractor, with a longer body: {TRACTOR.yaw_gyration.source}"),
    roll_gyration=Figure(0.9, 0.2, f"as a tractor, with a body: {TRACTOR.roll_gyration.source}"),
    cog_height=Figure(1.2, 0.15, f"as a tractor, with a body: {TRACTOR.cog_height.source}"),
    roll_axis_height=Figure(0.65, 0.12, f"as a tractor: {TRACTOR.roll_axis_height.source}"),
)
TRAILER_COG = Figure(0.67, 0.08, "Auburn 0.56 laden and 0.67 unladen, article 0.68, Kraz 0.79 of the wheelbase")
THREE_AXLE_TRACTOR_COG = Figure(0.38, 0.06, "Auburn 0.37, Kraz 0.48 of the wheelbase")


def _semitrailer(description: str, axles: int, tare: Figure, steers_last: bool = False) -> VehicleClass:
    return VehicleClass(
        description=description,
        groups={"axles": (TRAILER_AXLE, axles)},
        tare=tare,
        cog=TRAILER_COG,
        body=TRAILER,
        coupling=FIFTH_WHEEL,
        steers_last=steers_last,
    )


TWO_AXLE_TARE = Figure(5500, 1000, "Auburn 4.5 t; heavier bodies chosen")
THREE_AXLE_TARE = Figure(7500, 1500, "chosen: between 4.5 t on two axles (Auburn) and 13 t with tank frames (article)")

CLASSES: Mapping[str, VehicleClass] = {
    "tractor_4x2": VehicleClass(
        description="two-axle tractor",
        groups={"front": (STEER_AXLE, 1), "drive": (DRIVE_AXLE, 1)},
        tare=Figure(7200, 600, "article 6.9 and 7.2, GOPS 5.8 t"),
        cog=Figure(0.28, 0.04, "article 0.28, GOPS 0.28 of the wheelbase"),
        body=TRACTOR,
    ),
    "tractor_6x2": VehicleClass(
        description="three-axle tractor, one driven axle",
        groups={"front": (STEER_AXLE, 1), "drive": (TANDEM_AXLE, 2)},
        tare=Figure(8300, 800, "between 7.2 t of two axles (article) and 8.6 t of 6x4 (Auburn)"),
        cog=THREE_AXLE_TRACTOR_COG,
        body=TRACTOR,
    ),
    "tractor_6x4": VehicleClass(
        description="three-axle tractor, two driven axles",
        groups={"front": (STEER_AXLE, 1), "drive": (TANDEM_AXLE, 2)},
        tare=Figure(9000, 1000, "Auburn 8.6 t; Kraz 13.2 t"),
        cog=THREE_AXLE_TRACTOR_COG,
        body=TRACTOR,
    ),
    "semitrailer_2": _semitrailer("two-axle semitrailer", 2, TWO_AXLE_TARE),
    "semitrailer_3": _semitrailer("three-axle semitrailer", 3, THREE_AXLE_TARE),
    "semitrailer_2_steered": _semitrailer("two-axle semitrailer, last axle steered", 2, TWO_AXLE_TARE, True),
    "semitrailer_3_steered": _semitrailer("three-axle semitrailer, last axle steered", 3, THREE_AXLE_TARE, True),
    "b_double_lead": VehicleClass(
        description="lead trailer of a B-double, with a fifth wheel behind its axles",
        groups={"axles": (TRAILER_AXLE, 3)},
        tare=Figure(7500, 1500, "as a three-axle semitrailer"),
        cog=Figure(0.7, 0.1, "as a semitrailer, wider: the fifth wheel is part of the frame"),
        body=TRAILER,
        coupling=FIFTH_WHEEL,
    ),
    "truck_4x2": VehicleClass(
        description="two-axle rigid truck",
        groups={"front": (STEER_AXLE, 1), "drive": (DRIVE_AXLE, 1)},
        tare=Figure(8500, 1500, "chosen: the tractor of the article, 7 t, with a body"),
        cog=Figure(0.5, 0.12, "chosen: unladen 0.35, laden 0.65 of the wheelbase"),
        body=RIGID,
    ),
    "truck_6x2": VehicleClass(
        description="three-axle rigid truck",
        groups={"front": (STEER_AXLE, 1), "drive": (TANDEM_AXLE, 2)},
        tare=Figure(11000, 2000, "chosen: a three-axle tractor, 8.6 t (Auburn), with a body"),
        cog=Figure(0.58, 0.12, "chosen: unladen 0.45, laden 0.7 of the wheelbase"),
        body=RIGID,
    ),
    "dolly": VehicleClass(
        description="dolly: drawbar, axles and a fifth wheel",
        groups={"axles": (TRAILER_AXLE, 2)},
        tare=Figure(2800, 500, "chosen: frame and two axles of 0.7 t"),
        cog=Figure(0.9, 0.08, "chosen: near the axles"),
        body=BodyFigures(
            yaw_gyration=Figure(0.35, 0.1, "chosen: 1.4 m for a drawbar of 4 m"),
            roll_gyration=Figure(0.7, 0.2, "chosen"),
            cog_height=Figure(0.9, 0.15, "chosen"),
            roll_axis_height=TRAILER.roll_axis_height,
        ),
        coupling=DRAWBAR_EYE,
    ),
    "full_trailer": VehicleClass(
        description="body of a full trailer, on the turntable of a dolly",
        groups={"axles": (TRAILER_AXLE, 2)},
        tare=Figure(4500, 1000, "chosen: a two-axle semitrailer (Auburn) without its landing legs"),
        cog=Figure(0.5, 0.1, "chosen: the load lies between turntable and axles"),
        body=TRAILER._replace(yaw_gyration=Figure(0.45, 0.08, f"as a semitrailer: {TRAILER.yaw_gyration.source}")),
        coupling=TURNTABLE,
    ),
}
"""By the name that a vehicle file gives as `class`."""


Table = dict[str, Any]

PAYLOAD_WIDTH = Figure(2.4, 0.15, "article 2.11 and 2.2 m, Auburn 2.4 m; inner width of a body up to 2.48 m")
PAYLOAD_HEIGHT = Figure(1.3, 0.5, "article 1.15 and 1.23, Auburn 1.5 m")
FLOOR_HEIGHT = Figure(1.22, 0.1, "article 1.2, Auburn 1.25 m")


def complete(fields: Mapping[str, Any]) -> Table:
    """Fields of a vehicle, as from `toml_format.parse`, with the missing numbers of each unit that has a class, and of
    the coupling in front of it; `stated` has the standard deviation of each filled number, and `assumed` its source.

    A relaxation length needs no class: all truck tyres have nearly the same. A file for tyres without lag says 0. A
    VehicleError if a class does not exist or has other axle groups, or a number is missing that no class can give.
    """
    completed = copy.deepcopy(dict(fields))
    units, couplings = completed["units"], completed["couplings"]
    completion = _Completion(completed["stated"], completed.setdefault("assumed", {}))
    for unit in units:
        for group in unit["axle_groups"] if "name" in unit else ():
            completion.figure(group, _group_path(unit, group), "relaxation_length", RELAXATION_LENGTH)
    if not any(_class_name(unit) for unit in units):
        return completed
    for i, unit in enumerate(units):
        name = _class_name(unit)
        if name:
            coupling = couplings[i - 1] if 0 < i <= len(couplings) else None
            _require(unit, ("name",), f"unit[{i}]")
            _complete_coupling(completion, coupling, CLASSES[name])
            _complete_unit(completion, unit, coupling)
    loads = _axle_loads(units, couplings)
    for unit in units:
        if name := _class_name(unit):
            _complete_groups(completion, unit, CLASSES[name], loads)
    return completed


class _Completion:
    """Fills numbers in, with standard deviation and source."""

    def __init__(self, stated: dict[str, float], assumed: dict[str, str]) -> None:
        self.stated, self.assumed = stated, assumed

    def fill(self, table: Table, path: str, key: str, value: float, sigma: float | None, source: str) -> None:
        """Give a key a value if it has none; without a standard deviation the defaults for the key hold."""
        if key in table:
            return
        table[key] = value
        self.assumed[f"{path}.{key}"] = source
        if sigma is not None:
            self.stated[f"{path}.{key}"] = sigma

    def figure(self, table: Table, path: str, key: str, figure: Figure, factor: float = 1.0) -> None:
        """The same with a figure times a factor."""
        self.fill(table, path, key, factor * figure.value, abs(factor) * figure.sigma, figure.source)

    def inertia(self, table: Table, path: str, key: str, gyration: Figure, mass: float, length: float = 1.0) -> None:
        """The same with the inertia of a mass, kg, whose radius of gyration is a figure times a length, m."""
        inertia = mass * (gyration.value * length) ** 2
        source = f"radius of gyration: {gyration.source}"
        self.fill(table, path, key, inertia, 2 * gyration.relative * inertia, source)


def _class_name(unit: Table) -> str:
    name = unit.get("vehicle_class")
    if name is not None and name not in CLASSES:
        raise VehicleError(f"{unit.get('name', 'unit')}.class: no class {name!r}; {suggestion(str(name), CLASSES)}")
    return name or ""


def _complete_coupling(completion: _Completion, coupling: Table | None, kind: VehicleClass) -> None:
    """Height and roll stiffness of the coupling in front of a unit. The coupling is the usual origin of such a unit."""
    if coupling is None or kind.coupling is None:
        return
    path = coupling.setdefault("name", "fifth_wheel")
    coupling.setdefault("kind", kind.coupling.kind)
    coupling.setdefault("trailing_position", 0.0)
    completion.figure(coupling, path, "height", kind.coupling.height)
    completion.figure(coupling, path, "roll_stiffness", kind.coupling.roll_stiffness)


def _complete_unit(completion: _Completion, unit: Table, coupling: Table | None) -> None:
    """Masses, CoG, inertias and heights of a unit and of its payload."""
    name, kind = unit["name"], CLASSES[unit["vehicle_class"]]
    groups = unit["axle_groups"]
    if len(groups) != len(kind.groups):
        raise VehicleError(
            f"{name}.axle_group: expected {len(kind.groups)} for the class {unit['vehicle_class']}"
            f" ({', '.join(kind.groups)}), got {len(groups)}; put the axles of a tandem or tridem in one group, or give"
            " another class"
        )
    if kind.coupling and coupling is None:
        raise VehicleError(
            f"{name}.class: {unit['vehicle_class']} is for a unit behind another one; begin with the first unit, and"
            " give a coupling between each two"
        )
    for group in groups:
        for axle in group["axles"] or [{}]:
            _require(axle, ("position",), f"{name}.{axle.get('name', group.get('name', 'axles'))}")
    axles = [axle for group in groups for axle in group["axles"]]
    if kind.coupling is None or kind.steers_last:
        axles[-1 if kind.steers_last else 0].setdefault("steerable", True)
    reference = coupling["trailing_position"] if coupling else axles[0]["position"]
    others = axles if coupling else axles[len(groups[0]["axles"]) :]
    wheelbase = reference - sum(axle["position"] for axle in others) / len(others)
    _complete_masses(completion, unit, kind)
    cog = reference - kind.cog.value * wheelbase
    completion.fill(unit, name, "cog", cog, kind.cog.sigma * abs(wheelbase), kind.cog.source)
    completion.inertia(unit, name, "yaw_inertia", kind.body.yaw_gyration, unit["mass"], wheelbase)
    completion.figure(unit, name, "roll_axis_height", kind.body.roll_axis_height)
    sprung, body = unit["sprung"], f"{name}.sprung"
    completion.figure(sprung, body, "cog_height", kind.body.cog_height)
    completion.inertia(sprung, body, "roll_inertia", kind.body.roll_gyration, sprung["mass"])
    if payload := unit.get("payload"):
        path = f"{name}.payload"
        for key, figure in (("width", PAYLOAD_WIDTH), ("height", PAYLOAD_HEIGHT), ("floor_height", FLOOR_HEIGHT)):
            completion.figure(payload, path, key, figure)


def _complete_masses(completion: _Completion, unit: Table, kind: VehicleClass) -> None:
    """Mass of the unit, of its payload and of its sprung body: what is given gives the others."""
    name, payload, sprung = unit["name"], unit.get("payload"), unit.setdefault("sprung", {})
    unsprung, sigma_unsprung = kind.unsprung_mass(len(group["axles"]) for group in unit["axle_groups"])
    tare, sigma_tare, source = kind.tare
    if "mass" in sprung:
        tare, sigma_tare, source = sprung["mass"] + unsprung, sigma_unsprung, "sprung body and axles"
    if payload is None:
        completion.fill(unit, name, "mass", tare, sigma_tare, f"unladen: {source}")
    elif "mass" in unit:
        path, mass = f"{name}.payload", unit["mass"] - tare
        if "mass" not in payload and mass <= 0:
            raise VehicleError(
                f"{path}.mass: expected a value, because {name}.mass is {unit['mass']:g} kg and a unit of this class"
                f" has {tare:g} kg unladen; give it, or remove the payload"
            )
        completion.fill(payload, path, "mass", mass, sigma_tare, f"mass of the unit less its unladen mass: {source}")
    else:
        _require(payload, ("mass",), f"{name}.payload", "give it, or the mass of the laden unit")
        sigma = math.hypot(sigma_tare, completion.stated.get(f"{name}.payload.mass", 0.0))
        completion.fill(unit, name, "mass", tare + payload["mass"], sigma, f"payload and unladen mass: {source}")
    body = unit["mass"] - unsprung - (payload["mass"] if payload else 0.0)
    if "mass" not in sprung and body <= 0:
        raise VehicleError(
            f"{name}.mass: expected more than payload and axles, which have about {unit['mass'] - body:g} kg, got"
            f" {unit['mass']:g} kg; correct {name}.mass or {name}.payload.mass"
        )
    completion.fill(sprung, f"{name}.sprung", "mass", body, None, f"mass of the unit less {unsprung:g} kg of axles")


def _complete_groups(completion: _Completion, unit: Table, kind: VehicleClass, loads: Mapping[str, float]) -> None:
    """Stiffness and damping of the axle groups."""
    for group, (figures, _) in zip(unit["axle_groups"], kind.groups.values(), strict=True):
        path, count = _group_path(unit, group), len(_on_road(group))
        if loads[path] <= 0:
            raise VehicleError(
                f"{path}: expected a static load above 0, got {loads[path]:.0f} N; check the CoG of the units, and the"
                " positions of axles and couplings"
            )
        coefficient = figures.cornering_coefficient
        spread = LOAD_EXPONENT * math.log(loads[path] / (count * figures.nominal_load))
        stiffness = coefficient.value * loads[path]
        sigma = stiffness * math.hypot(coefficient.relative, spread)
        completion.fill(group, path, "cornering_stiffness", stiffness, sigma, coefficient.source)
        completion.figure(group, path, "roll_stiffness", figures.roll_stiffness, count)
        completion.figure(group, path, "tyre_roll_stiffness", figures.tyre_roll_stiffness, count)
        completion.figure(group, path, "roll_damping", DAMPING_TIME, group["roll_stiffness"])


def _axle_loads(units: list[Table], couplings: list[Table]) -> dict[str, float]:
    """Static axle loads from the fields; errors for numbers that they need."""
    bodies = []
    for unit in units:
        _require(unit, ("mass", "cog"), unit["name"], "give it, or give the unit a class")
        groups = {
            _group_path(unit, group): sum(axle["position"] for axle in _on_road(group)) / len(_on_road(group))
            for group in unit["axle_groups"]
        }
        bodies.append(SupportedBody(unit["name"], unit["mass"], unit["cog"], groups))
    if len(couplings) != len(units) - 1:
        raise VehicleError(
            f"coupling: expected {len(units) - 1} between {len(units)} units, got {len(couplings)}; give one for each"
            " pair of neighbours"
        )
    for coupling in couplings:
        _require(coupling, ("leading_position", "trailing_position"), coupling.get("name", "fifth_wheel"))
    joints = [Joint(c["leading_position"], c["trailing_position"], c.get("kind") != "turntable") for c in couplings]
    return static_axle_loads(bodies, joints)


def _on_road(group: Table) -> list[Table]:
    """The axles of a group that are not lifted; all of them where the group is refused, because none is on the road."""
    return [axle for axle in group["axles"] if axle.get("lifted") is not True] or group["axles"]


def _group_path(unit: Table, group: Table) -> str:
    return unit["name"] if len(unit["axle_groups"]) == 1 else f"{unit['name']}.{group.get('name', 'axles')}"


def _require(table: Table, keys: tuple[str, ...], path: str, cure: str = "give it") -> None:
    for key in keys:
        if key not in table:
            raise VehicleError(f"{path}.{key}: expected a value, got none; {cure}")
