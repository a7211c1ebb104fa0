"""One unit of a vehicle: its mass, its sprung body, its payload and the axle groups it stands on.

Axes are ISO 8855, x forward. Positions are measured on each unit from an origin of the user's choice (the front axle of
a tractor, the kingpin of a semitrailer), heights from the ground. SI throughout.
"""

from collections import Counter
from typing import Any, Literal, Self

from pydantic import Field, model_validator

from fifthwheel.errors import VehicleError
from fifthwheel.vehicle.part import Name, NotNegative, Number, Part, Positive


class Axle(Part):
    """One axle."""

    name: Name = Field(description="Unique in the unit; a single axle may take the name of its group.")
    position: Number = Field(description="x of the axle on its unit, m.")
    steerable: bool = Field(default=False, description="Whether steer.<unit>.<axle> is an input of the vehicle.")


class AxleGroup(Part):
    """Axles that share one cornering stiffness and one suspension: a front axle, a tandem drive, a trailer's bogie.

    The cornering stiffness is the total of the group, positive, and falls in equal parts on its axles: C_alpha / n as
    in equation (7) of Cheng and Cebon (2011), whose sign is the opposite one.
    """

    name: Name = Field(
        default="axles", description="Unique in the unit; paths leave it out where it is the only group."
    )
    axles: tuple[Axle, ...] = Field(min_length=1, description="From front to rear.")
    cornering_stiffness: Positive = Field(
        ge=1e3, le=1e8, description="Side force per slip angle of all axles together, N/rad."
    )
    roll_stiffness: Positive = Field(description="Suspension, total of the group, N m/rad.")
    tyre_roll_stiffness: Positive = Field(description="Tyres, total of the group, N m/rad.")
    roll_damping: NotNegative = Field(description="Suspension, total of the group, N m s/rad.")
    relaxation_length: NotNegative = Field(
        default=0.0, le=5.0, description="Way on which a side force builds up, m; 0: at once, as in the article."
    )

    @classmethod
    def _prefix(cls, data: dict[str, Any]) -> str:
        return "" if data.get("name", "axles") == "axles" else super()._prefix(data)  # as in the paths

    @model_validator(mode="before")
    @classmethod
    def _name_single_axle(cls, data: Any) -> Any:
        match data:
            case {"axles": [dict() as axle]} if "name" not in axle:
                return {**data, "axles": [{"name": data.get("name", "axles"), **axle}]}
        return data

    @property
    def position(self) -> float:
        """Mean x of the axles, m: where the group's static load acts."""
        return sum(axle.position for axle in self.axles) / len(self.axles)

    @property
    def total_roll_stiffness(self) -> float:
        """K*, N m/rad: suspension and tyres in series, 1/K* = 1/K + 1/K_t (appendix of Cheng and Cebon, 2011)."""
        return 1 / (1 / self.roll_stiffness + 1 / self.tyre_roll_stiffness)

    @property
    def lagging(self) -> bool:
        """Whether the side force follows the slip angle late."""
        return self.relaxation_length > 0


class SprungMass(Part):
    """The body on the suspension; where the unit has a payload, the body without it."""

    mass: Positive = Field(description="kg.")
    cog_height: Positive = Field(description="CoG above the ground, m.")
    roll_inertia: Positive = Field(description="About the longitudinal axis through its own CoG, kg m^2.")
    roll_yaw_product: Number = Field(
        default=0.0,
        description="The article's I_sxz, kg m^2, as loaded: integral of x z dm over the sprung body, x from the"
        " vertical through the CoG of the whole unit, z from the roll axis.",
    )


class Payload(Part):
    """A load on the floor: a uniform block, or a point at half its height on the centre line (the article's 3.3)."""

    mass: Positive = Field(description="kg.")
    height: Positive = Field(description="From the floor to the top of the load, h_p, m.")
    width: Positive = Field(description="Of the load, D_p, m; a point payload does not use it.")
    floor_height: Positive = Field(description="Of the floor above the ground, h_f, m.")
    shape: Literal["uniform", "point"] = Field(default="uniform", description="How the mass is spread.")


class Unit(Part):
    """A tractor, a truck, a dolly or a trailer. Mass, CoG and yaw inertia are those of the whole unit, as loaded."""

    name: Name
    mass: Positive = Field(le=5e5, description="Sprung, unsprung and payload, kg.")
    cog: Number = Field(description="x of the CoG of the whole mass, m.")
    yaw_inertia: Positive = Field(description="Of the whole unit about its CoG, kg m^2.")
    roll_axis_height: NotNegative = Field(description="Of the roll axis above the ground, h_r, m.")
    sprung: SprungMass
    payload: Payload | None = None
    axle_groups: tuple[AxleGroup, ...] = Field(min_length=1, description="From front to rear.")

    @model_validator(mode="after")
    def _check(self) -> Self:
        reject_doubles("axle_groups", [group.name for group in self.axle_groups])
        reject_doubles("axles", [axle.name for axle in self.axles])
        for name in [group.name for group in self.axle_groups] + [axle.name for axle in self.axles]:
            if name in ("sprung", "payload"):
                raise VehicleError(f"{name}: expected another name for an axle or its group; it is taken by the body")
        if self.laden_sprung_mass >= self.mass:
            what = "sprung.mass" if self.payload is None else "sprung.mass + payload.mass"
            raise VehicleError(
                f"{what}: expected less than the mass of the whole unit, {self.mass:g} kg, got"
                f" {self.laden_sprung_mass:g} kg; the axles weigh something too, and sprung.mass is without the payload"
            )
        return self

    @property
    def axles(self) -> tuple[Axle, ...]:
        """All axles, from the first group to the last."""
        return tuple(axle for group in self.axle_groups for axle in group.axles)

    @property
    def laden_sprung_mass(self) -> float:
        """Sprung body and payload, kg."""
        return self.sprung.mass + (self.payload.mass if self.payload else 0.0)

    def group_path(self, group: AxleGroup) -> str:
        """How the paths of a group's parameters begin: 'tractor.drive', 'semitrailer' where it is the only group."""
        return self.name if len(self.axle_groups) == 1 else f"{self.name}.{group.name}"


def reject_doubles(what: str, names: list[str]) -> None:
    """Raise where a name comes twice."""
    doubles = [name for name, count in Counter(names).items() if count > 1]
    if doubles:
        raise VehicleError(f"{what}: expected different names, got {', '.join(doubles)} more than once; rename one")
