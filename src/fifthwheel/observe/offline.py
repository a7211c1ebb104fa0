"""States of a record: filtered, as they would be on-line, or smoothed with all samples."""

from collections.abc import Iterator
from functools import partial

import numpy as np
from numpy.typing import NDArray

from fifthwheel._types import Array
from fifthwheel.dynamics.chain import BANK
from fifthwheel.errors import SignalError
from fifthwheel.filters import smoother
from fifthwheel.filters.model import packed_size
from fifthwheel.observe import monitor
from fifthwheel.observe.observer_model import ObserverModel
from fifthwheel.observe.parameter_variance import SigmaPoints, parameter_variance, sigma_point_variance
from fifthwheel.observe.states import States
from fifthwheel.observe.uncertainty import Uncertainty
from fifthwheel.record import Record
from fifthwheel.stream import Status, StreamSegment, measurements, stream_segments, without_measurement


def states(record: Record, observer: ObserverModel, uncertainty: Uncertainty | None, *, smooth: bool) -> States:
    """All states of a record, with all samples (`smooth`) or the past ones; see `Observer.batch`."""
    stream = observer.stream
    for name in (*(rule.name for rule in stream.inputs), *stream.measured):
        if name not in record.signals:
            raise SignalError(f"{name}: not in {record.name}; make an observer of the signals of this record")
    points = SigmaPoints.of(observer, _uncertain(record, observer, uncertainty, smooth=smooth))
    status, segments = stream_segments(record, stream, observer.step_limit)
    n, m = len(observer.report.outputs), len(stream.measured)
    output = np.full((len(record.time), observer.scan.n_output), np.nan)
    accepted = slice(2 * (n + m), 2 * (n + m) + m)
    for segment in segments:
        for part, start, filtered in filtered_parts(observer, segment):
            samples, rows = part.samples, part.rows
            output[samples] = filtered[part.sample_indices]
            rows[:, -m:] = filtered[:, accepted]  # smoother and sigma points use the samples that the filter accepted
            reported = partial(reported_states, observer, part, start, output[samples], points)
            if smooth and is_finite(result := reported(smooth=True)):
                output[samples, : 2 * n] = result
            elif smooth or points.steps.size:  # the states of the filter remain where the smoother diverges
                output[samples, : 2 * n] = reported(smooth=False)
            if smooth:  # later samples have agreed with the first ones
                settling = output[samples, -3]
                settled = np.flatnonzero(settling == 0)
                settling[: settled[0] if settled.size else 0] = 0.0
            del part, filtered, rows, reported  # the memory of a long record
        within, settings = output[segment.samples], observer.settings
        coasting = without_measurement(record.time[segment.samples], within[:, accepted], settings.coast)
        inconsistent = within[:, -2] > settings.max_nis
        found = {Status.INCONSISTENT: inconsistent, Status.COASTING: coasting, Status.SETTLING: within[:, -3] > 0}
        status[segment.samples] = np.select(list(found.values()), list(found), Status.OK)
    return _states(record, observer, output, status)


def is_finite(result: Array) -> bool:
    """Whether values and variances (N, 2 n) are finite and no variance is negative."""
    return bool(np.isfinite(result).all() and (np.hsplit(result, 2)[1] >= 0).all())


def reported_states(
    observer: ObserverModel, part: StreamSegment, start: Array, output: Array, points: SigmaPoints, *, smooth: bool
) -> Array:
    """Values and variances (N, 2 n) of the reported signals for the N samples of a part.

    Its rows have weights only where the filter accepted the measurement; `start` is the carry before the first row,
    without the monitor, `output` that of the filter (N, n_output).
    """
    model, n = observer.model, len(observer.report.outputs)
    excess = monitor.excess(output[:, -2:-1])
    values, raised = output[:, :n], output[:, n : 2 * n]
    own = raised / excess
    run = partial(smoother.smoothed_rows, model, observer.report, part.rows)
    if smooth:
        start = start[: len(model.states) + packed_size(len(model.states))]
        values, own = np.hsplit(run(start[None], observer.constant(gate=np.inf)[None])[0, part.sample_indices], 2)
        raised = own * excess
    if not points.steps.size:
        return np.hstack([values, raised])
    effects = observer.effects(part.first)
    if smooth:
        variance = sigma_point_variance(points, effects, start, run, observer.scan.lanes)
    else:
        variance = parameter_variance(observer, points, effects, start, part.rows)
    total = np.maximum(own + variance[part.sample_indices], 0.0)
    # innovations may exceed their sigma because of what is uncertain: the larger variance contains both
    raised = np.where(total < own, excess * total, raised)  # less: the bank is known
    return np.hstack([values, np.maximum(total, raised)])


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


def filtered_parts(observer: ObserverModel, segment: StreamSegment) -> Iterator[tuple[StreamSegment, Array, Array]]:
    """The parts of a segment between restarts of the filter, each with [x, P] before its first row, and its outputs.

    The rows of a part are its own. As in `Observer.push`, the filter restarts at samples only; rows between the last
    sample of a part and the restart belong to no part, because the filter may have diverged there.
    """
    constant, start = observer.constant(), observer.start(segment.first)
    carry, first, row = np.append(start, monitor.START), 0, 0
    outputs, samples = np.empty((len(segment.rows), observer.scan.n_output)), segment.sample_indices
    is_sample = np.zeros(len(segment.rows), dtype=bool)
    is_sample[samples] = True
    while row < len(segment.rows):
        end = row + smoother.CHUNK
        rows = segment.rows[row:end] if row > first else segment.part(first, end).rows
        carry, output = observer.scan(carry, rows, constant)
        restarts = np.flatnonzero((output[:, -1] > 0) & is_sample[row:end])
        outputs[row:end] = output
        if not restarts.size:
            row = end
            continue
        restart = int(restarts[0])
        row += restart
        end = samples[np.searchsorted(samples, row) - 1] + 1
        yield segment.part(first, end), start, outputs[first:end]
        first, start = row, observer.start(segment.inputs(row), suspect=True)
        carry = np.append(start, monitor.after_restart(output[restart, -2]))
    yield segment.part(first, row), start, outputs[first:]


def _states(record: Record, observer: ObserverModel, output: Array, status: NDArray[np.int8]) -> States:
    """States from the columns of the compiled step's output."""
    names, measured = observer.report.outputs, observer.model.outputs
    n, m = len(names), len(measured)
    columns = np.split(output, np.cumsum([n, n, m, m, m]), axis=1)
    values, variances, innovation, innovation_variance, accepted, findings = columns
    sigma = np.sqrt(variances)
    innovation = np.where(np.isfinite(measurements(record, observer.stream.measured)), innovation, np.nan)
    return States(
        name=record.name,
        time=record.time,
        values={name: values[:, i] for i, name in enumerate(names)},
        sigma={name: sigma[:, i] for i, name in enumerate(names)},
        status=status,
        nis=findings[:, 1],
        innovation={name: innovation[:, i] for i, name in enumerate(measured)},
        innovation_sigma={name: np.sqrt(innovation_variance[:, i]) for i, name in enumerate(measured)},
        accepted={name: accepted[:, i] > 0 for i, name in enumerate(measured)},
    )
