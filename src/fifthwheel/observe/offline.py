"""States of a whole record: filtered as they would have been on the way, or smoothed by all that came later."""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from fifthwheel.dynamics import steps
from fifthwheel.errors import SignalError
from fifthwheel.logs import Record
from fifthwheel.observe.known import Known
from fifthwheel.observe.passes import filtered, smoothed
from fifthwheel.observe.states import States, Status
from fifthwheel.observe.step import step
from fifthwheel.observe.stretches import Stretch, stretches, without_news
from fifthwheel.observe.uncertainty import Pair, Uncertainty

Array = NDArray[np.float64]
Run = Callable[[Array, Array], Array]
"""(carry (B, n), constant (B, n)) -> what is told of B trucks on the M rows of a stretch, and variances (B, M, 2 n)."""


def states(
    record: Record, known: Known, limit: steps.StepLimit, uncertainty: Uncertainty | None, *, smooth: bool
) -> States:
    """All states of a record.

    Raises:
        SignalError: the record has not the signals that the observer was made for, or something is uncertain that the
            truck and its sensors do not have.
    """
    model, scan = known.model, step(known.model, known.report)
    for name in (*model.inputs, *model.outputs):
        if name not in record.signals:
            raise SignalError(f"{name}: not in {record.name}; make an observer of the signals that it has")
    others = None if uncertainty is None else Others(known, known.pairs(uncertainty.of_log(record.name)))
    status, parts = stretches(record, model, known.settings, limit)
    n, m = len(known.report.outputs), len(model.outputs)
    output = np.full((len(record.time), scan.n_output), np.nan)
    constant, ungated = known.constant(), known.constant(gate=np.inf)
    for part in parts:
        start, at = known.start(part.first), part.samples
        _, found = scan(start, part.rows, constant)
        output[at] = found[part.places]
        silent = without_news(record.time[at], output[at, -m:], known.settings.coast)
        status[at] = np.where(silent, Status.COASTING, Status.OK)
        rows = part.rows.copy()
        rows[:, -m:] = found[:, -m:]  # what was used is used by the smoother, and by every other truck
        run = partial(smoothed if smooth else filtered, model, known.report, rows)
        if smooth:
            output[at, : 2 * n] = run(start[None], ungated[None])[0, part.places]
        output[at, n : 2 * n] = np.maximum(output[at, n : 2 * n], 0.0)
        if others is not None:
            output[at, n : 2 * n] += others.variance(part, start, run)
    return _told(record, known, output, status)


class Others:
    """The trucks on either side of the known one.

    They start where the known one does: P0 is wide enough for all of them, and the steady state that a truck close to
    its critical speed would start in says more of the critical speed than of the start.
    """

    def __init__(self, known: Known, pairs: Sequence[Pair]) -> None:
        self._constants = np.array(
            [known.constant(values, gate=np.inf) for p in pairs for values in (p.ahead, p.behind)]
        )
        self._parts = np.array([pair.part for pair in pairs])
        self._together = step(known.model, known.report).lanes
        self._reported = len(known.report.outputs)

    def variance(self, stretch: Stretch, start: Array, run: Run) -> Array:
        """Of what is told over the parameters, (N, n); as many trucks at a time as share a register."""
        total = np.zeros((len(stretch.places), self._reported))
        for first in range(0, len(self._constants), self._together):
            some = self._constants[first : first + self._together]
            told = run(np.tile(start, (len(some), 1)), some)[:, stretch.places, : self._reported]
            parts = self._parts[first // 2 : (first + self._together) // 2, None, None]
            total += (((told[::2] - told[1::2]) / (2 * parts)) ** 2).sum(axis=0)
        return total


def _told(record: Record, known: Known, output: Array, status: NDArray[np.int8]) -> States:
    """Columns [reported, their variances, innovation, variance, accepted] by name."""
    names, measured = known.report.outputs, known.model.outputs
    n, m = len(names), len(measured)
    values, spread, innovation, variance, accepted = np.split(output, np.cumsum([n, n, m, m]), axis=1)
    sigma = np.sqrt(spread)
    seen = np.column_stack([np.isfinite(record.signals[name]) for name in measured])
    innovation = np.where(seen, innovation, np.nan)
    return States(
        name=record.name,
        time=record.time,
        values={name: values[:, i] for i, name in enumerate(names)},
        sigma={name: sigma[:, i] for i, name in enumerate(names)},
        status=status,
        innovation={name: innovation[:, i] for i, name in enumerate(measured)},
        innovation_sigma={name: np.sqrt(variance[:, i]) for i, name in enumerate(measured)},
        accepted={name: accepted[:, i] > 0 for i, name in enumerate(measured)},
    )
