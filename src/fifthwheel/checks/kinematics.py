"""Faults that appear only in the comparison of several channels: in a turn, all follow from the leading yaw rate.

With speed u and yaw rate r of the leading unit, left positive: the steer angle is r (l + K u^2) / u; the yaw rate r2 of
a towed unit of length L obeys L/u r2' + r2 = r; its articulation is -r2 L/u, negative in a left turn; the lateral
acceleration is u r; a body rolls outwards in proportion to it, so its roll rate is proportional to (u r)'. These
relations are approximate, but sufficient to detect a wrong sign, degrees or a wrong column.
"""

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fifthwheel._types import Array
from fifthwheel.checks.findings import Fault, Finding, remedy_text
from fifthwheel.checks.samples import LIMITS, present_samples, spike_mask
from fifthwheel.names import SignalName
from fifthwheel.record.record import Record

UNDERSTEER = 0.004
"""s^2/m; understeer gradient of a heavy truck; measured values lie between 0.002 and 0.008."""
_STEP = 0.05
"""s; step of the common time on which signals are compared."""
_MIN_DURATION = 3.0
"""s; a shorter common time is not compared."""
_MAX_LEAD = 0.4
"""s; a yaw rate that leads the expected one by more is not that of a towed unit."""
_MAX_INSTANTS = 1e7
"""Instants of a common time, 6 days; more result from a corrupted timestamp only."""
_GAP = 10.0
"""s; a longer time step is a gap."""
_MIN_COVERED = 0.05
"""Fraction of a record's span outside of gaps; less results from a gap of hours or a corrupted timestamp."""
_TOWED_LENGTH = 8.0
"""m; length of a towed unit from coupling to axles, where none is known."""
_ROLL_GRADIENT = 0.03
"""rad s^2/m; roll angle of a body by lateral acceleration."""
_ROLL_LAG = 0.15
"""s; two first-order lags of this time constant approximate the roll mode: 1 Hz, well damped."""
_STEER_LAG = 0.25
"""s; lag of the yaw rate behind the steer angle."""
_SMOOTHING = 0.3
"""s; time constant of the lag that both signals pass before they are compared."""
_MIN_SIGMA = {"steer": 0.003, "yaw_rate": 0.01, "articulation": 0.01, "lateral_acceleration": 0.3, "roll_rate": 0.003}
"""Standard deviation above which a signal shows turns and not only noise, SI."""
_MAX_OFFSET = {"steer": 0.02, "yaw_rate": 0.02, "articulation": 0.04, "lateral_acceleration": 1.0}
"""Offset above which a warning is given, SI."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Relation:
    """Comparison of a signal with the value expected from the leading yaw rate."""

    signal: str
    leading: str
    """The leading yaw rate."""
    correlation: float
    """Of both, smoothed, at the nominal delay."""
    coherence: float
    """Largest magnitude of the correlation at delays from -1.5 to 1.5 s."""
    lead: float
    """Time by which the signal leads the expected value, s; 0 where the correlation is low."""
    gain: float
    """Standard deviation of the signal over that of the expected value."""
    offset: float
    """Mean of the signal where the expected value is 0, SI."""
    excited: bool
    """Whether both vary enough for a comparison."""
    wheelbase: float
    """m, of the leading unit."""

    @property
    def fault(self) -> Fault | None:
        """The fault of the signal, or of the leading yaw rate if the inverse gain explains it; None without a fault."""
        quantity = SignalName.of(self.signal).quantity
        if quantity == "roll_rate":  # road and wind excite roll too, and the roll gradient is unknown
            if self.excited and self.correlation < -0.5:
                return Fault.SWAPPED_SIGN
            return Fault.DEGREES if self.correlation > 0.8 and self.gain > 20 else None
        if self.excited and self.coherence < 0.3:
            return Fault.WRONG_COLUMN
        if self.excited and self.correlation < -0.5:
            return Fault.SWAPPED_SIGN
        if self.excited and quantity == "yaw_rate" and self.lead > _MAX_LEAD:
            return Fault.WRONG_COLUMN
        if abs(self.correlation) > 0.8:
            if quantity == "steer" and (7 < self.gain < 38 or self.gain > 300):
                return Fault.STEERING_WHEEL
            if self.gain < 1 / 20 or (self.gain > 20 and quantity != "lateral_acceleration"):
                return Fault.DEGREES
            if quantity == "lateral_acceleration" and (self.gain < 0.4 or 2.5 < self.gain < 5):
                return Fault.UNIT
            if self.excited and quantity == "steer" and not 0.35 < self.gain < 2.2:
                return Fault.GAIN
            if self.excited and abs(self.offset) > _MAX_OFFSET[quantity]:
                return Fault.OFFSET
        return None


def kinematic_findings(record: Record, *, wheelbase: float, min_speed: float) -> Iterator[Finding]:
    """Findings on the signals that contradict the leading yaw rate, or on the latter where most contradict it.

    wheelbase in m, min_speed in m/s.
    """
    every = list(relations(record, wheelbase=wheelbase, min_speed=min_speed))
    rolling = [relation for relation in every if SignalName.of(relation.signal).quantity == "roll_rate"]
    turning = [relation for relation in every if relation not in rolling]
    faults = [relation.fault for relation in turning]
    counts = Counter(faults)
    # The smallest number of faults that explains all: one of the leading yaw rate, or one of each signal.
    leading_faults = [
        fault for fault in (Fault.SWAPPED_SIGN, Fault.WRONG_COLUMN) if counts[fault] > 1 + len(turning) - counts[fault]
    ]
    for culprit in leading_faults:
        yield _finding(next(r for r in turning if r.fault is culprit), culprit, of_leading=True)
    for relation, fault in zip(turning, faults, strict=True):
        if fault is Fault.DEGREES and relation.gain < 1:
            yield _finding(relation, fault, of_leading=True)
        elif fault is not None and fault not in leading_faults:
            yield _finding(relation, fault, of_leading=False)
    # A roll rate is compared with the yaw rate of its own unit, which must be without a fault.
    doubtful = {
        SignalName.of(relation.signal).place
        for relation in turning
        if relation.fault and SignalName.of(relation.signal).quantity == "yaw_rate"
    }
    for relation in rolling:
        if relation.fault and not leading_faults and SignalName.of(relation.signal).place not in doubtful:
            yield _finding(relation, relation.fault, of_leading=False)


def relations(record: Record, *, wheelbase: float, min_speed: float) -> Iterator[Relation]:
    """Comparison of every signal that follows from the leading yaw rate, at speeds above `min_speed` m/s."""
    leading = _leading_yaw_rate(record)
    if leading is None:
        return
    time = common_time(record, _STEP)
    speed, speed_known = at_common_time(record, "speed", time)
    rate, rate_known = at_common_time(record, leading, time)
    fast = speed_known & rate_known & (speed > min_speed) & (speed < LIMITS["speed"].magnitude)
    if fast.sum() * _STEP < _MIN_DURATION:
        return
    u = np.maximum(speed, min_speed)
    towed_rate = _lag(rate, _TOWED_LENGTH / u)
    expected = {
        "steer": rate * (wheelbase + UNDERSTEER * u**2) / u,
        "yaw_rate": towed_rate,
        "articulation": -towed_rate * _TOWED_LENGTH / u,
        "lateral_acceleration": u * rate,
    }
    turning = float(np.std(rate[fast])) > _MIN_SIGMA["yaw_rate"]
    for name in record.signals:
        signal = SignalName.of(name)
        quantity = signal.quantity
        if quantity == "roll_rate":
            own_rate, own_known = at_common_time(record, f"yaw_rate.{signal.place}", time)
            expected["roll_rate"] = _expected_roll_rate(u * (own_rate if own_known.any() else rate))
        if quantity not in expected or name == leading or (quantity == "steer" and signal.axle != "front"):
            continue
        values, known = at_common_time(record, name, time)
        if quantity == "steer":
            values = _lag(values, np.full(time.size, _STEER_LAG))
        compared = fast & known
        if compared.sum() * _STEP < _MIN_DURATION:
            continue
        actual, reference = (_lag(x, np.full(time.size, _SMOOTHING)) for x in (values, expected[quantity]))
        gain = float(np.std(actual[compared]) / max(float(np.std(reference[compared])), 1e-12))
        nominal = correlation(actual, reference, compared, 0)
        shifts = range(-30, 31, 2)
        shifted = [correlation(actual, reference, compared, shift) for shift in shifts]
        best = int(np.argmax(shifted))
        yield Relation(
            signal=name,
            leading=leading,
            correlation=nominal,
            coherence=max(map(abs, shifted)),
            lead=shifts[best] * _STEP if shifted[best] > 0.9 else 0.0,
            gain=gain,
            offset=float(np.mean(actual[compared]) - np.sign(nominal) * gain * np.mean(reference[compared])),
            excited=turning and float(np.std(actual[compared])) > _MIN_SIGMA[quantity],
            wheelbase=wheelbase,
        )


def _expected_roll_rate(lateral_acceleration: Array) -> Array:
    """Roll rate (N,) of a body by the lateral acceleration (N,) of its unit, rad/s."""
    for _ in range(2):
        lateral_acceleration = _lag(lateral_acceleration, np.full(lateral_acceleration.size, _ROLL_LAG))
    return np.asarray(_ROLL_GRADIENT * np.gradient(lateral_acceleration, _STEP))


def _leading_yaw_rate(record: Record) -> str | None:
    """The yaw rate of the unit with the front steer angle, else the first yaw rate, if there is one."""
    yaw_rates = [name for name in record.signals if SignalName.of(name).quantity == "yaw_rate"]
    steered = [s.unit for s in map(SignalName.of, record.signals) if s.quantity == "steer" and s.axle == "front"]
    return next((name for name in yaw_rates if SignalName.of(name).unit in steered), next(iter(yaw_rates), None))


def common_time(record: Record, step: float) -> Array:
    """Instants (N,) from the record's first to its last, `step` s apart; none where `is_mostly_gaps`."""
    start, stop = record.span
    usable = (stop - start) / step < _MAX_INSTANTS and not is_mostly_gaps(record)
    return np.arange(start, stop, step) if usable else np.empty(0)


def is_mostly_gaps(record: Record) -> bool:
    """Whether almost all of the record's span is in gaps, so that a uniform time base would be almost empty."""
    steps = np.diff(record.time)
    return float(steps[steps <= _GAP].sum()) < _MIN_COVERED * float(record.time[-1] - record.time[0])


def at_common_time(record: Record, name: str, time: Array) -> tuple[Array, NDArray[np.bool_]]:
    """A signal without its spikes, linear at the instants (N,), and a mask (N,): a sample lies within 0.5 s."""
    if name not in record.signals:
        return np.zeros(time.size), np.zeros(time.size, dtype=bool)
    sample_time, values = present_samples(record, name)
    keep = ~spike_mask(sample_time, values, LIMITS[SignalName.of(name).quantity].jump)
    if keep.sum() < max(2, 0.9 * keep.size):
        keep = np.ones(sample_time.size, dtype=bool)
    sample_time, values = sample_time[keep], values[keep]
    if sample_time.size < 2:
        return np.zeros(time.size), np.zeros(time.size, dtype=bool)
    after = np.clip(np.searchsorted(sample_time, time), 1, sample_time.size - 1)
    near = np.minimum(np.abs(sample_time[after] - time), np.abs(time - sample_time[after - 1])) < 0.5
    return np.interp(time, sample_time, values), near


def _lag(values: Array, time_constant: Array) -> Array:
    """First-order lag of values (N,) with a time constant (N,) s."""
    state, result = float(values[0]), np.empty(values.size)
    weights = _STEP / (time_constant + _STEP)
    for k, (value, weight) in enumerate(zip(values.tolist(), weights.tolist(), strict=True)):
        state += weight * (value - state)
        result[k] = state
    return result


def correlation(a: Array, b: Array, mask: NDArray[np.bool_], shift: int) -> float:
    """Correlation of a with b `shift` steps later, where both are in the mask; 0 for constants and under 40 samples."""
    size = max(0, a.size - abs(shift))
    first_a, first_b = max(0, -shift), max(0, shift)
    both = mask[first_a : first_a + size] & mask[first_b : first_b + size]
    x, y = a[first_a : first_a + size][both], b[first_b : first_b + size][both]
    if x.size < 40 or np.std(x) < 1e-12 or np.std(y) < 1e-12:
        return 0.0
    return float(np.corrcoef(x, y)[0, 1])


def _finding(relation: Relation, fault: Fault, *, of_leading: bool) -> Finding:
    """The finding on the relation's signal, or on the leading yaw rate."""
    signal, other = relation.signal, relation.leading
    gain = relation.gain
    if of_leading:
        signal, other, gain = other, signal, 1 / max(gain, 1e-12)
    problem, remedy, cure = _explain(relation, fault, signal=signal, other=other, gain=gain)
    if fault is Fault.UNIT and remedy["unit"] != "g":
        signal = "speed"
    return Finding(
        signal=signal,
        fault=fault,
        severity="warning" if fault in (Fault.OFFSET, Fault.GAIN) else "error",
        message=f"{signal}: {problem}; {cure or remedy_text(remedy)}",
        remedy=remedy,
    )


def _explain(
    relation: Relation, fault: Fault, *, signal: str, other: str, gain: float
) -> tuple[str, Mapping[str, str | float], str]:
    """What is wrong with `signal`, the keys of signals.toml that remove it, and the cure where keys do not suffice."""
    unit = LIMITS[SignalName.of(signal).quantity].unit
    factor = f"{gain:.0f}" if gain >= 10 else f"{gain:.2g}"
    expected = f"{factor} times the value expected from {other}"
    match fault:
        case Fault.SWAPPED_SIGN:
            problem = (
                f"the sign contradicts {other} (correlation {relation.correlation:.2f}, positive expected); in a left "
                "turn steer, yaw rate, lateral acceleration and roll are positive, articulation is negative"
            )
            remedy = {"sign": -1}
            return problem, remedy, remedy_text(remedy) + ("" if signal == relation.leading else f", or for {other}")
        case Fault.WRONG_COLUMN if relation.lead > _MAX_LEAD and SignalName.of(signal).quantity == "yaw_rate":
            problem = (
                f"the signal leads {relation.leading} by {relation.lead:.1f} s, which is impossible for a towed unit"
            )
            return problem, {}, "swap the two columns in signals.toml, or set delay"
        case Fault.WRONG_COLUMN:
            problem = f"not related to {other} (coherence {relation.coherence:.2f}, at least 0.3 expected)"
            return problem, {}, "map another column in signals.toml, or set delay"
        case Fault.DEGREES:
            return f"{expected}, looks like degrees", {"unit": unit.replace("rad", "deg")}, ""
        case Fault.STEERING_WHEEL if gain > 300:
            cure = 'set unit = "deg" and gain = 1 / steering ratio in signals.toml'
            return f"{expected}, looks like the steering-wheel angle in degrees", {}, cure
        case Fault.STEERING_WHEEL if gain > 28:
            cure = 'set unit = "deg" or gain = 1 / steering ratio in signals.toml'
            return f"{expected}, looks like degrees or like the steering-wheel angle", {}, cure
        case Fault.STEERING_WHEEL:
            cure = "set gain = 1 / steering ratio in signals.toml"
            return f"{expected}, looks like the steering-wheel angle", {}, cure
        case Fault.UNIT:
            wrong, true_unit = (signal, "g") if gain < 0.18 else ("speed", "km/h" if gain < 1 else "m/s")
            problem = (
                f"{wrong} is probably in {true_unit}: speed * {other} should equal {signal}, but is {1 / gain:.1f} "
                "times as "
                "large"
            )
            return problem, {"unit": true_unit}, ""
        case Fault.GAIN:
            problem = f"{expected}, speed and a wheelbase of {relation.wheelbase:.3g} m, 1 expected"
            return problem, {}, "correct gain (1 / steering ratio) in signals.toml, or the unit of speed"
        case _:
            offset = relation.offset
            problem = f"the offset is about {offset:.3g} {unit}: the mean when {other} predicts 0"
            return problem, {"offset": offset}, f"{remedy_text({'offset': offset})} (the offset is subtracted)"
