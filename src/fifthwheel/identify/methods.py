"""Both methods behind one interface: the kind of settings says which."""

from collections.abc import Sequence

from fifthwheel.identify.one_stage import OneStageFit
from fifthwheel.identify.result import Identification
from fifthwheel.identify.settings import OneStage, TwoStage
from fifthwheel.identify.stage import Progress
from fifthwheel.identify.two_stage import TwoStageFit
from fifthwheel.logs import Record
from fifthwheel.vehicle import Vehicle


def identify(
    records: Sequence[Record],
    vehicle: Vehicle,
    settings: TwoStage | OneStage | None = None,
    *,
    validate: Sequence[Record] = (),
    progress: Progress = lambda *_: None,
) -> Identification:
    """Parameters of a vehicle from one or more logs of it, with sigma and verdict.

    Args:
        records: logs with speed, a steer angle, yaw rates and, for what the load weighs on, roll rates.
        vehicle: what is known of it; its values are where the search begins.
        settings: `OneStage()` (by default) seeks everything at once over whole records, `TwoStage()` in the two stages
            of the article's dual filter, `article()` as published.
        validate: logs that are only predicted.
        progress: called with a title, the number of passes or steps done and their most.

    Raises:
        SignalError: a log that cannot be used, with the signal and the cure.
        VehicleError: a held or free parameter that does not exist or cannot be estimated.
    """
    settings = settings or OneStage()
    if isinstance(settings, OneStage):
        return OneStageFit(records, vehicle, settings, validate, progress).run()
    return TwoStageFit(records, vehicle, settings, validate, progress).run()
