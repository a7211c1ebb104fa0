"""The components of a vehicle: units with mass, sprung body, payload and axle groups, and the couplings between them.

Axes follow ISO 8855, x forward. Positions on a unit are measured from an origin of the user's choice, such as the front
axle of a tractor and the kingpin of a semitrailer. Heights are above the ground. All values are SI.
"""

from collections import Counter
from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from fifthwheel.base.errors import VehicleError
from fifthwheel.truck.component import Component, HashableDict, Name, NonNegative, Number, Positive, number
from fifthwheel.truck.quantities import WIDE, Quantity

CouplingKind = Literal["fifth_wheel", "drawbar_eye", "turntable"]
MAX_AXLE_GROUPS = 8
"""Axle groups of a unit: the time to compile the model grows with their number."""
MAX_AXLES = 16
"""Axles of a group."""
ON_UNIT = (-25.0, 25.0)
"""Plausible positions on a unit, m: the origin is on it."""
MASS = (200.0, 3e5)
"""Plausible masses of a unit, kg."""
ACCELEROMETERS = ("accelerometer", "accelerometers")
"""Tables of the places of accelerometers in a unit."""


class Axle(Component):
    """One axle."""

    name: Name = Field(description="Unique in the unit; a single axle may take the name of its group.")
    position: Number = number(
        "m", "x of the axle on its unit.", Quantity(absolute=True, guess=WIDE, gross=0.6), plausible=ON_UNIT
    )
    steerable: bool = Field(default=False, description="Whether steer.<unit>.<axle> is an input of the vehicle.")
    lifted: bool = Field(
        default=False, description="A raised lift axle: no tyre on the road; its mass stays on its unit."
    )
    self_steering: NonNegative | None = number(
        "1",
        "Castor wheels turn by this fraction of the slip angle of the axle: 0 a fixed axle, 1 an axle without side"
        " force.",
        # gross: a castor axle
        Quantity(
            0.015, absolute=True, gross=0.4, part="axle", source="the last axle of a group that the file has as fixed"
        ),
        default=None,
        le=1,
    )
    command_steering: Number | None = number(
        "1",
        "The wheels turn by this fraction of the articulation angle in front of the unit; above 0 they turn to the"
        " right in a left turn.",
        Quantity(0.02, absolute=True, by_change=True, part="axle", source="play and elasticity of the linkage"),
        default=None,
        ge=-1,
        le=1,
    )

    @model_validator(mode="after")
    def _check(self) -> Self:
        keys = [key for key in ("steerable", "self_steering", "command_steering") if getattr(self, key)]
        if len(keys) > 1:
            raise VehicleError(f"{keys[0]}: expected one kind of steering, got {' and '.join(keys)}; keep one")
        if self.lifted and self.steerable:
            raise VehicleError("lifted: expected false for a steerable axle; remove lifted, or steerable")
        return self


class AxleGroup(Component):
    """Axles that share one cornering stiffness and one suspension: a front axle, a drive tandem, a trailer's bogie.

    Stiffnesses, damping and tyres are the total of its axles on the road, without those that are lifted. The cornering
    stiffness is positive, and the axles share it equally: C_alpha / n as in equation (7) of Cheng and Cebon (2011),
    where it is negative.
    """

    name: Name = Field(default="axles", description="Unique in the unit; not in the paths if it is the only group.")
    axles: tuple[Axle, ...] = Field(min_length=1, max_length=MAX_AXLES, description="From front to rear.")
    cornering_stiffness: Positive = number(
        "N/rad", "Side force per slip angle of all axles together.", Quantity(part="tyres"), ge=1e3, le=1e8
    )
    # gross: of one axle in place of the group
    roll_stiffness: Positive = number(
        "N m/rad",
        "Suspension, total of the group.",
        Quantity(0.1, gross=0.5, of_roll=True, part="suspension", source="the spread of published trucks"),
        plausible=(1e4, 1e8),
    )
    tyre_roll_stiffness: Positive = number(
        "N m/rad",
        "Tyres, total of the group.",
        Quantity(0.1, gross=0.5, weight=0.5, of_roll=True, words="roll stiffness", part="tyres"),
        plausible=(1e4, 1e8),
    )
    roll_damping: NonNegative = number(
        "N m s/rad",
        "Suspension, total of the group.",
        Quantity(0.3, gross=0.8, weight=0.5, of_roll=True, part="suspension"),
        plausible=(0.0, 1e7),
    )
    relaxation_length: NonNegative = number(
        "m",
        "Distance over which the side force of the tyres builds up; 0: it acts at once, as in the article. A file "
        "without it has that of usual truck tyres.",
        Quantity(0.2, gross=0.4, weight=0.3, part="tyres"),
        default=0.0,
        le=5.0,
    )
    pneumatic_trail: NonNegative | None = number(
        "m",
        "Distance of the side force behind the middle of the contact at small slip; by default it acts in the middle.",
        Quantity(0.2, part="tyres"),
        default=None,
        le=0.5,
    )
    tyres: int | None = Field(
        default=None,
        ge=2,
        le=8 * MAX_AXLES,
        description="Of the group, for tyres that saturate; default: see `Vehicle.tyres`.",
    )
    driven: bool = Field(
        default=False, description="Whether the engine drives it; default: see `Vehicle.driven_groups`."
    )

    @classmethod
    def _prefix(cls, data: dict[str, Any]) -> str:
        return "" if data.get("name", "axles") == "axles" else super()._prefix(data)  # same as the paths

    @model_validator(mode="before")
    @classmethod
    def _name_single_axle(cls, data: Any) -> Any:
        match data:
            case {"axles": [dict() as axle]} if "name" not in axle:
                return {**data, "axles": [{"name": data.get("name", "axles"), **axle}]}
        return data

    @model_validator(mode="after")
    def _check(self) -> Self:
        if not self.on_road:
            raise VehicleError(
                "axles: expected one on the road, got only lifted ones; leave the group out, or correct lifted"
            )
        return self

    @property
    def on_road(self) -> tuple[Axle, ...]:
        """The axles that are not lifted, from front to rear."""
        return tuple(axle for axle in self.axles if not axle.lifted)

    @property
    def position(self) -> float:
        """Mean x of the axles on the road, m, where the group's static load acts."""
        return sum(axle.position for axle in self.on_road) / len(self.on_road)

    @property
    def total_roll_stiffness(self) -> float:
        """K*, N m/rad: suspension and tyres in series, 1/K* = 1/K + 1/K_t (Cheng and Cebon 2011, appendix)."""
        return 1 / (1 / self.roll_stiffness + 1 / self.tyre_roll_stiffness)

    @property
    def has_relaxation(self) -> bool:
        """Whether the side force lags the slip angle."""
        return self.relaxation_length > 0


class SprungMass(Component):
    """The body on the suspension, without the payload."""

    owner = "sprung"
    mass: Positive = number("kg", "Without axles, wheels and payload.", Quantity(gross=0.3, weight=3.0), plausible=MASS)
    cog_height: Positive = number(
        "m", "CoG above the ground.", Quantity(0.1, gross=0.3, of_roll=True, words="CoG height"), plausible=(0.2, 5.0)
    )
    roll_inertia: Positive = number(
        "kg m^2",
        "About the longitudinal axis through its own CoG.",
        Quantity(
            0.2,
            guess=0.6,
            gross=0.4,
            weight=0.5,
            of_roll=True,
            source="a payload of the same height may be a point, or stand along the sides",
        ),
        plausible=(20.0, 1e6),
    )
    roll_yaw_product: Number = number(
        "kg m^2",
        "I_sxz of the article, laden: integral of x z dm over the sprung body, with x from the CoG of the unit and z"
        " from the roll axis.",
        Quantity(words="roll-yaw product of inertia"),
        default=0.0,
    )


class Payload(Component):
    """A load on the floor: a uniform block, or a point mass at half its height on the centre line.

    Cheng and Cebon (2011), section 3.3.
    """

    owner = "payload"
    mass: Positive = number(
        "kg",
        "Of the load.",
        Quantity(
            0.03,
            gross=0.3,
            weight=2.0,
            by_change=True,
            scope="load",
            source="difference of two weighings, or freight documents without pallets",
        ),
        plausible=(0.0, MASS[1]),
    )
    height: Positive = number(
        "m",
        "Of the load, from the floor to its top, h_p.",
        Quantity(
            0.75,
            absolute=True,
            mean=1.4,
            bounds=(0.01, 3.5),
            scope="load",
            of_roll=True,
            source="any height up to 2.7 m, the inside of a usual body",
        ),
        plausible=(0.0, 6.0),
    )
    width: Positive = number(
        "m", "Of the load, D_p; not used by a point payload.", Quantity(scope="load"), plausible=(0.0, 6.0)
    )
    floor_height: Positive = number(
        "m", "Of the floor above the ground, h_f.", Quantity(scope="load"), plausible=(0.1, 3.0)
    )
    shape: Literal["uniform", "point"] = Field(default="uniform", description="Distribution of the mass.")


class Accelerometer(Component):
    """Where a lateral accelerometer is fixed to the sprung body of a unit."""

    owner = "accelerometer"
    position: Number = number("m", "x on the unit.", plausible=ON_UNIT)
    height: NonNegative = number("m", "Above the ground.", plausible=(0.0, 5.0))


class Unit(Component):
    """A tractor, a truck, a dolly or a trailer. Mass, CoG and yaw inertia are those of the laden unit."""

    name: Name
    vehicle_class: str | None = Field(
        default=None, description="One of `classes.CLASSES`: gives the numbers that a file does not have."
    )
    mass: Positive = number(
        "kg",
        "Sprung, unsprung and payload.",
        Quantity(
            0.02,
            gross=0.3,
            weight=3.0,
            by_change=True,
            scope="load",
            source="axle-by-axle weighing of coupled units; 150 kg of fuel are 2 % of a tractor",
        ),
        le=5e5,
        plausible=MASS,
    )
    cog: Number = number(
        "m",
        "x of the CoG of the unit.",
        Quantity(
            0.15,
            absolute=True,
            guess=WIDE,
            gross=0.7,
            by_change=True,
            scope="load",
            words="CoG position",
            source="a load of 60 % of the unit's mass that lies 0.25 m from its assumed position",
        ),
        plausible=ON_UNIT,
    )
    yaw_inertia: Positive = number(
        "kg m^2", "Of the unit about its CoG.", Quantity(0.1, gross=0.4, scope="load"), plausible=(100.0, 1e7)
    )
    roll_axis_height: NonNegative = number(
        "m",
        "Of the roll axis above the ground, h_r.",
        Quantity(0.1, gross=0.4, weight=0.5, of_roll=True),
        plausible=(0.0, 3.0),
    )
    sprung: SprungMass
    payload: Payload | None = None
    accelerometer: Accelerometer | None = Field(
        default=None, description="Place of lateral_acceleration.<unit>; under the CoG on the roll axis by default."
    )
    accelerometers: Annotated[Mapping[Name, Accelerometer], AfterValidator(HashableDict)] = Field(
        default={}, description="Places of lateral_acceleration.<unit>.<name> by name; by default `accelerometer`."
    )
    axle_groups: tuple[AxleGroup, ...] = Field(
        min_length=1, max_length=MAX_AXLE_GROUPS, description="From front to rear."
    )

    @model_validator(mode="after")
    def _check(self) -> Self:
        require_unique("axle_groups", [group.name for group in self.axle_groups])
        require_unique("axles", [axle.name for axle in self.axles])
        for name in [group.name for group in self.axle_groups] + [axle.name for axle in self.axles]:
            if name in ("sprung", "payload", *ACCELEROMETERS):
                raise VehicleError(
                    f"{name}: expected another name for an axle or axle group; this name is reserved for a table"
                )
        if all(axle.self_steering == 1 for axle in self.on_road):
            raise VehicleError(
                f"{self.on_road[-1].name}.self_steering: expected an axle with side force, got 1 on all axles; give a"
                " fraction below 1"
            )
        if self.laden_sprung_mass >= self.mass:
            keys = "sprung.mass" if self.payload is None else "sprung.mass + payload.mass"
            raise VehicleError(
                f"{keys}: expected less than the mass of the unit, {self.mass:g} kg, got {self.laden_sprung_mass:g} kg;"
                " the mass of the unit includes its axles, and sprung.mass does not include the payload"
            )
        return self

    @property
    def axles(self) -> tuple[Axle, ...]:
        """All axles, from the first group to the last."""
        return tuple(axle for group in self.axle_groups for axle in group.axles)

    @property
    def on_road(self) -> tuple[Axle, ...]:
        """All axles that are not lifted, from the first group to the last."""
        return tuple(axle for group in self.axle_groups for axle in group.on_road)

    @property
    def laden_sprung_mass(self) -> float:
        """Mass of sprung body and payload, kg."""
        return self.sprung.mass + (self.payload.mass if self.payload else 0.0)

    def place_of_accelerometer(self, name: str = "") -> Accelerometer:
        """The place of lateral_acceleration.<unit>.<name>: its own, else that of lateral_acceleration.<unit>, which by
        default is under the CoG on the roll axis."""
        default = self.accelerometer or Accelerometer(position=self.cog, height=self.roll_axis_height)
        return self.accelerometers.get(name, default)

    def accelerometer_path(self, name: str) -> str:
        """Beginning of the paths of that place: 'trailer.accelerometers.rear', or 'trailer.accelerometer'."""
        return f"{self.name}.accelerometers.{name}" if name in self.accelerometers else f"{self.name}.accelerometer"

    def group_path(self, group: AxleGroup) -> str:
        """Beginning of the paths of a group's parameters: 'tractor.drive', or 'semitrailer' if it is the only group."""
        return self.name if len(self.axle_groups) == 1 else f"{self.name}.{group.name}"


class Coupling(Component):
    """The joint between a unit and the unit behind it; it transmits side force. Every kind is free in yaw unless it has
    a yaw stiffness or damping, as the joint of an articulated bus and the stabiliser of a caravan have.

    A fifth wheel is free in pitch and carries roll moment: its plate pivots about a lateral axis. A drawbar eye is free
    in pitch and roll. A turntable joins the dolly of a full trailer and its body: its ball race turns in yaw only, so
    the two are one body in pitch. The drawbar in front of such a dolly is hinged; its eye carries no vertical load.

    Source: R. D. Ervin and Y. Guy, The influence of weights and dimensions on the stability and control of heavy-duty
    trucks in Canada, UMTRI-86-35 (1986): roll-coupled and roll-decoupled units.
    """

    owner = "coupling"
    name: Name = "fifth_wheel"
    kind: CouplingKind = Field(default="fifth_wheel", description="Which rotations are free.")
    leading_position: Number = number(
        "m",
        "x on the unit in front, from that unit's origin.",
        Quantity(absolute=True, guess=WIDE, gross=0.4, weight=1.5),
        plausible=ON_UNIT,
    )
    trailing_position: Number = number(
        "m",
        "x on the unit behind, from that unit's origin.",
        Quantity(absolute=True, guess=WIDE, gross=0.4),
        plausible=ON_UNIT,
    )
    height: NonNegative = number("m", "Above the ground.", Quantity(of_roll=True), plausible=(0.1, 3.0))
    roll_stiffness: NonNegative = number(
        "N m/rad",
        "Between the two sprung bodies; 0 for a drawbar eye.",
        Quantity(0.3, gross=0.5, of_roll=True),
        plausible=(0.0, 1e8),
    )
    roll_damping: NonNegative = number(
        "N m s/rad",
        "Between the two sprung bodies.",
        Quantity(0.3, gross=0.8, weight=0.5, of_roll=True),
        default=0.0,
        plausible=(0.0, 1e7),
    )
    yaw_stiffness: NonNegative | None = number(
        "N m/rad",
        "Yaw moment per articulation angle; none by default.",
        Quantity(absolute=True, gross=5e4, weight=0.3),
        default=None,
        plausible=(0.0, 1e7),
    )
    yaw_damping: NonNegative | None = number(
        "N m s/rad",
        "Yaw moment per rate of the articulation angle, as of the damper in the joint of an articulated bus; none by"
        " default.",
        # gross: such a damper
        Quantity(2e3, absolute=True, gross=5e4, weight=3.0, source="friction of a joint that the file has as free"),
        default=None,
        plausible=(0.0, 1e6),
    )

    @model_validator(mode="before")
    @classmethod
    def _free_in_roll(cls, data: Any) -> Any:
        match data:
            case {"kind": "drawbar_eye"}:
                return {"roll_stiffness": 0.0, **data}
        return data

    @model_validator(mode="after")
    def _check(self) -> Self:
        for key in ("roll_stiffness", "roll_damping"):
            if self.kind == "drawbar_eye" and getattr(self, key):
                raise VehicleError(
                    f"{key}: expected 0 for a drawbar eye, which is free in roll, got {getattr(self, key):g}; remove"
                    f" it, or give another kind"
                )
        return self

    @property
    def pitches(self) -> bool:
        """Whether it is free in pitch."""
        return self.kind != "turntable"


def require_unique(key: str, names: list[str]) -> None:
    """Raise a VehicleError where a name occurs more than once."""
    repeated = [name for name, count in Counter(names).items() if count > 1]
    if repeated:
        raise VehicleError(f"{key}: expected different names, got {', '.join(repeated)} more than once; rename one")
