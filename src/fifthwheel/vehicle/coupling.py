"""The joint between two units."""

from typing import Any, Literal, Self

from pydantic import Field, model_validator

from fifthwheel.errors import VehicleError
from fifthwheel.vehicle.component import Component, Name, NonNegative, Number, number

CouplingKind = Literal["fifth_wheel", "drawbar_eye", "turntable"]


class Coupling(Component):
    """The joint between a unit and the unit behind it; it transmits side force, and every kind is free in yaw.

    A fifth wheel is free in pitch and carries roll moment: its plate pivots about a lateral axis. A drawbar eye is free
    in pitch and roll. A turntable joins the dolly of a full trailer and its body: its ball race is free in yaw only, so
    the two are one body in pitch. The drawbar in front of such a dolly is hinged; its eye carries no vertical load.

    Source: R. D. Ervin and Y. Guy, The influence of weights and dimensions on the stability and control of heavy-duty
    trucks in Canada, UMTRI-86-35 (1986): roll-coupled and roll-decoupled units.
    """

    name: Name = "fifth_wheel"
    kind: CouplingKind = Field(default="fifth_wheel", description="Which rotations are free.")
    leading_position: Number = number("m", "x on the unit in front, from that unit's origin.")
    trailing_position: Number = number("m", "x on the unit behind, from that unit's origin.")
    height: NonNegative = number("m", "Above the ground.")
    roll_stiffness: NonNegative = number("N m/rad", "Between the two sprung bodies; 0 for a drawbar eye.")
    roll_damping: NonNegative = number("N m s/rad", "Between the two sprung bodies.", default=0.0)

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
