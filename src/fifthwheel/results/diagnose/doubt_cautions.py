"""Cautions on what logs contradict: earlier logs, the identified truck, the vehicle file, assumptions on sensors."""

import math
from collections.abc import Iterator, Sequence

import numpy as np

from fifthwheel.base.formatting import digits, enumerated, percent, with_sigma
from fifthwheel.base.names import ParameterPath, split_log
from fifthwheel.base.spelling import setting
from fifthwheel.data.channels import SensorErrorName
from fifthwheel.estimate.identify import Identification, Verdict
from fifthwheel.estimate.identify.doubts import Cause, DoubtKind
from fifthwheel.estimate.identify.knowledge.history import changes_in_words
from fifthwheel.estimate.identify.knowledge.information import LogKnowledge
from fifthwheel.estimate.identify.knowledge.knowledge import UNSURE
from fifthwheel.model.dynamics import TIME_SCALE, critical_speed
from fifthwheel.results.diagnose import messages
from fifthwheel.results.diagnose.messages import Caution, sensor_error_words
from fifthwheel.truck import Vehicle, unit_of
from fifthwheel.truck.quantities import MASS_SCALE, STIFFNESS_SENSITIVITY, quantity_of
from fifthwheel.truck.spoken_names import FIRST_UNITS, named_unit

NEARLY = 1.05
"""A truck that is unstable above less than so many times the highest speed of the logs is nearly unstable there."""
LARGE_CHANGE = 0.5
"""A larger relative change is shown as a factor."""
INSENSITIVE = 0.7
"""Tyres that lack more of the usual load sensitivity are not real: four measured ones have half of it or more."""


def contradiction_cautions(identification: Identification) -> Iterator[Caution]:
    """Logs that differ from the information of earlier logs."""
    for log, changes in _contradicting(identification):
        row = messages.LOG_DIFFERS if changes else messages.LOG_SET_ASIDE
        yield row.of(log=log.name, parameters=log.changed, changes=changes, reason=log.set_aside)


def validation_cautions(validated: Sequence[Identification]) -> Iterator[Caution]:
    """Validation logs that contradict the identified truck; each was identified with the knowledge of its logs."""
    for result in validated:
        for log, changes in _contradicting(result):
            what = changes or "no single change of tyres, load or sensor explains the difference"
            yield messages.VALIDATION_CONTRADICTS.of(log=log.name, parameters=log.changed, changes=what)


def _contradicting(identification: Identification) -> Iterator[tuple[LogKnowledge, str]]:
    """Its logs that contradict those before, each with what changed in words; empty if that explains nothing."""
    own = {log.name for log in identification.logs}
    for log in identification.knowledge.logs if identification.knowledge else ():
        if log.name in own and log.set_aside not in ("", UNSURE):  # the verdicts show the latter
            yield log, ""
        elif log.name in own and log.changed:
            yield log, enumerated([*changes_in_words(log)] or log.changed)


def assumption_cautions(identification: Identification) -> Iterator[Caution]:
    """Numbers of the vehicle file and assumptions on the sensors that the residuals contradict, or all of them."""
    logs = [log.name for log in identification.logs]
    for doubt in identification.doubts:
        if doubt.kind is DoubtKind.NOISE:
            yield messages.NOTHING_EXPLAINS.of(doubt.statistic, parameters=doubt.parameters)
        if doubt.kind is not DoubtKind.ASSUMPTION:
            continue
        texts = [describe_cause(cause, identification.initial_vehicle, logs) for cause in doubt.causes]
        one = len(texts) == 1
        options = _options(doubt.causes[0], identification.initial_vehicle)
        uncertain = " If you cannot measure it, state how uncertain it is, so that it is estimated: "
        yield messages.WRONG_ASSUMPTION.of(
            doubt.statistic,
            parameters=doubt.parameters,
            signals=tuple(error.signal for c in doubt.causes if (error := SensorErrorName.of(split_log(c.name)[0]))),
            cause=f"They imply that {texts[0]}" if one else f"One of these is the likely cause: {'; '.join(texts)}",
            these="this" if one else "them",
            options=f"{uncertain}{options}." if options else "",
        )


def _options(cause: Cause, vehicle: Vehicle) -> str:
    """The options that make lengths of the vehicle file as uncertain as the logs imply; empty for other causes."""
    values = vehicle.parameters()
    moved = {p: d for p, d in cause.changes.items() if p in values and quantity_of(p).is_position}
    if not moved or moved.keys() != cause.changes.keys() & values.keys():
        return ""
    sigma = 10 * math.ceil(10 * max(map(abs, moved.values())))
    wheelbases = vehicle.moved_by_wheelbase().items()  # with one of them, the CoG by a weighbridge moves too
    names = [name for name, axles in wheelbases if moved.keys() == {*axles}] or list(moved)
    return setting("statements", *(f"{name}=+- {sigma} cm" for name in names))


def unstable_cautions(identification: Identification) -> Iterator[Caution]:
    """The truck of the vehicle file or the identified one, where it is unstable at the speed of the logs."""
    speeds = [log.speed[1] for log in identification.logs if np.isfinite(log.speed[1])]
    highest = max(speeds, default=0.0)
    vehicle, name = identification.initial_vehicle, "The truck of the vehicle file"
    if any(e.verdict in (Verdict.CONVERGED, Verdict.DOUBTFUL) for e in identification.parameters):
        vehicle, name = identification.vehicle, "The identified truck"
    critical = critical_speed(vehicle, highest=NEARLY * highest) if highest > 0 else None
    if critical is not None:
        free = [f"{c.name}.yaw_damping" for c in vehicle.couplings_with_damper() if not c.yaw_damping]
        damper = f"Give it {enumerated(free)}: the joints of buses and caravans have a damper. " if free else ""
        yield messages.UNSTABLE.of(critical, truck=name, critical=3.6 * critical, highest=3.6 * highest, damper=damper)


def _describe_sensor_error(error: SensorErrorName, change: float, mean: float | None) -> str:
    """What an error of a sensor is, with its prior mean: "yaw_rate.tractor is 52 ms late"."""
    value = change + (float(error.kind == "gain") if mean is None else mean)
    unit = error.unit or ""
    return sensor_error_words(error.signal, error.kind).cause.format(
        signal=error.signal,
        kind=error.kind.replace("_", " "),
        value=with_sigma(value, None, unit),
        size=with_sigma(abs(value), None, unit),
        late="late" if value > 0 else "early",
        factor=digits(value, 3),
        difference=with_sigma(abs(change), None, unit),
        larger="larger" if change > 0 else "smaller",
    )


def _relative_change(change: float, compared: str = "", reference: str = "its prior value") -> str:
    """A relative change: "12 % larger" than what is compared; if it is large, "0.40 times" the reference."""
    if abs(change) > LARGE_CHANGE:
        return f"{digits(1 + change, 2)} times {reference}"
    return f"{percent(abs(change))} {'larger' if change > 0 else 'smaller'}{compared}"


def describe_cause(cause: Cause, vehicle: Vehicle, logs: Sequence[str] = ()) -> str:
    """What is different: "yaw_rate.tractor is 52 ms late (5 times the assumed uncertainty)"; `logs` are names."""
    values = vehicle.parameters()
    _, log = split_log(cause.name)
    times = f"{abs(cause.prior_sigmas):.1f} times the assumed uncertainty"
    own = {path: change for path, change in cause.changes.items() if path in values}  # loads of tyres follow from them
    (path, change), *others = (own or cause.changes).items()
    error, parsed = SensorErrorName.of(path), ParameterPath.of(path)
    if path == TIME_SCALE:
        return f"the time base runs {percent(abs(change))} too {'slow' if change > 0 else 'fast'} (timestamps)"
    if cause.name == MASS_SCALE:
        return f"all masses are {_relative_change(change / values[path])} ({times})"
    if error:
        where = "" if log is None else f" in {logs[int(log)]}"
        return f"{_describe_sensor_error(error, change, cause.prior_mean)}{where} ({times})"
    if parsed.quantity == "softening":
        saturating = setting("tyres", "saturating")
        return f"the tyres of {parsed.owner} soften more with the slip angle: use {saturating} ({times})"
    if parsed.quantity == "self_steering" and not values.get(path):
        size = f"self_steering = {min(change, 1.0):.1f}"
        return f"{parsed.owner} steers itself, as a castor axle does: give it {size} in the vehicle file ({times})"
    if parsed.quantity == "yaw_damping" and not values.get(path):
        size = with_sigma(change, None, unit_of(path))
        return f'{parsed.owner} is not free in yaw: give it yaw_damping = "{size}" in the vehicle file ({times})'
    if ParameterPath.of(cause.name).quantity == "axle_positions":
        largest = max(map(abs, own.values()))
        side = "closer to" if change > 0 else "further from"
        origin = "front axle" if parsed.unit in FIRST_UNITS else "front coupling"
        size = f"up to {digits(largest, 2)} m {side} its {origin}"
        return f"the axles of the {named_unit(parsed.unit)} are {size} ({times})"
    value = values.get(path) if cause.prior_mean is None else cause.prior_mean
    if value is None:
        return f"{cause.name} is different ({times})"
    if path == STIFFNESS_SENSITIVITY and change < -INSENSITIVE * value:
        what = "the stiffness of the tyres hardly depends on their load"
        return f"{what}, as in simulations with linear tyres: there use {setting('tyres', 'linear')} ({times})"
    if quantity_of(path).is_position or not value:
        side = "front" if change > 0 else "rear"
        size = f"{digits(abs(change), 2)} {unit_of(path)} further to the {side}"
    else:
        size = _relative_change(change / value)
    if log is not None:  # its variation from log to log
        where, together = f"in {logs[int(log)]}", "all logs together"
        size = _relative_change(change / value, f" {where} than in {together}", f"that of {together}, {where}")
        return f"{path} is {size} ({times})"
    also = f" with {len(others)} other numbers that belong to it" if others else ""
    return f"{path} is {size}{also} ({times})"
