"""Experiment design: the shortest run that reaches target accuracies, or the obstacles if no run does."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from numbers import Real
from typing import Any

import numpy as np

import fifthwheel
from fifthwheel.base.arguments import expect, expect_names, expect_optional
from fifthwheel.base.errors import SignalError, VehicleError
from fifthwheel.base.spelling import setting
from fifthwheel.data.channels import GYROS, MOTION, is_of
from fifthwheel.data.record import Record
from fifthwheel.estimate.design.predict import InformationPredictor, possible_channels
from fifthwheel.estimate.design.remedies import PredictedRemedies, Remedy, lane_change_information
from fifthwheel.estimate.design.road_noise import road_noise
from fifthwheel.estimate.design.search import DesignSettings, ProposedRun, search_candidates, stable_speeds
from fifthwheel.estimate.filters import variances
from fifthwheel.estimate.identify.dataset import prepare_dataset
from fifthwheel.estimate.identify.given import applied
from fifthwheel.estimate.identify.one_stage.prior import Earlier, nothing
from fifthwheel.estimate.identify.settings import OneStage, Progress
from fifthwheel.estimate.identify.unknowns import parameters
from fifthwheel.estimate.identify.unknowns.parameters import known_of
from fifthwheel.estimate.identify.verdict import Verdict
from fifthwheel.model.manoeuvres.accelerations import steer_record
from fifthwheel.truck import Vehicle
from fifthwheel.truck.quantities import size_of

DEFAULT_TARGET = 0.05
"""Default target: relative sigma of every cornering stiffness and of the yaw inertia of every unit behind the first."""


@dataclass(frozen=True, kw_only=True)
class UnmetTarget:
    """A target that the best run does not reach; sigmas are relative to the parameter's value."""

    name: str
    """Parameter."""
    wanted: float
    """Target sigma."""
    sigma: float
    """Sigma that the best run gives."""
    verdict: Verdict
    remedies: tuple[Remedy, ...]
    """Changes that would reduce sigma; theirs is relative, too."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ExperimentDesign:
    """The proposed run, alternatives, and targets that it does not reach."""

    vehicle: Vehicle
    targets: Mapping[str, float]
    """Wanted sigma by parameter, relative to its value."""
    channels: tuple[str, ...]
    """Channels that are logged."""
    rate: float
    """Sampling rate, Hz."""
    best: ProposedRun
    alternatives: tuple[ProposedRun, ...]
    """The best runs with other kinds of manoeuvres."""
    unmet: tuple[UnmetTarget, ...]
    """Empty if the best run reaches all targets."""
    notes: tuple[str, ...]

    @property
    def met(self) -> bool:
        """Whether the best run reaches all targets."""
        return not self.unmet

    def record(self) -> Record:
        """Time, speed and steer angle of the best run."""
        return steer_record(self.vehicle, self.best.speed, self.best.steer, self.rate, self.best.kind)

    def to_json(self, **more: Any) -> str:
        """The content as JSON, without the samples of the steer angle; `more` adds keys."""
        content = {
            "version": fifthwheel.__version__,
            "vehicle": self.vehicle.name,
            "targets": dict(self.targets),
            "channels": self.channels,
            "met": self.met,
            "best": self.best.as_dict(),
            "alternatives": [run.as_dict() for run in self.alternatives],
            "unmet": [asdict(target) for target in self.unmet],
            "notes": self.notes,
        }
        return json.dumps(content | more, indent=2)


def design_experiment(
    vehicle: Vehicle,
    targets: Mapping[str, float] | None = None,
    settings: OneStage | None = None,
    *,
    channels: Sequence[str] = (),
    planning: DesignSettings | None = None,
    earlier: Earlier = nothing,
    progress: Progress = lambda *_: None,
) -> ExperimentDesign:
    """The shortest run after which a one-stage fit reaches all targets; of equally long runs the gentlest.

    Predicted, like `predict_sigmas`, at the values of the vehicle file: the better the file, the better the design.
    The model is assumed to be exact, and only the first steered axle steers. The road is uneven (`road_noise`), but it
    has no bank. More data does not reduce the part of sigma that comes from numbers that the run does not inform, such
    as masses.

    Args:
        vehicle: what is known of the truck.
        targets: wanted sigma by parameter, relative to its value; by default `DEFAULT_TARGET` for every cornering
            stiffness and for the yaw inertia of every unit behind the first. A parameter with a target is estimated.
        settings: settings of the fit.
        channels: signals that will be logged; by default the yaw and the roll rate of every unit.
        planning: the candidate runs.
        progress: called with a title, the number of manoeuvres done and their total.

    Raises:
        SignalError: a fit cannot use the channels.
        VehicleError: a target is no parameter, is that of an exact parameter or not above zero; or the truck is
            unstable at every speed.

    Example:
        >>> import fifthwheel as fw
        >>> truck = fw.vehicle("cheng_cebon_2011")
        >>> design = fw.design_experiment(truck, {"semitrailer.yaw_inertia": 0.1})
        >>> design.best.sigma["semitrailer.yaw_inertia"] < 0.1
        True
    """
    expect("vehicle", vehicle, Vehicle)
    expect_optional("settings", settings, OneStage)
    expect_names("channels", channels)
    vehicle, settings = applied(vehicle, settings or OneStage())
    planning = planning or DesignSettings()
    channels = _usable_channels(vehicle, channels)
    targets = dict(targets) if targets else default_targets(vehicle, settings)
    settings = _with_targets_estimated(vehicle, targets, settings)
    truck = _prepared_vehicle(vehicle, channels, settings)
    speeds = stable_speeds(truck, planning)
    predictor = InformationPredictor.of(truck, settings, speeds, channels, earlier=earlier)
    noise = {name: variances.sensor_variance(truck, name, settings.noise) for name in channels}
    candidates = list(search_candidates(predictor, speeds, targets, noise, planning, progress))
    best, *others = _best_of_each_kind(candidates, planning)
    others = [run for run in others if all(run.verdicts[name] is Verdict.CONVERGED for name in targets)]
    unstable = ", ".join(f"{3.6 * speed:.0f} km/h" for speed in planning.speeds if speed not in speeds)
    note = f"{truck.name}: with the values of its file unstable at {unstable}; these speeds are left out."
    return ExperimentDesign(
        vehicle=truck,
        targets=targets,
        channels=channels,
        rate=planning.rate,
        best=best,
        alternatives=tuple(others[: planning.alternatives]),
        unmet=_unmet_targets(predictor, best, targets, noise, planning),
        notes=(note,) if unstable else (),
    )


def _best_of_each_kind(candidates: Sequence[ProposedRun], planning: DesignSettings) -> list[ProposedRun]:
    """The best run of each kind of manoeuvre, the best of all first: the shortest that reaches all targets, of equally
    long ones the gentlest; if none does, the shortest of those that come nearest to them."""
    smallest = min(candidate.worst_ratio for candidate in candidates)
    met = smallest <= 1
    limit = 1.0 if met else planning.near * smallest

    def order(candidate: ProposedRun) -> tuple[float, float]:
        return round(candidate.duration, 6), candidate.acceleration if met else candidate.worst_ratio

    best: dict[str, ProposedRun] = {}
    for candidate in sorted((c for c in candidates if c.worst_ratio <= limit), key=order):
        best.setdefault(candidate.kind, candidate)
    return list(best.values())


def _usable_channels(vehicle: Vehicle, channels: Sequence[str]) -> tuple[str, ...]:
    """The given channels or the default ones, in the order of `possible_channels`; a fit must be able to use them."""
    possible = possible_channels(vehicle, channels)
    if not channels:
        return tuple(name for name in possible if is_of(name, *GYROS))
    for name in channels:
        if name not in possible:
            raise SignalError(f"{name}: not a channel that a fit uses; choose from {', '.join(possible)}")
    if not any(is_of(name, *MOTION) for name in channels):
        unit = vehicle.units[0].name
        raise SignalError(f"yaw_rate.{unit}: not among the channels; a fit needs a yaw rate, add it")
    return tuple(name for name in possible if name in channels)


def default_targets(vehicle: Vehicle, settings: OneStage) -> dict[str, float]:
    """`DEFAULT_TARGET` by parameter; a VehicleError if each of these parameters is exact."""
    estimated = parameters.estimated_parameters(vehicle, settings)
    names = [name for name in parameters.stage_1_names(vehicle) if name in estimated]
    if not names:
        raise VehicleError(
            f"targets: every cornering stiffness and yaw inertia is exact; give a target ({setting('target')})"
        )
    return dict.fromkeys(names, DEFAULT_TARGET)


def _with_targets_estimated(vehicle: Vehicle, targets: Mapping[str, float], settings: OneStage) -> OneStage:
    """The settings with every parameter estimated that has a target."""
    for name, target in targets.items():
        if name in vehicle.parameters() and known_of(name, 1.0, settings, reported=True).exact:
            raise VehicleError(f"{name}: has a target but is exact; leave out the target, or the statement")
        if not isinstance(target, Real) or not 0 < target <= 1:
            raise VehicleError(
                f"{name}: expected a target sigma above 0, up to 1, got {target!r}; give a fraction of the value, such "
                "as 0.05 for 5 %"
            )
    estimated = parameters.estimated_parameters(vehicle, settings)
    missing = [name for name in targets if name not in estimated]
    if not missing:
        return settings
    known = [name for name in missing if vehicle.stated.get(name)]
    free = {name: "free" for name in missing if name not in known}
    _, settings = applied(vehicle, replace(settings, given={**settings.given, **free}))
    return replace(settings, reported=(*settings.reported, *known))


def _prepared_vehicle(vehicle: Vehicle, channels: Sequence[str], settings: OneStage) -> Vehicle:
    """The vehicle as a fit of the run uses it; only its first axle steers."""
    truck = vehicle.with_logged_steering(vehicle.steer_signals()[:1], vehicle.name)
    straight = steer_record(truck, 20.0, np.zeros(200), 100.0, "design")
    record = straight.with_signals({name: np.zeros(200) for name in channels})
    return prepare_dataset([record], truck, replace(settings, check=False)).vehicle


def _unmet_targets(
    predictor: InformationPredictor,
    best: ProposedRun,
    targets: Mapping[str, float],
    noise: Mapping[str, float],
    planning: DesignSettings,
) -> tuple[UnmetTarget, ...]:
    """The targets that the best run does not reach, with remedies."""
    missed = {name: target for name, target in targets.items() if best.sigma[name] > target}
    if not missed:
        return ()
    rate = planning.rate
    models = road_noise(predictor.setup.vehicle, best.speed, rate, noise, planning.roughness)
    run = predictor.steered_run(best.kind, best.speed, best.steer, rate, noise, models)
    lane_change = lane_change_information(predictor, speed=best.speed, rate=rate, noise=noise, noise_models=models)
    remedies = PredictedRemedies.of(predictor, [run], lane_change, estimated_knowable=False)
    unmet = []
    for name, target in missed.items():
        size = size_of(name, predictor.setup.vehicle.parameters()[name], predictor.prior_sigma(name))
        changes = remedies.best(name, best.sigma[name] * size, target=target * size, min_reduction=0.1, max_count=2)
        unmet.append(
            UnmetTarget(
                name=name,
                wanted=target,
                sigma=best.sigma[name],
                verdict=best.verdicts[name],
                remedies=tuple(replace(change, sigma=change.sigma / size) for change in changes),
            )
        )
    return tuple(unmet)
