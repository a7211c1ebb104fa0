"""What a plan says: the drive that is proposed, others, and what falls short."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

import fifthwheel
from fifthwheel.identify.information import Verdict
from fifthwheel.identify.manoeuvres import to_record
from fifthwheel.identify.remedies import Remedy
from fifthwheel.logs import Record
from fifthwheel.vehicle import Vehicle

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class Proposal:
    """A drive, and what it would tell."""

    kind: str  # lane_change, sweep, random or bend
    frequency: float | None  # of a lane change, Hz
    offset: float | None  # of a lane change, m sideways
    speed: float  # m/s
    repetitions: int
    duration: float  # s
    acceleration: float  # largest lateral acceleration of any unit's CoG, m/s^2
    leading: float  # the same of the first unit
    steer: Array = field(repr=False)  # of the first steered axle (N,), rad
    sigma: Mapping[str, float]  # of all that is sought, as a part of its value
    verdicts: Mapping[str, Verdict]

    def as_dict(self) -> dict[str, Any]:
        """For JSON; of the steer angle only the largest."""
        told = {name: value for name, value in self.__dict__.items() if name != "steer"}
        return told | {"max_steer": float(np.abs(self.steer).max())}


@dataclass(frozen=True, kw_only=True)
class Shortfall:
    """A want that the best drive does not meet; sigmas are parts of the parameter's value."""

    name: str
    wanted: float
    sigma: float  # that the best drive brings
    verdict: Verdict
    remedies: tuple[Remedy, ...]  # what would bring it down


@dataclass(frozen=True, kw_only=True, eq=False)
class Plan:
    """What to drive."""

    vehicle: Vehicle
    wants: Mapping[str, float]  # sigma as a part of the value
    channels: tuple[str, ...]
    rate: float  # Hz
    best: Proposal
    alternatives: tuple[Proposal, ...]
    unmet: tuple[Shortfall, ...]  # empty where the best drive meets all wants
    notes: tuple[str, ...]

    @property
    def met(self) -> bool:
        """Whether the best drive tells all that is wanted."""
        return not self.unmet

    def record(self) -> Record:
        """Time, speed and steer angle of the best drive."""
        return to_record(self.vehicle, self.best.speed, self.best.steer, self.rate, self.best.kind)

    def to_json(self, **more: Any) -> str:
        """All but the course of the steer angle, as JSON."""
        told = {
            "version": fifthwheel.__version__,
            "vehicle": self.vehicle.name,
            "wants": dict(self.wants),
            "channels": self.channels,
            "met": self.met,
            "best": self.best.as_dict(),
            "alternatives": [one.as_dict() for one in self.alternatives],
            "unmet": [asdict(shortfall) for shortfall in self.unmet],
            "notes": self.notes,
        }
        return json.dumps(told | more, indent=2)
