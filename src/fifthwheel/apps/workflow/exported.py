"""Observer and learner of a vehicle for a control unit, which has no log yet."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from fifthwheel.base.errors import SignalError, VehicleError, suggestion
from fifthwheel.estimate.filters.relinearised import RelinearisationSettings
from fifthwheel.estimate.identify import Identification
from fifthwheel.estimate.identify.settings import OneStage
from fifthwheel.estimate.observe import Observer, ObserverSettings
from fifthwheel.estimate.online import Learner, LearnerSettings
from fifthwheel.truck import Vehicle


def exported_observer(
    vehicle: Vehicle,
    signals: Sequence[str] | None = None,
    identification: Identification | None = None,
    *,
    min_speed: float = 5.0,
    estimate_bank: bool = False,
    friction: float | None = None,
    half_track: float = ObserverSettings.half_track,
) -> Observer:
    """The observer that `fifthwheel export` writes.

    Args:
        vehicle: with its numbers.
        signals: that the control unit has; by default those of the identification, without one the speed, every steer
            angle of the vehicle, and the yaw rate and the roll rate of every unit.
        identification: for the sensor errors that its logs share, and the noise. Offsets that belong to one log are
            not used.
        min_speed, estimate_bank, friction, half_track: see `ObserverSettings`.

    Raises:
        SignalError: the signals are not sufficient, or an observer of the vehicle does not use one of them.
        VehicleError: no axle of the vehicle is steerable, or the identification is of another vehicle.
    """
    available = _available_signals(vehicle, signals, identification)
    changes: dict[str, Any] = {"min_speed": min_speed, "estimate_bank": estimate_bank, "half_track": half_track}
    changes |= {} if friction is None else {"friction": friction}  # otherwise that of the identification
    settings = identification.observer_settings(**changes) if identification else ObserverSettings(**changes)
    observer = Observer(vehicle, available, settings)
    _require_used(signals, (*observer.inputs, *observer.outputs), f"an observer of {vehicle.name}")
    return observer


def exported_learner(
    vehicle: Vehicle,
    signals: Sequence[str] | None = None,
    identification: Identification | None = None,
    *,
    min_speed: float = 5.0,
    passes: int | None = None,
    segment: int | None = None,
) -> Learner:
    """The learner that `fifthwheel export` writes.

    Args:
        vehicle: its numbers are the prior means.
        signals: that the control unit has; default as in `exported_observer`.
        identification: for signals and settings: what is estimated, considered and fixed, priors and noise. Settings of
            two stages have no effect.
        min_speed: nothing is estimated below it, m/s.
        passes, segment: `max_passes` and `samples` of `RelinearisationSettings`; None for their defaults.

    Raises:
        SignalError: the signals are not sufficient, or a learner of the vehicle does not use one of them.
        VehicleError: no axle of the vehicle is steerable, or the identification is of another vehicle.
    """
    stored = identification.settings.one_stage if identification is not None else None
    settings = replace(stored or OneStage(tyres="linear"), min_speed=min_speed)
    given = {"max_passes": passes, "samples": segment}
    relinearisation = RelinearisationSettings(**{name: value for name, value in given.items() if value is not None})
    available = _available_signals(vehicle, signals, identification)
    learner = Learner(vehicle, available, settings, learner=LearnerSettings(relinearisation=relinearisation))
    setup = learner.live.setup
    _require_used(signals, (*setup.inputs, *setup.outputs), f"a learner of {vehicle.name}")
    return learner


def _available_signals(
    vehicle: Vehicle, signals: Sequence[str] | None, identification: Identification | None
) -> Sequence[str]:
    """The signals of a control unit; a VehicleError if the identification is of another vehicle."""
    if identification is not None and identification.vehicle.parameters().keys() != vehicle.parameters().keys():
        raise VehicleError(
            f"{vehicle.name}: its units or axles are not those of the identification, which is of "
            f"{identification.vehicle.name}; give the vehicle.toml of the same result"
        )
    rates = [f"{quantity}.{unit.name}" for quantity in ("yaw_rate", "roll_rate") for unit in vehicle.units]
    default = identification.signals if identification is not None else ("speed", *vehicle.steer_signals(), *rates)
    return signals or default


def _require_used(signals: Sequence[str] | None, known: Sequence[str], estimator: str) -> None:
    """A SignalError if a given signal is not among those that an estimator uses."""
    for name in signals or ():
        if name not in known:
            raise SignalError(f"{name}: no signal that {estimator} uses; {suggestion(name, known)}")
