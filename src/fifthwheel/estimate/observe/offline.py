"""States of a record: filtered, as they would be on-line, or smoothed with all samples."""

from collections import deque
from collections.abc import Iterator
from functools import partial
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from fifthwheel.base.errors import SignalError
from fifthwheel.base.types import Array
from fifthwheel.data.record import Record
from fifthwheel.estimate.filters import kalman
from fifthwheel.estimate.filters.model import packed_size
from fifthwheel.estimate.observe import monitor
from fifthwheel.estimate.observe.observer_model import ObserverModel
from fifthwheel.estimate.observe.observer_step import output_size
from fifthwheel.estimate.observe.parameter_variance import Sensitivities, SigmaPoints, sigma_point_variance
from fifthwheel.estimate.observe.states import States
from fifthwheel.estimate.observe.uncertainty import Uncertainty
from fifthwheel.estimate.stream import Status, StreamSegment, measurements, stream_segments, without_measurement
from fifthwheel.model.dynamics.unit_equations import BANK

CHUNK = 1_000
"""Number of rows in one pass; it bounds the memory for long records."""


def states(record: Record, observer: ObserverModel, uncertainty: Uncertainty | None, *, smooth: bool) -> States:
    """All states of a record, with all samples (`smooth`) or the past ones; see `Observer.batch`."""
    stream = observer.stream
    for name in (*(rule.name for rule in stream.inputs), *stream.measured):
        if name not in record.signals:
            raise SignalError(f"{name}: not in {record.name}; make an observer of the signals of this record")
    points = SigmaPoints.of(observer, _uncertain(record, observer, uncertainty, smooth=smooth))
    return _states(record, observer, *_outputs(record, observer, points, smooth=smooth))


class Outputs(NamedTuple):
    """Outputs of the compiled step at N samples, for n reported and m measured signals; NaN where there are none.

    The memory of a long record is that of these arrays: all else is computed in chunks of rows.
    """

    reported: Array  # (N, 2 n) values, sigmas
    innovation: Array  # (N, 2 m) innovations, variances
    nis: Array  # (N,)
    accepted: NDArray[np.bool_]  # (N, m)
    settling: NDArray[np.bool_]  # (N,)

    @classmethod
    def nothing(cls, count: int, n: int, m: int) -> Self:
        """Of N samples without an output; columns are in succession."""
        columns = np.full((count, 2 * (n + m) + 1), np.nan, order="F")
        flags = np.zeros((count, m + 1), dtype=bool, order="F")
        return cls(columns[:, : 2 * n], columns[:, 2 * n : -1], columns[:, -1], flags[:, :m], flags[:, m])

    def at(self, samples: slice) -> "Outputs":
        """Those of some samples, in the same memory."""
        columns = self.reported[samples], self.innovation[samples], self.nis[samples]
        return Outputs(*columns, self.accepted[samples], self.settling[samples])

    def write(self, filtered: Array) -> None:
        """Take the columns of the outputs of the step (N, n_output)."""
        edges = np.cumsum([part.shape[1] for part in (self.reported, self.innovation, self.accepted)])
        self.reported[:], self.innovation[:], accepted, findings = np.split(filtered, edges, axis=1)
        self.accepted[:], self.settling[:], self.nis[:] = accepted > 0, findings[:, 0] > 0, findings[:, 1]

    def add(self, variance: Array) -> None:
        """Add the variance (M, n) of what is uncertain to the sigmas of the reported signals at the first M samples."""
        sigmas = np.hsplit(self.reported, 2)[1][: len(variance)]
        excess, raised = monitor.excess(self.nis[: len(variance), None]), sigmas**2
        sigmas[:] = np.sqrt(_total_variance(raised / excess, raised, excess, variance))


def _outputs(
    record: Record, observer: ObserverModel, points: SigmaPoints, *, smooth: bool
) -> tuple[NDArray[np.int8], Outputs]:
    """Status (N,) and outputs of a record of N samples."""
    stream = observer.stream
    status, segments = stream_segments(record, stream, observer.step_limit)
    output = Outputs.nothing(len(record.time), len(observer.report.outputs), len(stream.measured))
    for segment in segments:
        within, settings = output.at(segment.samples), observer.settings
        for of_filter, start in filtered_parts(observer, segment, within, None if smooth else points):
            if not smooth:
                continue
            filtered = output.at(of_filter.samples)
            part = of_filter.with_accepted(filtered.accepted)  # smoother and sigma points use the same samples
            if is_finite(smoothed := smoothed_states(observer, part, start, filtered, points)):
                filtered.reported[:] = smoothed
                _, sigmas = np.hsplit(filtered.reported, 2)
                np.sqrt(sigmas, out=sigmas)  # of variances; a copy would need the memory of all states
            else:  # the smoother diverges: the states of the filter
                own = Outputs.nothing(len(within.nis), len(observer.report.outputs), len(stream.measured))
                deque(filtered_parts(observer, segment, own, points), maxlen=0)
                first = of_filter.samples.start - segment.samples.start
                filtered.reported[:] = own.reported[first : first + len(filtered.nis)]
            settled = np.flatnonzero(~filtered.settling)  # later samples have agreed with the first ones
            filtered.settling[: settled[0] if settled.size else 0] = False
        coasting = without_measurement(record.time[segment.samples], within.accepted, settings.coast)
        inconsistent = within.nis > settings.max_nis
        found = {Status.INCONSISTENT: inconsistent, Status.COASTING: coasting, Status.SETTLING: within.settling}
        status[segment.samples] = np.select(list(found.values()), list(found), Status.OK)
    return status, output


def is_finite(result: Array) -> bool:
    """Whether values and variances (N, 2 n) are finite and no variance is negative."""
    return bool(np.isfinite(result).all() and (np.hsplit(result, 2)[1] >= 0).all())


def smoothed_states(
    observer: ObserverModel, part: StreamSegment, start: Array, output: Outputs, points: SigmaPoints
) -> Array:
    """Values and variances (N, 2 n) of the reported signals given all N samples of a part.

    Its rows have weights only where the filter accepted the measurement; `start` is the carry before the first row,
    without the monitor, `output` that of the filter.
    """
    model = observer.model
    excess = monitor.excess(output.nis[:, None])
    start = start[: len(model.states) + packed_size(len(model.states))]
    run = partial(kalman.smoothed_chunks, model, observer.report, part.rows)
    result = np.empty(output.reported.shape)
    for rows, smoothed in run(start[None], observer.constant(gate=np.inf)[None]):
        samples, indices = part.samples_of(rows)
        result[samples] = smoothed[0, indices]
    _, own = np.hsplit(result, 2)
    if points.steps.size:
        effects = observer.effects(part.first)
        shape = len(part.rows), len(observer.report.outputs)
        lanes = kalman.smoother_step(model, observer.report).lanes
        variance = sigma_point_variance(points, effects, start, run, lanes, shape)
        for first in range(0, len(own), kalman.CHUNK):
            chunk = slice(first, first + kalman.CHUNK)
            added = variance[part.sample_indices[chunk]]
            own[chunk] = _total_variance(own[chunk], own[chunk] * excess[chunk], excess[chunk], added)
    else:
        own *= excess
    return result


def _total_variance(own: Array, raised: Array, excess: Array, variance: Array) -> Array:
    """Variance of signals of which `variance` is added to `own`, which innovations have `raised` by the excess."""
    total = np.maximum(own + variance, 0.0)
    # innovations may exceed their sigma because of what is uncertain: the larger variance contains both
    return np.maximum(total, np.where(total < own, excess * total, raised))  # less: the bank is known


def _uncertain(
    record: Record, observer: ObserverModel, uncertainty: Uncertainty | None, *, smooth: bool
) -> Uncertainty:
    """What is uncertain besides the state. The bank is part of it in the smoother; the filter considers it itself."""
    uncertain = Uncertainty(names=(), covariance=np.zeros((0, 0)))
    if uncertainty is not None:
        uncertain = observer.uncertain(uncertainty.of_log(record.name))
    considered = smooth and observer.settings.bank > 0 and not observer.model.estimates_bank
    if considered and BANK not in uncertain.names:
        return uncertain.with_independent(BANK, observer.settings.bank)
    return uncertain


def filtered_parts(
    observer: ObserverModel, segment: StreamSegment, output: Outputs, points: SigmaPoints | None
) -> Iterator[tuple[StreamSegment, Array]]:
    """The parts of a segment between restarts of the filter, each with [x, P] before its first row.

    The outputs of the filter at the N samples of the segment are written to `output`, those of a part before it is
    returned; what is uncertain by `points` is in their sigmas. As in `Observer.push`, the filter restarts at samples
    only; rows between the last sample of a part and the restart belong to no part, because the filter may have diverged
    there.
    """
    constant, size = observer.constant(), output_size(observer.model, observer.report)

    def begin(row: int, *, suspect: bool) -> tuple[Array, Sensitivities | None]:
        inputs, time = segment.inputs(row), float(segment.rows.time[row])
        start = observer.start(inputs, suspect=suspect)
        if points is None or not points.steps.size:
            return start, None
        return start, Sensitivities(observer, points, inputs, start[: len(observer.model.states)], time)

    start, sensitivities = begin(0, suspect=False)
    carry, first, row = np.append(start, monitor.START), 0, 0
    while row < len(segment.rows):
        chunk = slice(row, row + CHUNK)
        rows = segment.rows[chunk] if row > first else segment.part(first, chunk.stop).rows[:]
        carry, filtered = observer.scan(carry, rows, constant)
        samples, indices = segment.samples_of(chunk)
        here = output.at(samples)
        here.write(filtered[indices, -size:])
        restarts = indices[filtered[indices, -1] > 0]
        within = indices[indices < restarts[0]] if restarts.size else indices
        if sensitivities and within.size:
            stop = int(within[-1]) + 1 if restarts.size else len(rows)
            variance = sensitivities.variance(segment.rows.time[chunk][:stop], rows[:stop], filtered[:stop])
            here.add(variance[within])
        if not restarts.size:
            row = chunk.stop
            continue
        restart = int(restarts[0])
        row += restart
        before = segment.sample_indices[np.searchsorted(segment.sample_indices, row) - 1]
        yield segment.part(first, before + 1), start
        first, (start, sensitivities) = row, begin(row, suspect=True)
        carry = np.append(start, monitor.after_restart(filtered[restart, -2]))
    yield segment.part(first, len(segment.rows)), start


def _states(record: Record, observer: ObserverModel, status: NDArray[np.int8], output: Outputs) -> States:
    """States from the outputs of the compiled step, whose memory they take."""
    names, measured = observer.report.outputs, observer.model.outputs
    values, sigmas = np.hsplit(output.reported, 2)
    innovation, innovation_sigmas = np.hsplit(output.innovation, 2)
    np.sqrt(innovation_sigmas, out=innovation_sigmas)
    innovation[~np.isfinite(measurements(record, observer.stream.measured))] = np.nan
    return States(
        name=record.name,
        time=record.time,
        values={name: values[:, i] for i, name in enumerate(names)},
        sigma={name: sigmas[:, i] for i, name in enumerate(names)},
        status=status,
        nis=output.nis,
        innovation={name: innovation[:, i] for i, name in enumerate(measured)},
        innovation_sigma={name: innovation_sigmas[:, i] for i, name in enumerate(measured)},
        accepted={name: output.accepted[:, i] for i, name in enumerate(measured)},
    )
