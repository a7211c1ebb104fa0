"""What only the nonlinear truck has: wheels, vertical springs, tyre law, and the flaws of real trucks."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

from fifthwheel.errors import SignalError, VehicleError
from fifthwheel.logs.units import quantity
from fifthwheel.plant.tyre import MagicFormula
from fifthwheel.vehicle.part import suggestion

UNITS = {
    "wheel_radius": "m",
    "half_track": "m",
    "wheel_gyration": "m",
    "bounce_frequency": "Hz",
    "landing_leg": "m",
    "bank": "rad",
    "roll_centre": "m",
    "lash": "rad",
    "steering_lag": "s",
}
"""SI unit of the properties that a text may give in another one; all others are bare numbers in SI."""


@dataclass(frozen=True, kw_only=True)
class Properties:
    """Properties of the plant beyond the vehicle's; every flaw is off by default.

    Keys of the mappings are paths of axle groups: "tractor.front", "tractor.drive", "semitrailer".
    """

    tyre: MagicFormula = field(default_factory=MagicFormula)
    """The law of every tyre; its cornering stiffness is scaled so that each axle group, at its static load, has that of
    the vehicle file."""
    twin_tyres: tuple[str, ...] | None = None
    """Axle groups with two tyres a side; None: those of the first unit without a steered axle."""
    wheel_radius: float = 0.5
    """Of the loaded wheel, m."""
    half_track: float = 1.0
    """From the middle of the truck to the middle of the tyres of one side, m."""
    wheel_mass: float = 0.2
    """Wheel, hub and brake drum of one side, as a part of the axle's whole mass."""
    wheel_gyration: float = 0.32
    """Radius of gyration of the wheel about its spin axis, m."""
    bounce_frequency: float = 1.6
    """Of the body on its suspension, vertically, Hz."""
    bounce_damping: float = 0.25
    """Of the same motion, as a part of critical damping."""
    tyre_damping: float = 5000.0
    """Vertical, of one tyre, N s/m."""
    rolling_resistance: float = 0.006
    """Force by vertical load."""
    drag_area: float = 6.0
    """Drag coefficient times frontal area, m^2."""
    landing_leg: float = -2.34
    """Where the optical sideslip sensor of the last unit sits, x on that unit, m; the article's, 4.1.3."""

    stiffness: float = 1.0
    """Factor on every tyre's cornering stiffness."""
    relaxation: float = 1.0
    """Factor on every tyre's relaxation length."""
    aligning: float = 0.0
    """Factor on every tyre's pneumatic trail; without it the side force acts in the middle of the contact."""
    friction: float = 1.0
    """Factor on every tyre's friction: 0.6 for a wet road."""
    bank: float = 0.0
    """Of the road, rad; positive tilts the truck as a positive roll angle does, to the right."""
    roll_centre: Mapping[str, float] = field(default_factory=dict)
    """Height of a suspension's roll centre above the ground, m. Where it is not given it follows from the unit's
    roll_axis_height: the body turns about that axis when suspension and tyres give way together."""
    roll_steer: Mapping[str, float] = field(default_factory=dict)
    """Steer angle of an axle by the roll angle of its suspension, rad/rad; a trailing-arm axle has 0.1 or so."""
    lash: Mapping[str, float] = field(default_factory=dict)
    """Free play of a suspension in roll to either side, rad."""
    steering_compliance: float = 0.0
    """Of the first steered axle, rad/(N m) of aligning moment; wants `aligning`."""
    steering_lag: float = 0.0
    """Time constant from the measured steer angle to the wheels, s."""
    frame_torsion: float | None = None
    """Torsional stiffness of the first unit's frame, N m/rad; None is rigid."""

    def __post_init__(self) -> None:
        for name in ("wheel_radius", "half_track", "wheel_gyration", "bounce_frequency", "friction", "stiffness"):
            if not 0 < getattr(self, name) < 100:
                raise VehicleError(f"{name}: expected above 0, got {getattr(self, name)}; correct it")
        if not 0 < self.wheel_mass < 0.5:
            raise VehicleError(f"wheel_mass: expected between 0 and 0.5 of the axle's mass, got {self.wheel_mass}")
        for name in ("bounce_damping", "tyre_damping", "rolling_resistance", "drag_area", "aligning", "steering_lag"):
            if not 0 <= getattr(self, name) < 1e6:
                raise VehicleError(f"{name}: expected 0 or more, got {getattr(self, name)}; correct it")
        if not 1e-3 <= self.relaxation < 100:
            raise VehicleError(f"relaxation: expected 0.001 or more, got {self.relaxation}; 1 is the tyre's own")
        if not abs(self.bank) < 0.3:
            raise VehicleError(f"bank: expected less than 0.3 rad, got {self.bank}; is it in degrees?")
        if self.frame_torsion is not None and not self.frame_torsion > 0:
            raise VehicleError(
                f"frame_torsion: expected above 0 N m/rad, got {self.frame_torsion}; leave it out if rigid"
            )


def changed(properties: Properties, changes: Mapping[str, Any]) -> Properties:
    """The same with some of them changed, by name: {"bank": "2 deg", "roll_steer.semitrailer": 0.1}.

    Values are numbers in SI, or texts with a unit where `UNITS` has one; those of single axle groups are named
    property.group.

    Raises:
        VehicleError: no such property, or a value that it cannot have.
    """
    names = [f.name for f in fields(Properties) if f.name != "tyre"]
    new: dict[str, Any] = {}
    for key, value in changes.items():
        name, _, group = key.partition(".")
        if name not in names:
            raise VehicleError(f"{name}: the plant has no such property; {suggestion(name, names)}")
        of_groups = isinstance(getattr(properties, name), Mapping)
        if of_groups != bool(group):
            how = f"{name}.<axle group>, such as {name}.semitrailer" if of_groups else f"{name} without a group"
            raise VehicleError(f"{key}: expected {how}")
        if name == "twin_tyres":
            new[name] = tuple(value.split(",") if isinstance(value, str) else value)
            continue
        try:
            number = quantity(value, UNITS.get(name, "1"))
        except (SignalError, TypeError, ValueError) as error:
            raise VehicleError(f"{key}: {error}") from None
        new[name] = {**new.get(name, getattr(properties, name)), group: number} if of_groups else number
    return replace(properties, **new)
