"""The one-stage identification on the road: every sample as it comes, in bounded time and memory.

It learns while the driver steers (`excitation`), goes over every sample a second time (`filters.twice`), and gives the
states with sigmas that count what it does not know of the truck.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fifthwheel.errors import SignalError, VehicleError
from fifthwheel.filters.twice import Looks
from fifthwheel.identify import memory
from fifthwheel.identify.excitation import LearnerSettings
from fifthwheel.identify.information import Verdict
from fifthwheel.identify.live import Live
from fifthwheel.identify.parameters import Unknown
from fifthwheel.identify.settings import OneStage
from fifthwheel.logs import Record
from fifthwheel.observe import Status
from fifthwheel.vehicle import Vehicle


@dataclass(frozen=True, kw_only=True)
class Learned:
    """What is known of one unknown: mean and standard deviation in SI, the prior's where it was not excited."""

    name: str
    value: float
    sigma: float
    verdict: Verdict


class Learner:
    """Parameters and states of one truck, sample by sample.

    Args:
        vehicle: what is known of the truck before.
        signals: names of what is measured; speed, a steer angle and a yaw rate must be among them.
        settings: what is sought, considered and held, priors, noise and limits, as for the identification from logs; of
            no meaning here is what says how to search. A delay of the steer angle is taken out by its slope.
        learner: when it learns, and how long it bears faults.
        trailer: under which name what is behind the first unit is remembered; the vehicle's by default.

    Raises:
        SignalError: a signal is missing without which there is nothing to learn.
        VehicleError: a parameter that cannot be sought or held.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        signals: Iterable[str],
        settings: OneStage | None = None,
        *,
        learner: LearnerSettings | None = None,
        trailer: str | None = None,
    ) -> None:
        self._live = Live(vehicle, signals, settings or OneStage(), learner or LearnerSettings())
        self._coupled = vehicle.name if trailer is None else trailer
        self._memory: dict[str, memory.Block] = {}  # of trailers that are not coupled
        self._time = math.nan
        self._answer = [(name, f"{name}.sigma") for name in self._live.reported]

    def push(self, sample: Mapping[str, float | None]) -> dict[str, float]:
        """One sample: "time" and signals in SI; a signal that is missing, None or NaN was not measured.

        Returns:
            Sideslip, yaw rate, articulation, roll and roll rate of the units and "<state>.sigma", which counts what is
            not known of the parameters; NaN where they may not be believed. Besides "status" (`observe.Status`) and
            "learning", 1 while it learns, else 0.

        Raises:
            SignalError: time is missing, not finite, or does not go forward. The learner is as it was.
        """
        live, get = self._live, sample.get
        time = get("time", math.nan)
        if time is None or not math.isfinite(time):
            raise SignalError(f"time: expected seconds, got {time}; every sample needs its time")
        if time <= self._time:
            raise SignalError(f"time: {time:g} s comes after {self._time:g} s; samples must go forward in time")
        self._time = time
        status = live.take(time, [get(name) for name in live.inputs], [get(name) for name in live.outputs])
        answer: dict[str, float] = {"time": time, "status": status, "learning": float(live.learning)}
        if status in (Status.OK, Status.COASTING):
            shown = live.states()
            variances = shown[len(self._answer) :]
            for (name, sigma), value, variance in zip(self._answer, shown, variances, strict=False):
                answer[name] = value
                answer[sigma] = math.sqrt(max(variance, 0.0))
        else:
            for name, sigma in self._answer:
                answer[name] = answer[sigma] = math.nan
        return answer

    def learn(self, record: Record) -> None:
        """A whole record: the same to the last bit as its samples pushed one after another.

        Raises:
            SignalError: it has not the signals that the learner was made for, or begins before the last sample. The
                learner is as it was.
        """
        live = self._live
        names = (*live.inputs, *live.outputs)
        for name in names:
            if name not in record.signals:
                raise SignalError(f"{name}: not in {record.name}; make a learner of the signals that it has")
        if record.time[0] <= self._time:
            raise SignalError(
                f"time: {record.name} begins at {record.time[0]:g} s, which comes after {self._time:g} s; "
                "samples must go forward in time"
            )
        rows = np.column_stack([record.signals[name] for name in names]).tolist()
        k = len(live.inputs)
        for time, row in zip(record.time.tolist(), rows, strict=True):
            self._time = time
            live.take(time, row[:k], row[k:])

    @property
    def parameters(self) -> tuple[Learned, ...]:
        """What is sought, and what was known roughly; not what is only considered."""
        blind = self._live.blind
        return tuple(one for u, one in self._all() if not (u.nuisance or (u.considered and u.name not in blind)))

    @property
    def sensors(self) -> tuple[Learned, ...]:
        """The sensors' zeros, gains and delays."""
        return tuple(one for u, one in self._all() if u.nuisance)

    def __getitem__(self, name: str) -> Learned:
        """What is known of an unknown by name; KeyError if there is none."""
        return {u.name: one for u, one in self._all()}[name]

    def _all(self) -> list[tuple[Unknown, Learned]]:
        live = self._live
        z, Pz = live.filter.learned()
        p = np.clip(live.scaling.to_p(z), live.scaling.lower, live.scaling.upper)
        spread = np.sqrt(np.diag(Pz))
        sigma = spread * np.abs(live.scaling.slope(p))
        explained = max(live.misfit) <= live.learner.misfit
        found = []
        for i, u in enumerate(live.unknowns):
            if u.name in live.blind:
                verdict = Verdict.NOT_IDENTIFIABLE
            elif not spread[i] < live.settings.excited:
                verdict = Verdict.NOT_EXCITED
            elif min(p[i] - u.lower, u.upper - p[i]) < 0.1 * sigma[i]:
                verdict = Verdict.AT_BOUND
            else:
                verdict = Verdict.CONVERGED if explained else Verdict.NOT_CONVERGED
            found.append((u, Learned(name=u.name, value=float(p[i]), sigma=float(sigma[i]), verdict=verdict)))
        return found

    def vehicle(self) -> Vehicle:
        """The truck with what was learned; what was sought but not excited keeps the value of the vehicle file."""
        learned = {
            one.name: one.value
            for u, one in self._all()
            if not (u.nuisance or u.considered) and (u.rough or one.verdict != Verdict.NOT_EXCITED)
        }
        return self._live.vehicle.replace(learned)

    def trailer(self, name: str, vehicle: Vehicle, signals: Iterable[str] | None = None) -> None:
        """Couple another trailer behind the same tractor, or one that was there before.

        What was learned of the tractor stays; what is behind it is as it was when a trailer of that name was uncoupled,
        or as in the vehicle file. How the two hang together is forgotten, which leaves the sigma of each as it is.

        Args:
            name: under which the trailer is remembered.
            vehicle: the tractor with that trailer; what it says of the tractor itself is not used.
            signals: of that combination, if others than before.

        Raises:
            SignalError: the name is that of a trailer with another vehicle file, or signals are missing.
            VehicleError: another tractor. The learner is as it was in every case.
        """
        live = self._live
        known = {**self._memory, self._coupled: self._block(of_tractor=False)}
        other = Learner(
            _behind(live.given, vehicle),
            live.signals if signals is None else signals,
            live.settings,
            learner=live.learner,
            trailer=name,
        )
        blocks = [(self._block(of_tractor=True), "the tractor")]
        if name in known:
            blocks.append((known.pop(name), name))
        other._believe(blocks)
        self._live, self._answer, self._coupled, self._memory = other._live, other._answer, name, known

    def _block(self, *, of_tractor: bool) -> memory.Block:
        """The unknowns of the first unit, its sensors and its steered axles, or all others."""
        live = self._live
        first = live.vehicle.units[0].name
        which = [i for i, name in enumerate(live.names) if (first in name.split(".")[:2]) == of_tractor]
        return memory.Block.of(live.unknowns, *live.filter.learned(), which)

    def _believe(self, blocks: Iterable[tuple[memory.Block, str]]) -> None:
        n = len(self._live.unknowns)
        z, Pz = np.zeros(n), np.eye(n)
        for block, title in blocks:
            block.put(self._live.unknowns, z, Pz, title)
        self._live.filter.believe(z, Pz)

    def save(self, path: Path) -> None:
        """Write all that was learned, of all trailers, to one JSON file; the state and the time are not in it."""
        live = self._live
        everything = memory.Block.of(live.unknowns, *live.filter.learned(), range(len(live.unknowns)))
        memory.write(
            path,
            {
                "vehicle": live.given.model_dump(mode="json"),
                "signals": sorted(live.signals),
                "settings": live.settings.as_dict(),
                "learner": asdict(live.learner),
                "coupled": self._coupled,
                "learned": everything.as_dict(),
                "memory": {name: block.as_dict() for name, block in self._memory.items()},
            },
        )

    @classmethod
    def load(cls, path: Path) -> "Learner":
        """A learner that knows what another one knew when it was saved; its next sample is the first of a drive.

        Raises:
            SignalError: the file is damaged, of another kind or of another version.
            FileNotFoundError: there is none.
        """
        told = memory.read(path)
        try:
            learner = cls(
                Vehicle(**told["vehicle"]),
                told["signals"],
                OneStage(**_tuples(told["settings"])),
                learner=LearnerSettings(**told["learner"] | {"looks": Looks(**told["learner"]["looks"])}),
                trailer=told["coupled"],
            )
            learner._memory = {name: memory.Block.from_dict(block) for name, block in told["memory"].items()}
            learner._believe([(memory.Block.from_dict(told["learned"]), str(path))])
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise SignalError(f"{path}: of another version of this program ({error}); begin with a new one") from error
        return learner


def _behind(tractor: Vehicle, other: Vehicle) -> Vehicle:
    """The other vehicle with the first unit of this one."""
    first = f"{tractor.units[0].name}."
    mine, theirs = (
        {path: value for path, value in vehicle.parameters().items() if path.startswith(first)}
        for vehicle in (tractor, other)
    )
    if mine.keys() != theirs.keys():
        raise VehicleError(
            f"{other.units[0].name}: of another make-up than the {tractor.units[0].name} of {tractor.name}, of which "
            "this learner is; a new tractor needs a new Learner"
        )
    return other.replace(mine)


def _tuples(told: Mapping[str, Any]) -> dict[str, Any]:
    """JSON knows lists only."""
    return {name: tuple(value) if isinstance(value, list) else value for name, value in told.items()}
