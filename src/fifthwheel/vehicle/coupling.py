"""The joint between two units."""

from pydantic import Field

from fifthwheel.vehicle.component import Component, Name, NonNegative, Number


class Coupling(Component):
    """A fifth wheel or a drawbar eye between a unit and the unit behind it; it transmits side force and roll moment."""

    name: Name = "fifth_wheel"
    leading_position: Number = Field(description="x on the unit in front, from that unit's origin, m.")
    trailing_position: Number = Field(description="x on the unit behind, from that unit's origin, m.")
    height: NonNegative = Field(description="Above the ground, m.")
    roll_stiffness: NonNegative = Field(description="Between the two sprung bodies, N m/rad; 0 for a drawbar eye.")
    roll_damping: NonNegative = Field(default=0.0, description="Between the two sprung bodies, N m s/rad.")
