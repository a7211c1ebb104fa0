"""Properties of the nonlinear truck beyond a vehicle file: tyres, wheels, vertical springs, imperfections.

The tyre model has lateral and longitudinal force by the Magic Formula with load dependence, and relaxation lengths:
PAC2002 as in H. B. Pacejka, "Tyre and Vehicle Dynamics" (2006), chapter 4, without shifts, camber and turn slip: the
shifts of the left and the right tyre cancel, and the camber of a beam axle is small. Combined slip uses the cosine
weighting functions without their shifts. Its functions take floats, arrays and CasADi symbols.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

import casadi as ca

from fifthwheel.base.errors import SignalError, VehicleError, suggestion
from fifthwheel.base.units import quantity
from fifthwheel.truck.driveline import require_shares

UNITS = {
    "wheel_radius": "m",
    "half_track": "m",
    "wheel_gyration": "m",
    "bounce_frequency": "Hz",
    "landing_leg": "m",
    "bank": "rad",
    "roughness": "m^3",
    "roll_centre": "m",
    "lash": "rad",
    "steering_lag": "s",
}
"""SI unit of the properties whose text may carry a unit; all others are numbers in SI."""
ROAD_CLASSES: Mapping[str, float] = {name: 16e-6 * 4**k for k, name in enumerate("ABCDEFGH")}
"""Roughness of the middle of each class of ISO 8608, m^3."""


@dataclass(frozen=True, kw_only=True)
class MagicFormula:
    """Coefficients of one tyre, named as in PAC2002.

    The defaults are those of a 315/80 R 22.5 from CityBus_Pac02Tire.tir of Project Chrono, copyright (c) 2016 Project
    Chrono Development Team, BSD-3-Clause; the notice is in LICENSE.chrono beside this file.
    """

    FNOMIN: float = 35000.0  # N
    R0: float = 0.548  # m, unloaded
    VERTICAL_STIFFNESS: float = 1e6  # N/m
    BREFF: float = 3.5
    DREFF: float = 0.5
    FREFF: float = -0.005
    PCY1: float = 1.5874
    PDY1: float = 0.73957
    PDY2: float = -0.075004
    PEY1: float = 0.37562
    PEY2: float = -0.069325
    PKY1: float = -10.289
    PKY2: float = 3.3343
    PTY1: float = 1.2
    PTY2: float = 2.5
    RBY1: float = 13.271
    RBY2: float = 5.2405
    RCY1: float = 1.01
    PCX1: float = 1.7204
    PDX1: float = 0.77751
    PDX2: float = -0.24431
    PEX1: float = 0.46659
    PEX2: float = 0.393
    PEX3: float = 0.076024
    PKX1: float = 14.848
    PKX2: float = -9.8161
    PKX3: float = 0.15818
    PTX1: float = 1.5
    PTX2: float = 1.4
    PTX3: float = 1.0
    RBX1: float = 11.13
    RBX2: float = -12.494
    RCX1: float = 0.97505
    QDZ1: float = 0.085549
    QDZ2: float = -0.025298
    QBZ1: float = 5.8978
    QBZ2: float = -0.1535
    QBZ3: float = -2.0052
    QCZ1: float = 1.4982

    def cornering_stiffness(self, load: Any) -> Any:
        """Slope of side force over slip angle at zero slip, N/rad, at a vertical load, N.

        K_ya of PAC2002 with the opposite sign, so positive. sin(2 atan(x)) is written as 2 x / (1 + x^2).
        """
        x = load / (self.PKY2 * self.FNOMIN)
        return -self.PKY1 * self.FNOMIN * 2 * x / (1 + x * x)

    def rolling_radius(self, load: Any) -> Any:
        """Effective rolling radius, m, at a vertical load, N."""
        x = load / self.FNOMIN
        deflection = self.FNOMIN / self.VERTICAL_STIFFNESS
        return self.R0 - deflection * (self.DREFF * ca.atan(self.BREFF * x) + self.FREFF * x)

    def relaxation_length(self, load: Any) -> Any:
        """Relaxation length of the side force (sigma_alpha), m, at a vertical load, N."""
        x = load / (self.PTY2 * self.FNOMIN)
        return self.PTY1 * self.R0 * 2 * x / (1 + x * x)

    def longitudinal_relaxation_length(self, load: Any) -> Any:
        """Relaxation length of the longitudinal force (sigma_kappa), m, at a vertical load, N."""
        df = load / self.FNOMIN - 1
        return load / self.FNOMIN * (self.PTX1 + self.PTX2 * df) * ca.exp(-self.PTX3 * df) * self.R0

    def side_force(
        self, slip: Any, load: Any, *, longitudinal: Any = 0.0, stiffness: Any = 1.0, friction: Any = 1.0
    ) -> Any:
        """Side force, N, at the tangent of the slip angle, positive for a positive one, and a vertical load above 0, N,
        with a longitudinal slip kappa and factors on cornering stiffness and friction.
        """
        df = load / self.FNOMIN - 1
        D = (self.PDY1 + self.PDY2 * df) * friction * load
        E = self.PEY1 + self.PEY2 * df
        B = stiffness * self.cornering_stiffness(load) / (self.PCY1 * D)
        x = B * slip
        pure = D * ca.sin(self.PCY1 * ca.atan(x - E * (x - ca.atan(x))))
        weight = self.RBY1 * ca.cos(ca.atan(self.RBY2 * slip)) * longitudinal
        return pure * ca.cos(self.RCY1 * ca.atan(weight))

    def longitudinal_force(self, slip: Any, load: Any, *, lateral: Any = 0.0, friction: Any = 1.0) -> Any:
        """Longitudinal force, N, at the longitudinal slip kappa, positive when driving, and a vertical load above 0, N,
        with the tangent of the slip angle and a factor on the friction.
        """
        df = load / self.FNOMIN - 1
        D = (self.PDX1 + self.PDX2 * df) * friction * load
        E = self.PEX1 + self.PEX2 * df + self.PEX3 * df * df
        K = load * (self.PKX1 + self.PKX2 * df) * ca.exp(self.PKX3 * df)
        x = K / (self.PCX1 * D) * slip
        pure = D * ca.sin(self.PCX1 * ca.atan(x - E * (x - ca.atan(x))))
        weight = self.RBX1 * ca.cos(ca.atan(self.RBX2 * slip)) * lateral
        return pure * ca.cos(self.RCX1 * ca.atan(weight))

    def pneumatic_trail(self, slip: Any, load: Any) -> Any:
        """Distance of the side force behind the middle of the contact patch, m; slip as for `side_force`."""
        df = load / self.FNOMIN - 1
        D = load / self.FNOMIN * self.R0 * (self.QDZ1 + self.QDZ2 * df)
        return D * ca.cos(self.QCZ1 * ca.atan((self.QBZ1 + self.QBZ2 * df + self.QBZ3 * df * df) * slip))


@dataclass(frozen=True, kw_only=True)
class Properties:
    """Properties of the nonlinear truck beyond those of the vehicle; every imperfection is off by default.

    Keys of the mappings are paths of axle groups: "tractor.front", "tractor.drive", "semitrailer".

    Raises:
        VehicleError: a value outside its range.
    """

    tyre: MagicFormula = field(default_factory=MagicFormula)
    """Model of every tyre; its cornering stiffness is scaled so that each axle group has the cornering stiffness of the
    vehicle file at its static load."""
    twin_tyres: tuple[str, ...] | None = None
    """Axle groups with two tyres per side; None: as `Vehicle.tyres`."""
    wheel_radius: float = 0.5
    """Radius of the loaded wheel, m."""
    half_track: float = 1.0
    """Lateral distance from the centre line of the truck to the middle of the tyres of one side, m."""
    wheel_mass: float = 0.2
    """Mass of wheel, hub and brake drum of one side, as a fraction of the mass of the axle."""
    wheel_gyration: float = 0.32
    """Radius of gyration of the wheel about its spin axis, m."""
    bounce_frequency: float = 1.6
    """Natural frequency of the body on its suspension in vertical motion, Hz."""
    bounce_damping: float = 0.25
    """Damping ratio of the same motion."""
    tyre_damping: float = 5000.0
    """Vertical damping of one tyre, N s/m."""
    rolling_resistance: float = 0.006
    """Rolling resistance coefficient: force divided by vertical load."""
    drag_area: float = 6.0
    """Drag coefficient times frontal area, m^2."""
    landing_leg: float = -2.34
    """x of the optical sideslip sensor on the last unit, m; the article's, section 4.1.3."""

    stiffness: float = 1.0
    """Factor on the cornering stiffness of every tyre."""
    relaxation: float = 1.0
    """Factor on the relaxation lengths of every tyre."""
    aligning: float = 0.0
    """Factor on the pneumatic trail of every tyre, unless the vehicle file gives that of its axle group; at 0 the side
    force acts in the middle of the contact patch."""
    friction: float = 1.0
    """Factor on the friction of every tyre: 0.6 for a wet road."""
    bank: float = 0.0
    """Bank angle of the road, rad; positive tilts the truck to the right, as a positive roll angle does."""
    roughness: float = 0.0
    """Roughness of the road: G_d(n_0) of ISO 8608, m^3, such as 64e-6 for the middle of class B, see rough_road.py."""
    brakes: Mapping[str, float] = field(default_factory=dict)
    """Share of an axle group in the braking force, in proportion to the others: {"tractor.drive": 1.0} is a retarder.
    Groups that it does not name do not brake. Empty: all groups brake in proportion to their static loads."""
    roll_centre: Mapping[str, float] = field(default_factory=dict)
    """Height of the roll centre of a suspension above the ground, m. The default follows from roll_axis_height of the
    unit: the body rolls about that axis on suspension and tyres in series."""
    roll_steer: Mapping[str, float] = field(default_factory=dict)
    """Steer angle of an axle per roll angle of its suspension, rad/rad; about 0.1 for a trailing-arm axle. The angle is
    that of the axle relative to the body, so that a body that rolls to the right steers the axle to the left."""
    lash: Mapping[str, float] = field(default_factory=dict)
    """Free play of a suspension in roll, to either side, rad."""
    steering_compliance: float = 0.0
    """Steer angle of the first steered axle per aligning moment, rad/(N m); has an effect only with a
    pneumatic trail."""
    steering_lag: float = 0.0
    """Time constant from the measured steer angle to the angle of the wheels, s."""
    frame_torsion: float | None = None
    """Torsional stiffness of the frame of the first unit, N m/rad; None: rigid."""

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if isinstance(value, str):
                raise VehicleError(f"{name}: expected a number in SI, got {value!r}; correct it")
        below_100 = ("wheel_radius", "half_track", "wheel_gyration", "bounce_frequency", "friction", "stiffness")
        from_0 = ("bounce_damping", "tyre_damping", "rolling_resistance", "drag_area", "aligning", "steering_lag")
        of_axle, torsion = "a fraction of the mass of the axle, above 0 and below 0.5", self.frame_torsion
        of_tyre = "give 1 for the relaxation lengths of the tyre model"
        ranges = {
            **{name: (0 < getattr(self, name) < 100, "above 0 and below 100", "correct it") for name in below_100},
            "wheel_mass": (0 < self.wheel_mass < 0.5, of_axle, "correct it"),
            **{name: (0 <= getattr(self, name) < 1e6, "0 or more", "correct it") for name in from_0},
            "relaxation": (1e-3 <= self.relaxation < 100, "0.001 or more and below 100", of_tyre),
            "bank": (abs(self.bank) < 0.3, "a magnitude below 0.3 rad", "give the unit if it is in degrees, '2 deg'"),
            "roughness": (0 <= self.roughness < 1, "0 or more and below 1 m^3", "class B of ISO 8608 has 64e-6"),
            "frame_torsion": (torsion is None or torsion > 0, "above 0 N m/rad", "leave it out for a rigid frame"),
        }
        for name, (valid, expected, cure) in ranges.items():
            if not valid:
                raise VehicleError(f"{name}: expected {expected}, got {getattr(self, name)}; {cure}")
        require_shares(self.brakes)


def with_changes(properties: Properties, changes: Mapping[str, Any]) -> Properties:
    """A copy with some properties changed, those of single axle groups by "property.group".

    {"bank": "2 deg", "roll_steer.semitrailer": 0.1}: a value is a number in SI, or a text with a unit where `UNITS` has
    one, or as roughness a class of ISO 8608. A VehicleError for an unknown property, or a value outside its range.
    """
    names = [f.name for f in fields(Properties) if f.name != "tyre"]
    values: dict[str, Any] = {}
    for key, value in changes.items():
        name, _, group = key.partition(".")
        if name not in names:
            raise VehicleError(f"{name}: the nonlinear truck has no such property; {suggestion(name, names)}")
        by_group = isinstance(getattr(properties, name), Mapping)
        if by_group != bool(group):
            of_group = f"{name}.<axle group>, such as {name}.semitrailer"
            expected = of_group if by_group else f"{name} without an axle group"
            raise VehicleError(f"{key}: expected {expected}; correct the name")
        if name == "twin_tyres":
            values[name] = tuple(value.split(",") if isinstance(value, str) else value)
            continue
        try:
            in_class = ROAD_CLASSES.get(value.upper()) if name == "roughness" and isinstance(value, str) else None
            number = quantity(value, UNITS.get(name, "1")) if in_class is None else in_class
        except (SignalError, TypeError, ValueError) as error:
            or_class = "; or give a class of ISO 8608, A to H" if name == "roughness" else ""
            raise VehicleError(f"{key}: {error}{or_class}") from None
        values[name] = {**values.get(name, getattr(properties, name)), group: number} if by_group else number
    return replace(properties, **values)
