"""The learner of a vehicle for a control unit, which has no log yet."""

from collections.abc import Sequence
from dataclasses import replace

from fifthwheel.filters.relinearised import RelinearisationSettings
from fifthwheel.identify import Identification
from fifthwheel.identify.online import Learner, LearnerSettings
from fifthwheel.identify.settings import OneStage
from fifthwheel.vehicle import Vehicle
from fifthwheel.workflow.observer import available_signals, require_used


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
    stored = identification.settings if identification is not None else None
    settings = replace(stored if isinstance(stored, OneStage) else OneStage(), min_speed=min_speed)
    given = {"max_passes": passes, "samples": segment}
    relinearisation = RelinearisationSettings(**{name: value for name, value in given.items() if value is not None})
    available = available_signals(vehicle, signals, identification)
    learner = Learner(vehicle, available, settings, learner=LearnerSettings(relinearisation=relinearisation))
    problem = learner.live.problem
    require_used(signals, (*problem.inputs, *problem.outputs), f"a learner of {vehicle.name}")
    return learner
