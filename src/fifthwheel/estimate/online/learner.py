"""The on-line form of the one-stage identification: every sample as it comes, in bounded time and memory.

It learns while the driver steers (`Excitation`), repeats the samples of each segment with excitation from a better
point of linearisation (`filters.relinearised`), and reports states whose sigmas include the uncertainty of the truck.
"""

import copy
import itertools
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, Self

import numpy as np

from fifthwheel.base.arguments import expect, expect_known, expect_names, expect_optional, expect_sample
from fifthwheel.base.errors import SignalError, VehicleError
from fifthwheel.base.names import ParameterPath
from fifthwheel.data.channels import CHANNELS
from fifthwheel.data.channels.sensors import SensorPrior
from fifthwheel.data.record import Record
from fifthwheel.data.record.derived import all_pairs, sample_with_differences, with_differences
from fifthwheel.estimate.identify.doubts import Doubt
from fifthwheel.estimate.identify.given import applied, with_sensors
from fifthwheel.estimate.identify.knowledge.information import Labels, Occasion
from fifthwheel.estimate.identify.knowledge.knowledge import Knowledge
from fifthwheel.estimate.identify.result.identification import Identification
from fifthwheel.estimate.identify.settings import OneStage, require_own_functions
from fifthwheel.estimate.identify.setup import Setup
from fifthwheel.estimate.identify.statement import with_values
from fifthwheel.estimate.identify.stored import reason, restored, stored
from fifthwheel.estimate.identify.unknowns.parameters import lacks_roll_rate
from fifthwheel.estimate.identify.unknowns.unknown import Unknown
from fifthwheel.estimate.identify.verdict import Verdict, estimate_verdict
from fifthwheel.estimate.online.learned import LearnedLog, find_doubts
from fifthwheel.estimate.online.live_filter import LiveFilter
from fifthwheel.estimate.online.online_model import online_setup
from fifthwheel.estimate.online.settings import LearnerSettings
from fifthwheel.estimate.online.start import LEARNER_FILE, EstimateBlock, combine_blocks, with_prior_means
from fifthwheel.estimate.stream import VALID, take_turn
from fifthwheel.truck import Vehicle


@dataclass(frozen=True, kw_only=True)
class LearnedValue:
    """The estimate of one unknown."""

    name: str
    value: float
    """SI; the prior mean without excitation."""
    sigma: float
    """Standard deviation, SI; the prior's without excitation."""
    verdict: Verdict


class Learner:
    """Parameters and states of one truck, sample by sample.

    The constructor compiles the filter's step for the model, or takes it from the cache.

    Args:
        vehicle: what is known of the truck.
        signals: names of the measured signals; speed, a steer angle and a yaw rate must be among them. A
            learner uses `channels.LEARNED`, and wheel speeds of both sides of an axle that is not driven.
        settings: what is known of numbers, noise and limits, as for `identify`; settings of the search have no effect.
            A delay of the steer angle is compensated to first order, by its slope.
        sensors: what is stated of them by signal, such as `SignalMap.sensors` or `Record.sensors`.
        learner: when it learns, and how it treats faults of the signals.
        trailer: name under which the estimates of the units behind the first are kept; by default that of the
            occasion, or the vehicle's.
        knowledge: information of earlier logs of the truck, with which the estimates begin. It is the joint prior of
            all shared unknowns; those that are considered keep its mean.
        occasion: the trailer and the load of that knowledge.

    Raises:
        SignalError: a necessary signal is missing, no unknown is left to estimate, or the vehicle has another load than
            the knowledge.
        VehicleError: a statement of the settings cannot be used, or the knowledge is of another truck.

    Example:
        >>> import fifthwheel as fw
        >>> truck = fw.vehicle("cheng_cebon_2011")
        >>> record = fw.simulate(truck, count=1)
        >>> learner = fw.Learner(truck, ["speed", "steer.tractor.front", "yaw_rate.tractor"])
        >>> now = learner.push({"time": 0.0, "speed": 20.0, "steer.tractor.front": 0.0, "yaw_rate.tractor": 0.0})
        >>> now["learning"]
        0.0
        >>> str(learner["tractor.front.cornering_stiffness"].verdict)
        'not_excited'
    """

    def __init__(
        self,
        vehicle: Vehicle,
        signals: Iterable[str],
        settings: OneStage | None = None,
        *,
        sensors: Mapping[str, SensorPrior] = MappingProxyType({}),
        learner: LearnerSettings | None = None,
        trailer: str | None = None,
        knowledge: Knowledge | None = None,
        occasion: Occasion | None = None,
    ) -> None:
        expect("vehicle", vehicle, Vehicle)
        expect_names("signals", signals)
        expect_optional("settings", settings, OneStage)
        expect_optional("learner", learner, LearnerSettings)
        expect_known("learner.discrepancy", learner.discrepancy if learner else (), CHANNELS)
        occasion = occasion or Occasion(trailer=trailer or "")
        if knowledge is not None:
            knowledge.require_same_truck(vehicle, occasion)
            knowledge.require_same_load(vehicle, occasion)
        vehicle, settings = applied(vehicle, settings or OneStage(tyres="linear"))
        self._vehicle_file, self._signals, self._knowledge = vehicle, frozenset(signals), knowledge
        expect_known("sensors", sensors, sorted(self._signals))
        settings = with_sensors(vehicle, settings, sensors)
        setup = online_setup(vehicle, self._signals, settings)
        start = combine_blocks(setup.unknowns, [], knowledge.prior(setup, occasion) if knowledge else None)
        self._live = LiveFilter(setup, learner or LearnerSettings(), *start)
        self._trailer = (occasion.trailer or vehicle.name) if trailer is None else trailer
        self._uncoupled: dict[str, EstimateBlock] = {}  # estimates of other trailers by name
        self._time, self._idle = math.nan, [True]  # of the last sample, s; see `take_turn`
        self._log = LearnedLog(occasions={self._trailer: occasion})

    @classmethod
    def of(
        cls,
        identification: Identification,
        signals: Iterable[str] | None = None,
        *,
        learner: LearnerSettings | None = None,
    ) -> Self:
        """A learner that begins at an identified vehicle, with the priors of its settings.

        Its prior is not the covariance of the result, so that it can follow a change of the vehicle. Signals by default
        those of the identification; `learner` as above.
        """
        settings = identification.settings.one_stage
        settings = settings and replace(settings, given=with_values(settings.given, identification.surroundings))
        signals = identification.signals if signals is None else signals
        return cls(identification.vehicle, signals, settings, learner=learner)

    def __copy__(self) -> "Learner":
        """A copy that learns on its own."""
        return copy.deepcopy(self)

    def push(self, sample: Mapping[str, float | None]) -> dict[str, float]:
        """Process one sample.

        Args:
            sample: "time" and signals by name, SI; a signal that is missing, None or NaN was not measured.

        Returns:
            "time"; sideslip, yaw rate, articulation, roll and roll rate of the units, each with "<name>.sigma", which
            includes the uncertainty of the parameters; NaN if the status is TOO_SLOW or INPUT_MISSING. "status"
            (`observe.Status`), and "learning": 1 if it learned from this sample, else 0.

        Raises:
            SignalError: the time is missing, not finite, or not after the previous one; or another thread pushes a
                sample. The learner does not change. Samples in order for 1 s after the time went back are a new start.
        """
        live = self._live
        take_turn(self._idle)
        try:
            if live.differences:
                sample = sample_with_differences(sample, live.differences)
            get = sample.get
            status = live.push(get("time"), [get(n) for n in live.inputs], [get(n) for n in live.outputs])
            self._time = time = live.stream.time
            answer: dict[str, float] = {"time": time, "status": status, "learning": float(live.learning)}
            keys = live.view.keys
            values = live.view.read(live.monitor.excess) if status in VALID else itertools.repeat(math.nan, len(keys))
            answer.update(zip(keys, values, strict=True))
        except (AttributeError, TypeError):
            expect_sample(sample)
            raise
        else:
            return answer
        finally:
            self._idle.append(True)

    def learn(self, record: Record) -> None:
        """Process all samples of a record; the result is the same to the last bit as that of `push`.

        Raises:
            SignalError: a signal of the learner is missing, the record states sensors that the learner was made
                without, or it starts before the last sample; the learner is unchanged.
        """
        setup = self._live.setup
        names = (*setup.inputs, *setup.outputs)
        record = with_differences(record, set(names).intersection(all_pairs(record.signals)))
        for name in names:
            if name not in record.signals:
                raise SignalError(f"{name}: not in {record.name}; make a Learner with the signals that it has")
        if record.time[0] <= self._time:
            raise SignalError(
                f"time: {record.name} starts at {record.time[0]:g} s, which is not after {self._time:g} s; "
                "give records in the order of time"
            )
        stated = {name: sensor for name, sensor in record.sensors.items() if name in names}
        if with_sensors(setup.vehicle, setup.settings, stated) != setup.settings:
            raise SignalError(
                f"{record.name}: states sensors ({', '.join(stated)}) that the learner was made without; make it with "
                "sensors=record.sensors"
            )
        rows = np.column_stack([record.signals[name] for name in names]).tolist()
        k = len(setup.inputs)
        for time, row in zip(record.time.tolist(), rows, strict=True):
            self._time = time
            self._live.push(time, row[:k], row[k:])

    @property
    def live(self) -> LiveFilter:
        """The filter of single samples, with problem and settings."""
        return self._live

    @property
    def reported(self) -> tuple[str, ...]:
        """Names of the states that `push` gives."""
        return self._live.view.names

    @property
    def trailer(self) -> str:
        """Name under which the estimates of the units behind the first are kept."""
        return self._trailer

    @property
    def parameters(self) -> tuple[LearnedValue, ...]:
        """The estimated and the uncertain parameters, without the considered ones."""
        return self._parameters(finished=True)

    @property
    def present_parameters(self) -> tuple[LearnedValue, ...]:
        """The same within a fixed time: while the driver steers, the samples are not repeated to the end."""
        return self._parameters(finished=False)

    def _parameters(self, *, finished: bool) -> tuple[LearnedValue, ...]:
        requested = self._live.setup.estimated
        of_truck = ((u, v) for u, v in self._estimates(finished=finished) if u.is_of_truck)
        return tuple(v for u, v in of_truck if u.estimated or u.name in requested)

    @property
    def sensors(self) -> tuple[LearnedValue, ...]:
        """Offsets, gains and delays of the sensors."""
        return tuple(value for u, value in self._estimates() if u.is_sensor_error)

    def __getitem__(self, name: str) -> LearnedValue:
        """The estimate of an unknown by name; KeyError if there is none."""
        return {u.name: value for u, value in self._estimates()}[name]

    @property
    def doubts(self) -> tuple[Doubt, ...]:
        """Evidence against an assumption, with the parameters that are doubtful therefore."""
        return find_doubts(self._live, self._live.estimate())

    def _estimates(self, *, finished: bool = True) -> list[tuple[Unknown, LearnedValue]]:
        live, setup = self._live, self._live.setup
        estimate = live.estimate(finished=finished)
        doubtful = {name for doubt in find_doubts(live, estimate) for name in doubt.parameters}
        z, known = np.append(estimate.z, live.considered.mean), live.considered.sigma
        p = np.clip(setup.scaling.to_p(z), setup.scaling.lower, setup.scaling.upper).tolist()
        sigma_z = (np.sqrt(np.diag(estimate.covariance())) * np.append(np.ones(len(estimate.z)), known)).tolist()
        measured = live.innovations.measured or setup.outputs  # a channel without samples counts as absent
        estimates = []
        for u, value, s in zip(setup.unknowns, p, sigma_z, strict=True):
            if not u.is_sensor_error and lacks_roll_rate(u.name, measured):
                verdict = Verdict.NOT_IDENTIFIABLE
            else:
                verdict = estimate_verdict(u, value, s, excited=setup.settings.excited, doubtful=u.name in doubtful)
            estimates.append((u, LearnedValue(name=u.name, value=value, sigma=u.sigma(value, s), verdict=verdict)))
        return estimates

    @property
    def knowledge(self) -> Knowledge:
        """The information of the logs that it began with, and of what it learned: a log for each time that a trailer
        was coupled.

        A later `identify` or another learner begins with it. It contains nothing on the considered unknowns.
        """
        logs = self._log.finished(self._live, self._trailer, self._time).logs
        return (self._knowledge or Knowledge()).with_logs(logs)

    def vehicle(self) -> Vehicle:
        """The vehicle with the estimates; a parameter that is not excited or not identifiable keeps its given value.

        The friction of the road is not part of it.
        """
        unknown = (Verdict.NOT_EXCITED, Verdict.NOT_IDENTIFIABLE)
        given = self._live.setup.vehicle.parameters()
        values = {
            value.name: value.value
            for u, value in self._estimates()
            if u.name in given and u.estimated and value.verdict not in unknown
        }
        return self._live.setup.vehicle.replace(values)

    def couple(self, trailer: str, vehicle: Vehicle, signals: Iterable[str] | None = None) -> None:
        """Couple another trailer to the same tractor, or one that was coupled before.

        The estimates of the tractor stay. Those of the units behind it are the ones of the last time that this trailer
        was coupled, or from the knowledge of earlier logs with it, or the prior.
        Correlations between tractor and trailer are discarded; the sigmas stay.

        Args:
            trailer: name under which its estimates are kept.
            vehicle: the tractor with this trailer; its values of the tractor are not used.
            signals: measured signals of this combination, if they differ.

        Raises:
            SignalError: this trailer was coupled with another vehicle file, or a necessary signal is missing.
            VehicleError: the vehicle has another tractor. The learner is unchanged in all cases.
        """
        kept = {**self._uncoupled, self._trailer: self._block(of_tractor=False)}
        blocks = [(self._block(of_tractor=True), "the tractor")]
        if trailer in kept:
            blocks.append((kept.pop(trailer), trailer))
        combination = _with_tractor_of(self._vehicle_file, vehicle)
        measured = self._signals if signals is None else frozenset(signals)
        setup = online_setup(combination, measured, self._live.setup.settings)
        occasion = self._log.occasions.get(trailer, Occasion(trailer=trailer))
        earlier = self._knowledge.prior(setup, occasion) if self._knowledge else None
        if earlier is not None:
            blocked = {name for block, _ in blocks for name in block.names}
            own = {u.name for u in setup.unknowns if not _is_of_tractor(setup, u)}
            earlier = earlier.among(own - blocked)
        live = LiveFilter(setup, self._live.learner, *combine_blocks(setup.unknowns, blocks, earlier))
        live.innovations.restore(**self._live.innovations.as_dict())
        log = self._log.finished(self._live, self._trailer, self._time)
        self._log = replace(log, occasions={**log.occasions, trailer: occasion})
        self._vehicle_file, self._signals = combination, measured
        self._live, self._trailer, self._uncoupled = live, trailer, kept

    def change_since(self, before: "Learner") -> dict[str, tuple[float, float]]:
        """By parameter: estimate less that of another learner of the same vehicle, and the sigma of the difference, SI.

        Both learned from different samples. The considered unknowns have the same errors in both, so that the sigma
        contains only the difference of their effects.
        """
        setup, new, old = self._live.setup, self._live.estimate(), before._live.estimate()
        known, known_before = self._live.considered, before._live.considered
        unknowns, count = setup.estimated_unknowns, len(setup.unknowns)
        B, B_old = new.B / known.sigma, old.B / known_before.sigma
        z_old = old.z + B_old @ (known.mean - known_before.mean)
        p, p_old = (setup.scaling.to_p(with_prior_means(z, count)) for z in (new.z, z_old))
        gains = (B - B_old) * known.sigma @ np.linalg.cholesky(known.correlation)
        sigma = np.sqrt(np.diag(new.Pz + old.Pz + gains @ gains.T)) * np.abs(setup.scaling.slope(p)[: len(unknowns)])
        changes = zip(unknowns, (p - p_old).tolist(), sigma.tolist(), strict=False)
        return {u.name: (change, s) for u, change, s in changes if not u.is_sensor_error}

    def with_fixed(self, vehicle: Vehicle, values: Mapping[str, float]) -> "Learner":
        """A learner with the same estimates in which exactly these parameters are fixed.

        Args:
            vehicle: what is known of the truck; parameters that were fixed before have its values as priors.
            values: by the path of the parameter, SI.

        Raises:
            SignalError: no unknown is left to estimate.
            VehicleError: a parameter cannot be fixed.
        """
        live, setup = self._live, self._live.setup
        known = {name: text for name, text in setup.settings.given.items() if name not in vehicle.parameters()}
        settings = replace(setup.settings, given=known | dict.fromkeys(values, "exact"))
        fixed = Learner(vehicle.replace(values), self._signals, settings, learner=live.learner, trailer=self._trailer)
        unknowns = fixed._live.setup.unknowns
        block = self._joint_block().restricted(unknowns)
        start = combine_blocks(unknowns, [(block, "this learner")])
        fixed._live, fixed._knowledge = LiveFilter(fixed._live.setup, live.learner, *start), self._knowledge
        fixed._live.innovations.restore(**live.innovations.as_dict())
        fixed._log = self._log.finished(live, self._trailer, self._time)
        fixed._uncoupled = {name: other.restricted(unknowns) for name, other in self._uncoupled.items()}
        return fixed

    def _block(self, *, of_tractor: bool) -> EstimateBlock:
        """Estimates of the first unit with its sensors and steered axles, or of all other unknowns."""
        setup = self._live.setup
        places = [i for i, u in enumerate(setup.unknowns) if _is_of_tractor(setup, u) == of_tractor]
        return self._joint_block().among(places)

    def _joint_block(self) -> EstimateBlock:
        return EstimateBlock.of(self._live.setup.unknowns, *self._live.joint())

    def save(self, path: str | Path) -> None:
        """Write the estimates of tractor and all trailers to a JSON file; state and time are not saved."""
        LEARNER_FILE.write(path, self.content())

    def content(self) -> dict[str, Any]:
        """What `save` writes; later samples do not change it."""
        setup = self._live.setup
        estimate, innovations = self._live.filter.estimate(), self._live.innovations
        return {
            "vehicle": self._vehicle_file.model_dump(mode="json"),
            "signals": sorted(self._signals),
            "settings": setup.settings.as_dict(),
            "learner": self._live.learner.as_dict(),
            "trailer": self._trailer,
            "estimates": stored(EstimateBlock, self._joint_block()),
            "knowledge": self._log.as_dict(self._live, self._trailer, self._time),
            "evidence": {
                "gradient": estimate.gradient.tolist(),
                "information": estimate.information.tolist(),
                "innovations": innovations.as_dict(),
            },
            "uncoupled": stored(dict[str, EstimateBlock], self._uncoupled),
        }

    @classmethod
    def load(cls, path: str | Path, *, knowledge: Knowledge | None = None) -> "Learner":
        """A learner with the saved estimates; its next sample is the first of a run.

        `knowledge` is for trailers that are coupled later; the saved estimates contain it already.

        Raises:
            SignalError: the file cannot be read, is damaged, not of a learner, or of another version.
        """
        return cls.of_content(LEARNER_FILE.read(path), str(path), knowledge=knowledge)

    @classmethod
    def of_content(cls, content: Mapping[str, Any], path: str, *, knowledge: Knowledge | None = None) -> "Learner":
        """A learner with the estimates in the content of the file `path`; arguments and errors as in `load`."""
        require_own_functions(content, path)
        try:
            learner = cls(
                Vehicle(**content["vehicle"]),
                content["signals"],
                restored(OneStage, content["settings"]),
                learner=restored(LearnerSettings, content["learner"]),
                trailer=content["trailer"],
            )
            if knowledge is not None:
                knowledge.require_same_truck(learner._vehicle_file, Occasion())
            learner._knowledge = knowledge
            blocks = [(EstimateBlock.restored(content["estimates"]), path)]
            setup, evidence = learner._live.setup, content["evidence"]
            scores = (np.array(evidence["gradient"]), np.array(evidence["information"]))
            start = combine_blocks(setup.unknowns, blocks)
            learner._live = live = LiveFilter(setup, learner._live.learner, *start)
            live.filter.set_estimate(live.joint_estimate(*start, *scores))
            live.innovations.restore(**evidence["innovations"])
            learner._log = LearnedLog.restored(content["knowledge"], live)
            for name, block in content["uncoupled"].items():
                learner._uncoupled[name] = EstimateBlock.restored(block)
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise SignalError(
                f"{path}: written by another version of fifthwheel ({reason(error)}); start with a new Learner, or "
                "load it with the version that wrote it"
            ) from error
        return learner


def _with_tractor_of(tractor: Vehicle, vehicle: Vehicle) -> Vehicle:
    """The vehicle with the values of another one's first unit; a VehicleError if its parameters are others."""
    first = tractor.units[0].name
    values, replaced = (
        {path: value for path, value in v.parameters().items() if ParameterPath.of(path).unit == first}
        for v in (tractor, vehicle)
    )
    if values.keys() != replaced.keys():
        raise VehicleError(
            f"{vehicle.units[0].name}: differs in its parameters from the {first} of {tractor.name}, which this "
            "learner has; a new tractor needs a new Learner"
        )
    return vehicle.replace(values)


def _is_of_tractor(setup: Setup, unknown: Unknown) -> bool:
    """Whether an unknown belongs to the truck, and not to a trailer, a load or a log."""
    return [*dict(Labels.of(setup.vehicle, Occasion()).owned(unknown.name).owner)] == ["tractor"]
