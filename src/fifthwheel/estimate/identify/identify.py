"""Identification of a vehicle: all methods behind one function, chosen by the kind of settings."""

from collections.abc import Sequence
from typing import Any

from threadpoolctl import threadpool_limits

from fifthwheel.base.arguments import expect, expect_each, expect_optional
from fifthwheel.base.errors import SignalError
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify.knowledge.information import Occasion
from fifthwheel.estimate.identify.knowledge.knowledge import Knowledge
from fifthwheel.estimate.identify.result.identification import Identification
from fifthwheel.estimate.identify.settings import CommonSettings, OneStage, Progress, imported
from fifthwheel.truck import Vehicle


def identify(
    records: Sequence[Record],
    vehicle: Vehicle,
    settings: CommonSettings | None = None,
    *,
    knowledge: Knowledge | None = None,
    occasion: Occasion | None = None,
    validate: Sequence[Record] = (),
    progress: Progress = lambda *_: None,
) -> Identification:
    """Parameters of a vehicle from one or more logs of it, with sigma and verdict.

    Args:
        records: logs with speed, a steer angle, a yaw rate or articulation angle of every unit and, for the payload
            height, the roll rate of the laden unit.
        vehicle: as known before; its values are the initial values.
        settings: `OneStage()` (default) estimates all unknowns together, `TwoStage()` in the two stages of the
            article's dual filter, `article()` as published. One stage models yaw and roll, with `roll=False` yaw only;
            two stages model roll if a roll rate is logged. `Identification.models_roll` says which it was.
        knowledge: the information of earlier logs of this truck, such as `Identification.knowledge`; one stage only.
        occasion: trailer, load and date of the logs. What belongs to another trailer or load is not taken over.
        validate: logs that are only predicted.
        progress: called with a title, the number of passes or steps done and the largest number; see
            `fifthwheel.progress_bar`.

    Raises:
        SignalError: a log cannot be used; the message names the signal and the remedy.
        VehicleError: `vehicle` is not one, or a statement of the settings cannot be used.

    Example:
        >>> import fifthwheel as fw
        >>> truck = fw.vehicle("cheng_cebon_2011")
        >>> record = fw.simulate(truck, count=1)
        >>> guess = truck.replace({"tractor.front.cornering_stiffness": 4.0e5})
        >>> settings = fw.OneStage(given={"*": "exact", "tractor.front.cornering_stiffness": "free"}, tyres="linear")
        >>> result = fw.identify([record], guess, settings)
        >>> front = result["tractor.front.cornering_stiffness"]
        >>> abs(front.value - 475e3) < 3 * front.sigma
        True
    """
    expect_each("records", records, Record)
    expect_each("validate", validate, Record)
    expect("vehicle", vehicle, Vehicle)
    expect_optional("settings", settings, CommonSettings)
    expect_optional("knowledge", knowledge, Knowledge)
    expect_optional("occasion", occasion, Occasion)
    settings = settings or OneStage()
    of_truck: dict[str, Any] = {"knowledge": knowledge, "occasion": occasion}
    of_truck = {name: value for name, value in of_truck.items() if value is not None}
    if of_truck and settings.one_stage is None:
        raise SignalError(f"{next(iter(of_truck))}: only one stage begins with what is known; give OneStage(), or none")
    method = imported(settings.implementation)
    with threadpool_limits(limits=1, user_api="blas"):  # threads of BLAS only spin on matrices as thin as these
        identified: Identification = method(
            records, vehicle, settings, validate=validate, progress=progress, **of_truck
        )
    return identified
