"""The posterior that a one-stage fit of runs would give, predicted from their Fisher information.

The information of an output-error problem depends on speed, steer angle, logged channels, sampling rate and noise, but
not on the measured values, and it is a sum over channels and runs. So the derivatives of all channels that a truck can
have are computed once for each run; the effect of another channel, a fixed parameter or a further run is then a sum of
small matrices. All weights of Huber's loss are 1. The model is assumed to be exact.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np

from fifthwheel.base.errors import VehicleError
from fifthwheel.base.names import PAYLOAD_HEIGHT, NumberedName, ends_with, split_log
from fifthwheel.base.types import Array
from fifthwheel.data.channels import (
    IDENTIFIED,
    LATERAL_ACCELERATION,
    MOTION,
    USUAL,
    WHEEL_SPEED_DIFFERENCE,
    SignalName,
    is_of,
    measured_signals,
    names_of,
)
from fifthwheel.data.record import Record
from fifthwheel.estimate.filters.noise_model import NoiseModel
from fifthwheel.estimate.identify.dataset import LogData, measured_columns
from fifthwheel.estimate.identify.one_stage.posterior import ScaledPosterior
from fifthwheel.estimate.identify.one_stage.prior import Earlier, JointPrior, nothing
from fifthwheel.estimate.identify.one_stage.problem import Problem
from fifthwheel.estimate.identify.settings import OneStage
from fifthwheel.estimate.identify.setup import Setup
from fifthwheel.estimate.identify.unknowns import parameters
from fifthwheel.estimate.identify.verdict import Verdict, uninformed_parameters
from fifthwheel.model.dynamics.sensors import wheel_pairs
from fifthwheel.model.manoeuvres.accelerations import steer_record
from fifthwheel.truck import Vehicle


@dataclass(frozen=True, kw_only=True, eq=False)
class RunInformation:
    """Fisher information (k, k) of one run on k unknowns z ~ N(0, 1), by channel."""

    names: tuple[str, ...]
    """Names (k,) of the unknowns; those that belong to the run alone end with "@0" or "@0.segment"."""
    logged: Mapping[str, Array]  # of each channel that is logged
    not_logged: Mapping[str, Array]  # of each other channel, if it were logged whenever any channel is

    def information(self, added: Collection[str] = ()) -> Array:
        """Information (k, k) of the logged channels and of the added ones."""
        k = len(self.names)
        channels = (*self.logged.values(), *[self.not_logged[name] for name in added if name in self.not_logged])
        return sum(channels, np.zeros((k, k)))


@dataclass(frozen=True, kw_only=True, eq=False)
class PredictedPosterior(ScaledPosterior):
    """The posterior that a fit would give; sigmas are relative to those of the priors."""

    not_identified: Mapping[str, Verdict] = field(default_factory=dict)
    """Verdict of each parameter without enough information: NOT_EXCITED or NOT_IDENTIFIABLE."""
    no_channel: frozenset[str] = frozenset()  # parameters of roll without a roll rate of their unit

    def verdict(self, name: str) -> Verdict:
        """CONVERGED, NOT_EXCITED or NOT_IDENTIFIABLE."""
        return self.not_identified.get(name, Verdict.CONVERGED)

    def reliable_sigma(self, name: str) -> float:
        """`sigma_of`; that of the prior, 1, for a parameter without enough information, whose estimate is not used."""
        return 1.0 if name in self.not_identified else self.sigma_of(name)

    def correlated_with(self, name: str) -> list[str]:
        """Unknowns that can hardly be separated from this one, the worst first.

        A parameter that is not identifiable has at least one, unless its channel is missing.
        """
        if name in self.no_channel:
            return []
        i = self.names.index(name)
        places = self.correlated(i)
        if self.verdict(name) is Verdict.NOT_IDENTIFIABLE and not places:
            places = [self.most_limiting(i)]
        return [self.names[j] for j in places]


def possible_channels(vehicle: Vehicle, logged: Iterable[str] = (), *, roll: bool = True) -> tuple[str, ...]:
    """Every channel that a one-stage fit can use: yaw rates, articulation angles, roll rates, those others that are
    logged, and lateral accelerations and wheel speed differences where a unit has no channel of motion. Where each has
    one, they add little.

    `roll`: whether it models roll; without, it uses no channel that contains roll.
    """
    units, logged = [unit.name for unit in vehicle.units], set(logged)
    complete = set(units) == {SignalName.of(name).unit for name in logged if is_of(name, *MOTION)}
    channels = USUAL if complete else (*USUAL, LATERAL_ACCELERATION)
    possible = {f"{channel.quantity}.{unit}" for channel in channels for unit in units}
    possible |= set() if complete else _wheel_speed_differences(vehicle, logged)
    return measured_signals(possible | logged, units, [c for c in IDENTIFIED if roll or not c.of_roll])


def _wheel_speed_differences(vehicle: Vehicle, logged: Collection[str]) -> set[str]:
    """Those of the steered axles of the first unit and of the towed units, where the unit has none and the model has
    it."""
    first, *towed = [unit.name for unit in vehicle.units]
    steered = [signal for signal in map(SignalName.of, vehicle.steer_signals()) if signal.unit == first]
    measured = {SignalName.of(name).unit for name in names_of(WHEEL_SPEED_DIFFERENCE, logged)}
    places = [*[signal.place for signal in steered if first not in measured], *[u for u in towed if u not in measured]]
    return set(wheel_pairs(vehicle, [f"wheel_speed.{place}.{side}" for place in places for side in ("left", "right")]))


@dataclass(frozen=True, kw_only=True, eq=False)
class InformationPredictor:
    """The one-stage problem of a truck at the values of its vehicle file; made by `of`."""

    setup: Setup  # with every channel that a fit can use
    start: Mapping[str, float]
    """z of the axles' cornering stiffness where a fit starts, if the vehicle is unstable; else empty."""
    start_vehicle: Vehicle  # the vehicle at `start`, stable at all speeds
    earlier: JointPrior | None = None  # the information of earlier logs

    @classmethod
    def of(
        cls,
        vehicle: Vehicle,
        settings: OneStage,
        speeds: Sequence[float],
        logged: Iterable[str] = (),
        *,
        earlier: Earlier = nothing,
    ) -> "InformationPredictor":
        """The problem of a vehicle with the steered axles that the logs have, at the speeds of all runs, m/s.

        `logged` are signals that are or would be logged; see `possible_channels`. The output-error form, linear tyres
        and the payload heights of the vehicle file are used.

        Raises:
            VehicleError: no parameter is estimated, or the truck is unstable at one of the speeds, however stiff the
                axles behind the first are.
        """
        settings = replace(settings, form="output_error", tyres="linear")
        setup = Setup.of(vehicle, possible_channels(vehicle, logged, roll=settings.roll), settings)
        # responses superpose where tyres do not soften, and payload heights are those of the vehicle file
        centre = {u.name: 0.0 for u in setup.unknowns if u.path.quantity == "softening"}
        centre |= {n: value for n, value in setup.given.items() if ends_with(n, PAYLOAD_HEIGHT)}
        setup = replace(setup, unknowns=tuple(replace(u, centre=centre.get(u.name, u.centre)) for u in setup.unknowns))
        if not setup.estimated:
            raise VehicleError(
                "given: every parameter is exact, so none is left to estimate; leave out one of these statements"
            )
        z = setup.stiffened(np.zeros(len(setup.unknowns)), speeds)
        if setup.slowest_decay(z, speeds) <= 0:
            raise VehicleError(
                f"{vehicle.name}: unstable at {max(speeds):.1f} m/s, however stiff the axles behind the first are; "
                "check masses, axle positions and cornering stiffnesses"
            )
        start = {u.name: float(value) for u, value in zip(setup.unknowns, z, strict=True) if value}
        values = setup.values(z)
        started = vehicle.replace({name: values[name] for name in start})
        return cls(setup=setup, start=start, start_vehicle=started, earlier=earlier(setup))

    def prior_sigma(self, name: str) -> float:
        """Prior standard deviation of an unknown, SI."""
        return next(u.prior_sigma for u in self.setup.unknowns if u.name == split_log(name)[0])

    def run_information(self, log: LogData, logged: Collection[str] | None = None) -> RunInformation:
        """Information of one run; a VehicleError if the truck is unstable in it.

        A channel without noise variance in the log has the default. `logged` are channels that count as logged at every
        sample; by default those that the segments have.
        """
        outputs = self.setup.outputs
        presence = [
            np.isfinite(measured_columns(segment, outputs))
            if logged is None
            else np.tile([name in logged for name in outputs], (len(segment), 1))
            for segment in log.segments
        ]
        log = replace(log, segments=[with_every_sample(segment, outputs) for segment in log.segments])
        present = np.any([samples.any(axis=0) for samples in presence], axis=0)
        problem = Problem(self.setup, [log])
        z = np.array([self.start.get(name, 0.0) for name in problem.names])
        information = {name: np.zeros((len(z), len(z))) for name in outputs}
        for j, samples in enumerate(presence):
            first = 0
            for block in problem.blocks(z, 0, j):
                in_block, first = samples[first : first + len(block.time)], first + len(block.time)
                places = np.ix_(block.indices, block.indices)
                for c, name in enumerate(outputs):
                    used = in_block[:, c] if present[c] else in_block.any(axis=1)
                    scaled = block.jacobian[:, c] * (used / np.sqrt(block.variance[:, c]))[:, None]
                    information[name][places] += scaled.T @ scaled
        if not all(np.isfinite(matrix).all() for matrix in information.values()):
            raise VehicleError(
                f"{self.setup.vehicle.name}: unstable in {log.name}; "
                "check masses, axle positions and cornering stiffnesses"
            )
        is_logged = dict(zip(outputs, present.tolist(), strict=True))
        return RunInformation(
            names=problem.names,
            logged={name: matrix for name, matrix in information.items() if is_logged[name]},
            not_logged={name: matrix for name, matrix in information.items() if not is_logged[name]},
        )

    def steered_run(
        self,
        title: str,
        speed: float,
        steer: Array,
        rate: float,
        noise: Mapping[str, float],
        noise_models: Mapping[str, NoiseModel] = MappingProxyType({}),
    ) -> RunInformation:
        """Information of a run at a speed, m/s, with a steer angle (N,), rad, at a sampling rate, Hz.

        `noise` is the variance of each logged channel, SI squared; `noise_models` are those of channels whose noise is
        not white.
        """
        record = steer_record(self.setup.vehicle, speed, steer, rate, title)
        log = LogData(name=title, segments=[record], noise=noise, noise_models=noise_models)
        return self.run_information(log, list(noise))

    def posterior(
        self,
        runs: Sequence[RunInformation],
        *,
        known: Collection[str] = (),
        better_known: Mapping[str, float] = MappingProxyType({}),
        added: Collection[str] = (),
    ) -> PredictedPosterior:
        """The posterior that a fit of these runs would give, with the `added` channels logged as well.

        `known` are unknowns that are known exactly; of an unknown that every run has, all of them. `better_known` has
        the factor of the prior sigma of unknowns that every run shares; their sigma after the fit is relative to the
        smaller prior.
        """
        names, information = combine_information(runs, known=known, added=added)
        factors = np.array([better_known.get(name, 1.0) for name in names])
        information = (information + self._known(names)) * np.outer(factors, factors)
        return self.posterior_of(names, information, {*added, *[name for run in runs for name in run.logged]})

    def _known(self, names: Sequence[str]) -> Array:
        """Information (k, k) of earlier logs, without the prior."""
        information = np.zeros((len(names), len(names)))
        if self.earlier:
            earlier = self.earlier.among(frozenset(names))
            places = [names.index(name) for name in earlier.names]
            widened = earlier.covariance * np.outer(earlier.widening, earlier.widening)
            information[np.ix_(places, places)] = np.linalg.inv(widened) - np.eye(len(places))
        return information

    def posterior_of(self, names: Sequence[str], information: Array, channels: Collection[str]) -> PredictedPosterior:
        """The posterior for the information (k, k) of given channels on unknowns with given names (k,)."""
        nuisances = [i for i, name in enumerate(names) if name not in self.setup.estimated]
        posterior = PredictedPosterior.from_information(names, information, nuisances=nuisances)
        estimated = [name for name in self.setup.estimated if name in names]
        no_channel = frozenset(name for name in estimated if parameters.lacks_roll_rate(name, channels))
        remaining = {name: posterior.sigma_of(name) for name in estimated}
        not_identified = uninformed_parameters(posterior, remaining, no_channel, self.setup.settings.excited)
        return replace(posterior, not_identified=not_identified, no_channel=no_channel)


def combine_information(
    runs: Sequence[RunInformation], *, known: Collection[str] = (), added: Collection[str] = ()
) -> tuple[tuple[str, ...], Array]:
    """Names (k,) and information (k, k) of all runs together, without the known unknowns.

    Unknowns that belong to one run alone get the number of the run.
    """
    places: dict[str, int] = {}
    names_of_runs = [[NumberedName.of(name).of_log(i) for name in run.names] for i, run in enumerate(runs)]
    for name in (name for names in names_of_runs for name in names):
        if split_log(name)[0] not in known:
            places.setdefault(name, len(places))
    total = np.zeros((len(places), len(places)))
    for run, names in zip(runs, names_of_runs, strict=True):
        kept = [k for k, name in enumerate(names) if name in places]
        target = [places[names[k]] for k in kept]
        total[np.ix_(target, target)] += run.information(added)[np.ix_(kept, kept)]
    return tuple(places), total


def with_every_sample(record: Record, channels: Sequence[str]) -> Record:
    """The record with a value for each sample of the channels, because only measured samples have derivatives."""
    zeros = np.zeros(len(record))
    return record.with_signals({name: np.nan_to_num(record.signals.get(name, zeros)) for name in channels})
