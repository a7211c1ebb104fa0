"""Whether the measurements agree with the filter: a health figure, and the detection of a wrong state or input.

The health figure is the normalised innovation squared (NIS) of each channel, at most gate^2, averaged over channels and
time; 1 is expected (Bar-Shalom, Li and Kirubarajan 2001, 5.4). Rejected measurements count too: a filter that rejects
good measurements because its own state is wrong is not healthy.

A filter that has diverged restarts at once: near a jackknife, a model with saturating tyres has no bound.

The measurements disagree with the state if the gate rejects at least half of them, and at least two if there are two:
of two that contradict each other, one is right.

The first sample after a start passes any gate, because the covariance is wide. The state settles when `SETTLED` samples
after it agree with it; one that does not starts the filter again, since either may be wrong. After a sudden change of
an input the state settles anew, without a start: the change may be wrong, or one that the model does not follow.
"""

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np

from fifthwheel.base.native import Scan, compiled
from fifthwheel.base.types import Array
from fifthwheel.data.channels import SPEED, STEER, SignalName
from fifthwheel.estimate.filters.kalman import ChannelUpdate
from fifthwheel.estimate.filters.model import partitioned
from fifthwheel.estimate.observe.settings import ObserverSettings
from fifthwheel.estimate.stream import Status

START: Array = np.array([1.0, 0.0, -1.0, 0.0])
"""Carry of the monitor before the first sample: [NIS, time since the last measurement, s, duration of the present
disagreement, s, -1 for none, number of samples that agree with the first one, at most `SETTLED`; below 0, the number of
samples until the state has settled after a sudden change]."""
SETTLED = 10
"""Samples after a start that must agree with it; twice as many follow a sudden change, since the covariance is small
then, and corrects the state slowly."""
SUDDEN = {SPEED.quantity: (30.0, 1.0), STEER.quantity: (0.52, 0.005)}
"""A change of an input is sudden above both, SI per second and SI. A driver turns the steering wheel at 600 deg/s in an
emergency, and the road wheel at a twentieth of that, 0.52 rad/s; smaller changes may be steps of a sensor."""
CONTRADICTION = 4.0
"""Sigmas of an innovation from which on a sample contradicts a start: an error of the first sample that remains below
it is less than 3 sigma of the state when that has settled."""
MIN_SAMPLES = 10
"""The average extends over at least so many samples, also where they are further apart than its time constant."""
CHANCE = 1.5
"""A health figure up to this value may be chance: of 100 squares of white innovations, the average has the standard
deviation 0.14, and one rejected sample of all channels adds 0.36."""

DIVERGED = 1e3
"""rad and rad/s; no state of a truck is so large, nor its sigma where any measurement or the start informs it."""


def monitor(
    carry: ca.SX,
    channels: list[ChannelUpdate[ca.SX]],
    weight: ca.SX,
    dt: ca.SX,
    sudden: ca.SX,
    limit: ca.SX,
    settings: ca.SX,
) -> tuple[ca.SX, ca.SX]:
    """One step of the monitor: its carry, see `START`, and [1 until the state has settled, NIS, 1 if the filter must
    restart; else 0].

    The weights (m,) of the channels are 1 if measured, else 0; dt is the time since the last row, s; `sudden` is 1
    if an input has changed suddenly in it, else 0; the limit is the squared gate. settings = [time constant of the
    average, s; duration of a disagreement, 0 or more, before a restart, s].
    """
    nis, elapsed, duration = carry[0], carry[1] + dt, carry[2]
    window, restart_after = settings[0], settings[1]
    count, used = ca.sum1(weight), sum(channel.accepted for channel in channels)
    squares = sum(ca.fmin(channel.innovation**2 / channel.variance, limit) for channel in channels)
    measured = count > 0
    fraction = ca.fmin(elapsed / (window + elapsed), 1 / MIN_SAMPLES)
    nis += measured * fraction * (squares / ca.fmax(count, 1) - nis)
    rejected = count - used
    disagree = measured * (2 * rejected >= count) * (rejected >= ca.fmin(count, 2))
    running = ca.if_else(duration < 0, duration, duration + dt)
    duration = ca.if_else(disagree, ca.fmax(running, 0), ca.if_else(measured, -1, running))
    normalised = [channel.innovation**2 / channel.variance for channel in channels]
    contradicts = sum(weight[i] * (square > CONTRADICTION**2) for i, square in enumerate(normalised)) > 0
    later, started = measured * (dt > 0), (carry[3] >= 0) * (carry[3] < SETTLED)
    agreed = carry[3] + later
    agreed = ca.if_else((carry[3] < 0) * (agreed >= 0), SETTLED, ca.fmin(agreed, SETTLED))
    agreed = ca.if_else(sudden, -2 * SETTLED, agreed)
    restart = ca.fmax(disagree * (running >= restart_after), started * ca.fmax(later * contradicts, sudden))
    carried = ca.vertcat(nis, ca.if_else(measured, 0, elapsed), duration, agreed)
    return carried, ca.vertcat(agreed < SETTLED, nis, restart)


def health(status: Status, settling: float, nis: float, max_nis: float) -> Status:
    """The status of a sample with that of its stream, and what `monitor` found."""
    if nis > max_nis:
        return Status.INCONSISTENT
    return Status.SETTLING if settling and status == Status.OK else status


def normalised_monitor(inputs: tuple[str, ...], channels: int) -> ca.Function:
    """The monitor of a filter that gives the innovations over their standard deviations, 0 where missing.

    carry as `START`; sample = [dt, inputs at the last sample, inputs now, innovations, weights]; constant = [gate^2,
    settings]; output as of `monitor`.
    """
    k = len(inputs)
    carry, constant = ca.SX.sym("carry", len(START)), ca.SX.sym("constant", 3)
    sample, dt, before, after, innovations, weight = partitioned("sample", 1, k, k, channels, channels)
    limit, settings = constant[0], constant[1:]
    accepted = weight * (innovations**2 <= limit)
    columns = [ChannelUpdate(innovations[i], ca.SX(1), accepted[i]) for i in range(channels)]
    sudden = sudden_change(inputs, before, after, dt)
    results = monitor(carry, columns, weight, dt, sudden, limit, settings)
    return ca.Function("monitor", [carry, sample, constant], list(results))


@compiled(Scan)
def monitor_step(inputs: tuple[str, ...], channels: int) -> ca.Function:
    """The compiled step of `normalised_monitor`."""
    return normalised_monitor(inputs, channels)


class Monitor:
    """The compiled monitor of a filter, sample by sample."""

    def __init__(self, inputs: Sequence[str], channels: int, gate: float, settings: ObserverSettings) -> None:
        scan = monitor_step(tuple(inputs), channels)
        self.constant = np.array([gate**2, settings.nis_window, settings.restart_after])
        self.carry = START.copy()
        row, out = np.zeros(scan.n_sample), np.zeros(scan.n_output)
        self._row: Any = row.data
        self._out: Any = out.data
        self._step = scan.bound(self.carry, row, self.constant, out)
        self.max_nis = settings.max_nis

    def start(self, nis: float = START[0]) -> None:
        """Before a first sample."""
        self.carry[:] = after_restart(nis)
        self._out[0], self._out[1] = 1.0, nis

    def update(self, dt: float, *parts: Sequence[float]) -> bool:
        """Take the inputs at the last sample and now, innovations and weights; whether the filter must restart."""
        row = self._row
        row[0], i = dt, 1
        for values in parts:
            for value in values:
                row[i] = value
                i += 1
        self._step()
        return bool(self._out[2])

    def save(self) -> Array:
        """All that changes, for `resume`."""
        return np.concatenate([self.carry, self._out])

    def resume(self, saved: Array) -> None:
        """Continue from the result of `save`."""
        self.carry[:], np.asarray(self._out)[:] = np.split(saved, [len(self.carry)])

    @property
    def nis(self) -> float:
        """The NIS after the last sample."""
        return float(self._out[1])

    @property
    def excess(self) -> float:
        """Factor of the variances of the states, see `excess`."""
        return max(self.nis / CHANCE, 1.0)

    def status(self, status: Status) -> Status:
        """See `health`."""
        return health(status, self._out[0], self._out[1], self.max_nis)


def sudden_change(names: Sequence[str], before: ca.SX, after: ca.SX, dt: ca.SX) -> ca.SX:
    """1 if one of the inputs (n,) with these names has changed suddenly within dt seconds, see `SUDDEN`; else 0."""
    found = ca.SX(0)
    for i, name in enumerate(names):
        if limits := SUDDEN.get(SignalName.of(name).quantity):
            rate, least = limits
            found = ca.fmax(found, ca.fabs(after[i] - before[i]) > ca.fmax(rate * dt, least))
    return (dt > 0) * found


def excess(nis: Any) -> Any:
    """Factor of the variances of the states, at least 1: how far the NIS exceeds what may be chance."""
    return ca.fmax(nis / CHANCE, 1.0) if isinstance(nis, ca.SX) else np.maximum(nis / CHANCE, 1.0)


def diverged(values: ca.SX, variances: ca.SX, dt: ca.SX) -> ca.SX:
    """1 if a reported value or its sigma is too large or not a number, else 0; 0 at a start of the filter, dt = 0."""
    bounded = (ca.norm_1(values) <= DIVERGED) * (ca.sum1(ca.fabs(variances)) <= DIVERGED**2)
    return (dt > 0) * (1 - bounded)


def after_restart(nis: float) -> Array:
    """Carry of the monitor when the filter restarts: the average continues."""
    return np.array([nis, *START[1:]])
