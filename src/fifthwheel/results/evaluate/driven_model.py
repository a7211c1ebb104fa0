"""The results of a model that is driven with the inputs of a log: of an FMU, or of the nonlinear truck."""

import contextlib
import io
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fifthwheel.base.arguments import expect
from fifthwheel.base.errors import FifthwheelError, SignalError, UnitError, printable
from fifthwheel.base.formatting import enumerated
from fifthwheel.base.input_files import require_regular
from fifthwheel.base.lazy import require
from fifthwheel.base.types import Array
from fifthwheel.base.units import factor
from fifthwheel.data.channels import SPEED, STEER, is_of, si_unit
from fifthwheel.data.record import Record
from fifthwheel.results.evaluate.motion import EVALUATED, first_steer
from fifthwheel.results.export.fmu.models import MEASURED

if TYPE_CHECKING:
    from fifthwheel.truck import Vehicle

APPROACH = 5.0
"""Time before the log in which steer angles rise from 0 to their first value, s."""
LONGEST_STEP = 0.005
"""Of the communication with an FMU, s."""
RESULTS = (SPEED, *EVALUATED)
"""Quantities that count of a model."""


def fmu_results(path: str | Path, log: Record) -> Record:
    """Run an FMU (1.0 to 3.0) with the inputs of a log, and give its outputs as a record with the times of the log.

    The names of its variables are those of signals; their units are those that it declares, else SI. Of its outputs
    those count that a test method evaluates. During a step of communication an input has the value that the log,
    interpolated, has in the middle of the step.

    Args:
        path: of the FMU; its machine code is run.
        log: one run without a pause.

    Raises:
        FifthwheelError: FMPy is not installed, or the FMU cannot be read or run.
        SignalError: the FMU has no input for a steer angle of the log, no output that is a signal, a unit that does
            not fit, or is an observer.
    """
    fmpy = require("fmpy", "fmu")
    expect("log", log, Record)
    name = Path(path).name
    require_regular(Path(path))
    with _refused(path, "read"):
        description = fmpy.read_model_description(str(path), validate=False)
    variables = {v.name: v for v in description.modelVariables}
    inputs = [v.name for v in description.modelVariables if v.causality == "input"]
    known = [n for n in inputs if n in log.signals]
    _check_inputs(name, inputs, log)
    every = [v.name for v in description.modelVariables if v.causality == "output"]
    outputs = [n for n in every if is_of(n, *RESULTS)]
    if not outputs:
        names = ", ".join(f"{channel.quantity}.<unit>" for channel in EVALUATED)
        raise SignalError(
            f"{name}: expected an output with the name of a signal ({names}), got {', '.join(every) or 'none'}; rename "
            "its outputs, or run it in its tool and give the results with a signal map of their own"
        )
    units = {n: _factor(name, variables[n]) for n in (*known, *outputs)}
    time = _times(log)
    step = 1 / log.rate / np.ceil(1 / log.rate / LONGEST_STEP)
    columns = [time - step / 2, *(_before(log, n) / units[n] for n in known)]
    table = np.rec.fromarrays(columns, dtype=[(n, float) for n in ("time", *known)])
    with _refused(path, "run"):
        found = fmpy.simulate_fmu(
            str(path), validate=False, stop_time=time[-1], output_interval=step, input=table, output=outputs
        )
    at = log.time - log.time[0] + APPROACH
    signals = {n: np.interp(at, found["time"], found[n]) * units[n] for n in outputs}
    apart = {
        "inputs that are not in the log keep their start value": [n for n in inputs if n not in log.signals],
        "outputs that are not evaluated": [n for n in every if n not in outputs],
    }
    notes = tuple(f"{name}: {what}: {enumerated(names)}." for what, names in apart.items() if names)
    driven = {n: log.input(n) for n in known}
    return Record(time=log.time, signals=signals | driven, name=Path(path).stem, notes=notes)


def plant_results(vehicle: "Vehicle", log: Record) -> Record:
    """Drive the nonlinear truck with the first steer angle and the speed of a log; its true signals at the log's times.

    Raises:
        FifthwheelError: MuJoCo is not installed.
        SignalError: the log lacks an input, or the truck rolls over, jackknifes or stops.
    """
    from fifthwheel.model.manoeuvres import OpenLoop
    from fifthwheel.model.plant import Plant  # slow to import

    expect("log", log, Record)
    steer, grid = first_steer(log, vehicle), np.arange(0.0, _times(log)[-1], 0.01)
    angle, speed = (np.interp(grid, _times(log), _before(log, n)) for n in (steer, "speed"))
    run = Plant(vehicle).drive(OpenLoop(time=grid, steer=angle, speed=speed, name="nonlinear truck"))
    at = log.time - log.time[0] + APPROACH
    signals = {n: np.interp(at, run.time, v) for n, v in run.truth.items() if is_of(n, *RESULTS) or n == steer}
    return Record(time=log.time, signals=signals, name="nonlinear truck")


def _check_inputs(name: str, inputs: list[str], log: Record) -> None:
    if measured := [n for n in inputs if n.startswith(MEASURED)]:
        raise SignalError(f"{name}: {measured[0]} is an input of an observer; export the truck")
    steers = [n for n in log.signals if is_of(n, STEER)]
    if not set(steers) & set(inputs):
        raise SignalError(
            f"{name}: no input {' or '.join(steers) or 'steer.<unit>.<axle>'}, the steer angle of {log.name}; it has "
            f"{', '.join(inputs) or 'no inputs'}; rename the input of the FMU, or map the steer angle of the log to it"
        )


def _factor(name: str, variable: Any) -> float:
    try:
        return factor(variable.unit, si_unit(variable.name) or "1") if variable.unit else 1.0
    except UnitError as error:
        raise SignalError(f"{name}: {variable.name}: unit {variable.unit}: {error}; change it in the FMU") from None


def _times(log: Record) -> Array:
    """The times of a log behind the approach, from 0 (N + 1,)."""
    return np.append(0.0, log.time - log.time[0] + APPROACH)


def _before(log: Record, name: str) -> Array:
    """An input at the times of `_times`: a steer angle is 0 at first."""
    values = log.input(name)
    return np.append(0.0 if is_of(name, STEER) else values[0], values)


@contextlib.contextmanager
def _refused(path: str | Path, what: str) -> Iterator[None]:
    """An error for whatever fails in FMPy or in an FMU, whose messages FMPy prints."""
    printed = io.StringIO()
    try:
        with contextlib.redirect_stdout(printed):
            yield
    except Exception as error:
        reason = " ".join(f"{error} {printed.getvalue()}".split())
        message = f"{path}: cannot be {what} ({printable(reason)}); check it by fmpy validate {path}"
        raise FifthwheelError(message) from error
