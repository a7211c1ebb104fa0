"""What a one-stage fit would make of drives, before any is fitted: their information at the vehicle file's values.

The information of an output-error problem hangs on speed and steer angle, on what is logged how often and how noisily,
but not on what the sensors showed; and it is the sum over the channels. So the derivatives of all channels that a truck
could have are reckoned once for each drive, and every question - one channel more, one unknown less, one drive more -
is a sum of small matrices. Huber's weights are all one here. The model is taken for right.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from fifthwheel import dynamics
from fifthwheel.errors import VehicleError
from fifthwheel.identify import parameters
from fifthwheel.identify.information import Verdict
from fifthwheel.identify.posterior import Posterior, posterior, verdicts
from fifthwheel.identify.problem import Problem
from fifthwheel.identify.settings import OneStage
from fifthwheel.identify.stage import Log
from fifthwheel.logs import Record
from fifthwheel.vehicle import Vehicle

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class Told:
    """What one drive tells of k unknowns z ~ N(0, 1), by channel: information (k, k)."""

    names: tuple[str, ...]  # (k,); what belongs to the drive alone has an "@"
    logged: Mapping[str, Array]
    possible: Mapping[str, Array]  # of a channel that is not logged, were it logged wherever another one is

    def information(self, added: Collection[str] = ()) -> Array:
        """Of all that is logged, and of the channels that are added to it (k, k)."""
        k = len(self.names)
        return sum(
            (*self.logged.values(), *[self.possible[name] for name in added if name in self.possible]), np.zeros((k, k))
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Foreseen:
    """What a fit would end with."""

    free: Posterior  # all that is sought is learned
    settled: Posterior  # what is not told keeps the vehicle file's value
    idle: Mapping[str, Verdict] = field(default_factory=dict)  # what is not told, and why
    unseen: frozenset[str] = frozenset()  # what has no channel of its own

    def sigma(self, name: str) -> float:
        """Standard deviation of an unknown after the fit, in units of its prior's."""
        return float(self.settled.sigma[self.settled.names.index(name)])

    def alone(self, name: str) -> float:
        """The same if all other parameters were known, but not the sensors' errors."""
        return self.free.alone(self.free.names.index(name))

    def confused(self, name: str) -> list[str]:
        """What an unknown can hardly be told apart from, the worst first; of one that is not told, at least one."""
        if name in self.unseen:
            return []
        known = self.free if name in self.idle else self.settled
        i = known.names.index(name)
        found = known.confused(i)
        if self.idle.get(name) is Verdict.NOT_IDENTIFIABLE and not found:
            found = [known.worst_companion(i)]
        return [known.names[j] for j in found]


def possible_channels(vehicle: Vehicle) -> tuple[str, ...]:
    """All that a one-stage fit can use."""
    units = [unit.name for unit in vehicle.units]
    yaw = [f"yaw_rate.{u}" for u in units] + [f"articulation.{u}" for u in units[1:]]
    return (*yaw, *[f"roll_rate.{u}" for u in units])


class Forecast:
    """The one-stage problem of a truck, at the values of its vehicle file.

    Args:
        vehicle: what is known of it, steered as the logs are.
        settings: of the fit; it is reckoned in the output-error form.
        speeds: m/s, of all drives, or their lowest and highest.

    Raises:
        VehicleError: nothing is sought, or the truck is unstable at one of the speeds, however stiff its axles are.
    """

    def __init__(self, vehicle: Vehicle, settings: OneStage, speeds: Sequence[float]) -> None:
        self.vehicle = vehicle
        self.settings = replace(settings, form="output_error", initial_payload_height=None)
        self.sought = parameters.one_stage_sought(vehicle, self.settings)
        if not self.sought:
            raise VehicleError("held: every parameter is held, nothing is left to seek; leave one free")
        self.channels = possible_channels(vehicle)
        self.unknowns = parameters.one_stage_unknowns(vehicle, self.channels, self.settings)
        free = tuple(dynamics.all_parameters(vehicle, self.channels))
        self.model = dynamics.model(vehicle, self.channels, roll=True, bank=settings.nuisances, free=free)
        self.start, self.steadied = self._steadied(speeds)

    def unknown(self, name: str) -> parameters.Unknown:
        """One of the unknowns by name, without the number of its log."""
        return next(u for u in self.unknowns if u.name == name.partition("@")[0])

    def prior(self, name: str) -> float:
        """Standard deviation that an unknown is given beforehand, SI."""
        unknown = self.unknown(name)
        return unknown.scale * (unknown.centre if unknown.logarithmic else 1.0)

    def _steadied(self, speeds: Sequence[float]) -> tuple[dict[str, float], Vehicle]:
        """Where a fit starts if the file's truck is unstable: axles behind the first stiffer, by z; and that truck."""
        _, *others = [f"{path}.cornering_stiffness" for path in parameters.group_paths(self.vehicle)]
        axles = [u for u in self.unknowns if u.name in others and not u.considered]
        z, vehicle, most = 0.0, self.vehicle, min((np.log(u.upper / u.centre) / u.scale for u in axles), default=0.0)
        while not all(stable(vehicle, speed) for speed in speeds):
            if z >= most:
                raise VehicleError(
                    f"{self.vehicle.name}: unstable at {max(speeds):.1f} m/s, however stiff the axles behind the first "
                    "are; check masses, axle positions and stiffnesses"
                )
            z += 0.5
            vehicle = self.vehicle.replace({u.name: u.centre * float(np.exp(z * u.scale)) for u in axles})
        return ({u.name: z for u in axles} if z else {}), vehicle

    def drive(self, log: Log, logged: Collection[str] | None = None) -> Told:
        """What a drive tells; its `noise` holds the variance of its channels, elsewhere it is the table's.

        Args:
            logged: channels that count as logged at every sample; by default those that its sections hold.
        """
        log = Log(name=log.name, sections=log.sections, noise=dict(log.noise))
        there = [self._there(section, logged) for section in log.sections]
        held = np.any([seen.any(axis=0) for seen in there], axis=0)
        problem = Problem(self.model, self.vehicle, [log], self.unknowns, self.settings)
        z = np.array([self.start.get(name, 0.0) for name in problem.names])
        found = {name: np.zeros((len(z), len(z))) for name in self.channels}
        for j, seen in enumerate(there):
            done = 0
            for part in problem.parts(z, 0, j):
                here, done = seen[done : done + len(part.time)], done + len(part.time)
                places = np.ix_(part.places, part.places)
                for c, name in enumerate(self.channels):
                    rows = here[:, c] if held[c] else here.any(axis=1)
                    scaled = part.jacobian[:, rows, c] / np.sqrt(part.variance[rows, c])
                    found[name][places] += scaled @ scaled.T
        if not all(np.isfinite(one).all() for one in found.values()):
            raise VehicleError(f"{self.vehicle.name}: runs away in {log.name}; check masses, positions and stiffnesses")
        own = dict(zip(self.channels, held.tolist(), strict=True))
        return Told(
            names=problem.names,
            logged={name: one for name, one in found.items() if own[name]},
            possible={name: one for name, one in found.items() if not own[name]},
        )

    def _there(self, section: Record, logged: Collection[str] | None) -> NDArray[np.bool_]:
        """Which samples of which channels there are (N, m)."""
        if logged is not None:
            return np.tile([name in logged for name in self.channels], (len(section), 1))
        missing = np.full(len(section), np.nan)
        return np.column_stack([np.isfinite(section.signals.get(name, missing)) for name in self.channels])

    def fit(self, drives: Sequence[Told], *, known: Collection[str] = (), added: Collection[str] = ()) -> Foreseen:
        """What a fit of these drives would end with.

        Args:
            known: unknowns that are known to the last digit; of what each drive has its own, all of them.
            added: channels to be logged besides.
        """
        names, information = together(drives, known=known, added=added)
        return self.judge(names, information, {*added, *[name for drive in drives for name in drive.logged]})

    def judge(self, names: Sequence[str], information: Array, channels: Collection[str]) -> Foreseen:
        """The same for unknowns by name, the information of them (k, k), and the channels that it comes from."""
        kept = [u.name for u in self.unknowns if u.considered and u.name in names and u.name not in self.sought]
        own = {u.name for u in self.unknowns if not u.nuisance}
        nuisances = [i for i, name in enumerate(names) if name not in own]
        free = posterior(names, information, considered=kept, nuisances=nuisances)
        seek = [name for name in self.sought if name in names]
        told = verdicts(free, [free.names.index(name) for name in seek], self.settings.excited)
        idle = {free.names[i]: verdict for i, verdict in told.items() if verdict is not Verdict.CONVERGED}
        moving = len(idle) < len(seek) or Verdict.NOT_IDENTIFIABLE in idle.values()
        unseen = frozenset(name for name in seek if parameters.unseen(name, channels))
        idle |= dict.fromkeys(unseen, Verdict.NOT_IDENTIFIABLE if moving else Verdict.NOT_EXCITED)
        settled = posterior(names, information, considered=[*kept, *idle], nuisances=nuisances)
        return Foreseen(free=free, settled=settled, idle=idle, unseen=unseen)


def stable(vehicle: Vehicle, speed: float) -> bool:
    """Whether the linear truck with roll comes to rest again at a speed, m/s."""
    return bool(np.linalg.eigvals(dynamics.matrices(vehicle, speed, roll=True).A).real.max() < 0)


def together(
    drives: Sequence[Told], *, known: Collection[str] = (), added: Collection[str] = ()
) -> tuple[tuple[str, ...], Array]:
    """Names (k,) and information (k, k) of all drives; each drive's own unknowns apart, with its number."""
    places: dict[str, int] = {}
    own = [[name.replace("@0", f"@{i}", 1) for name in drive.names] for i, drive in enumerate(drives)]
    for name in (name for names in own for name in names):
        if name.partition("@")[0] not in known:
            places.setdefault(name, len(places))
    total = np.zeros((len(places), len(places)))
    for drive, names in zip(drives, own, strict=True):
        kept = [k for k, name in enumerate(names) if name in places]
        here = [places[names[k]] for k in kept]
        total[np.ix_(here, here)] += drive.information(added)[np.ix_(kept, kept)]
    return tuple(places), total
