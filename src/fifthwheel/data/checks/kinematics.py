"""Faults that appear only in the comparison of several channels: in a turn, all follow from the leading yaw rate.

With speed u and yaw rate r of the leading unit, left positive: the steer angle is r (l + K u^2) / u; the yaw rate r2 of
a towed unit of length L obeys L/u r2' + r2 = r; its articulation is -r2 L/u, negative in a left turn; the lateral
acceleration is u r; a body rolls outwards in proportion to it, so its roll rate is proportional to (u r)'; the right
wheel of an axle is faster than the left one by a fraction proportional to the yaw rate of its unit over u. These
relations are approximate, but sufficient to detect a wrong sign, degrees or a wrong column.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fifthwheel.base.types import Array
from fifthwheel.data.channels import STEER, YAW_RATE, SignalName, channel_of, is_of, names_of, si_unit
from fifthwheel.data.channels.channel import Turn, TurnRelation
from fifthwheel.data.checks.findings import Fault, Finding, error, remedy_text, warning
from fifthwheel.data.checks.samples import MAX_SPEED, present_samples
from fifthwheel.data.checks.signs import Signs, likely_signs
from fifthwheel.data.record.derived import all_pairs, sides_of, with_differences
from fifthwheel.data.record.record import Record

_STEP = 0.05
"""s; step of the common time on which signals are compared."""
_MIN_DURATION = 3.0
"""s; a shorter common time is not compared."""
_NOISY_DURATION = 6.0
"""s; the same of a signal that may be as small as its noise (`TurnRelation.sign_only`)."""
_MAX_INSTANTS = 1e7
"""Instants of a common time, 6 days; more result from a corrupted timestamp only."""
_GAP = 10.0
"""s; a longer time step is a gap."""
_MIN_COVERED = 0.05
"""Fraction of a record's span outside of gaps; less results from a gap of hours or a corrupted timestamp."""
_TOWED_LENGTH = 8.0
"""m; length of a towed unit from coupling to axles, where none is known."""
_LEAST_YAW_RATE = 0.01
"""rad/s; standard deviation of the leading yaw rate above which it shows turns and not only noise."""
_CLEAR = 0.5
"""Correlation above which a signal has the expected sign, and below minus which it has the other one."""
_CLEAR_LEAD = 2.0
"""Variance that a possible delay leaves unexplained, over that of the best one, above which the signal leads: signals
that change slowly agree at any delay."""
_SMOOTHING = 0.3
"""s; time constant of the lag that both signals pass before they are compared."""


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
    best: float
    """Largest correlation at these delays."""
    inverted: float
    """The same of the inverted signal, at delays from -0.3 to 0.3 s."""
    lead: float
    """Time by which the signal clearly leads the expected value, s; else 0."""
    gain: float
    """Standard deviation of the signal over that of the expected value; of a signal whose lag is uncertain between 0
    and that of its channel, the geometric mean of both."""
    gain_sigma: float
    """Of the logarithm of the gain, by this lag: it damps quick manoeuvres."""
    offset: float
    """Mean of the signal where the expected value is 0, SI."""
    excited: bool
    """Whether both vary enough for a comparison."""
    wheelbase: float
    """m, of the leading unit."""
    own: str = ""
    """The yaw rate of its unit, from which a roll follows; empty for other signals."""

    @property
    def turn(self) -> TurnRelation:
        """Of the channel of the signal."""
        channel = channel_of(self.signal)
        assert channel is not None
        assert channel.turn is not None
        return channel.turn

    @property
    def agrees(self) -> bool:
        """Whether the signal has the expected sign."""
        return self.excited and self.correlation > _CLEAR

    @property
    def fault(self) -> Fault | None:
        """The fault of the signal, or of the leading yaw rate if the inverse gain explains it; None without a fault."""
        turn = self.turn
        if turn.sign_only:
            is_inverted = self.inverted > max(0.8, self.best) and 0.4 < self.gain < 4
            return Fault.SWAPPED_SIGN if self.excited and is_inverted else None
        if self.excited and not turn.has_other_causes and self.coherence < 0.3:
            return Fault.WRONG_COLUMN
        # in a sweep, a unit that lags by half a period looks inverted: it agrees better at a delay
        if self.excited and self.correlation < -_CLEAR and self.inverted > self.best:
            return Fault.SWAPPED_SIGN
        if self.excited and self.lead > turn.longest_lead:
            return Fault.WRONG_COLUMN
        if (self.correlation if turn.has_other_causes else abs(self.correlation)) > 0.8:
            for fault, above, below, if_excited in turn.gain_faults:
                if above < self.gain < below and (self.excited or not if_excited):
                    return Fault(fault)
            if self.excited and abs(self.offset) > turn.largest_offset:
                return Fault.OFFSET
        return None


def kinematic_findings(record: Record, *, wheelbase: float, min_speed: float) -> Iterator[Finding]:
    """Findings on the signals that contradict the leading yaw rate, or on the latter where most contradict it."""
    every = list(relations(record, wheelbase=wheelbase, min_speed=min_speed))
    rolling = [relation for relation in every if relation.turn.has_other_causes]
    turning = [relation for relation in every if not relation.turn.has_other_causes]
    inverted = signs_of(every).inverted
    confirmed = any(relation.agrees for relation in turning)
    if every and every[0].leading in inverted:
        yield _finding(next(r for r in every if r.fault is Fault.SWAPPED_SIGN), Fault.SWAPPED_SIGN, of_leading=True)
    if is_unrelated := _leading_is_unrelated(turning):
        wrong = next(r for r in turning if r.fault is Fault.WRONG_COLUMN)
        yield _finding(wrong, Fault.WRONG_COLUMN, of_leading=True)
    # A roll rate is compared with the yaw rate of its own unit, which must be without a fault.
    doubtful = {SignalName.of(r.signal).unit for r in turning if r.fault and is_of(r.signal, YAW_RATE)}
    for relation in (*turning, *rolling):
        fault = Fault.SWAPPED_SIGN if relation.signal in inverted else relation.fault
        is_explained = fault is Fault.SWAPPED_SIGN and relation.signal not in inverted
        of_yaw_rate = relation.own and (is_unrelated or SignalName.of(relation.signal).unit in doubtful)
        if fault is None or is_explained or (fault is Fault.WRONG_COLUMN and is_unrelated):
            continue
        if fault is Fault.SWAPPED_SIGN and relation.signal not in record.signals:
            yield _exchanged_sides(relation, confirmed=confirmed)
        elif fault is Fault.SWAPPED_SIGN or not of_yaw_rate:
            of_leading = fault is Fault.DEGREES and relation.gain < 1
            yield _finding(relation, fault, of_leading=of_leading, confirmed=confirmed)


def signs_of(every: Sequence[Relation]) -> Signs:
    """Which signals are inverted, by the relations whose sign is clear."""
    clear = {
        r.signal: -1 if r.fault is Fault.SWAPPED_SIGN else 1 for r in every if r.agrees or r.fault is Fault.SWAPPED_SIGN
    }
    signs = dict.fromkeys((r.leading for r in every), 1)
    for r in sorted(every, key=lambda r: bool(r.own)):
        if r.signal in clear and (r.own or r.leading) in signs:
            signs[r.signal] = clear[r.signal] * signs[r.own or r.leading]
    return likely_signs(signs)


def _leading_is_unrelated(turning: Sequence[Relation]) -> bool:
    """Whether fewer faults explain all if the leading yaw rate is that of another column, and not each other signal."""
    # who exchanges the wheel speeds of one axle may do so of all: the differences count as one signal
    wheels = sorted((r for r in turning if r.turn.sign_only), key=lambda relation: relation.fault is not None)
    witnesses = [*(r for r in turning if not r.turn.sign_only), *wheels[:1]]
    unrelated = sum(relation.fault is Fault.WRONG_COLUMN for relation in witnesses)
    return unrelated > 1 + len(witnesses) - unrelated


def relations(record: Record, *, wheelbase: float, min_speed: float) -> Iterator[Relation]:
    """Comparison of every signal that follows from the leading yaw rate, at speeds above `min_speed` m/s."""
    leading = _leading_yaw_rate(record)
    if leading is None:
        return
    record = with_differences(record, _used_differences(record))
    time = common_time(record, _STEP)
    speed, speed_known = at_common_time(record, "speed", time)
    rate, rate_known = at_common_time(record, leading, time)
    fast = speed_known & rate_known & (speed > min_speed) & (speed < MAX_SPEED)
    if fast.sum() * _STEP < _MIN_DURATION:
        return
    u = np.maximum(speed, min_speed)
    motion = Turn(u, rate, rate, is_towed=True, towed_length=_TOWED_LENGTH, wheelbase=wheelbase, step=_STEP)
    turning, front = float(np.std(rate[fast])) > _LEAST_YAW_RATE, _front_steer(record)
    for name in record.signals:
        signal, channel = SignalName.of(name), channel_of(name)
        turn = channel.turn if channel else None
        if turn is None or name == leading or (turn.part and name != front):
            continue
        values, known = at_common_time(record, name, time)
        if turn.derivative:
            values = np.gradient(values, _STEP)
        late = motion.lagged(values, turn.lag) if turn.lag else values
        compared = fast & known
        if compared.sum() * _STEP < (_NOISY_DURATION if turn.sign_only else _MIN_DURATION):
            continue
        own_name = f"yaw_rate.{signal.unit}"
        own_rate, own_known = at_common_time(record, own_name, time)
        own = motion._replace(
            own_yaw_rate=own_rate if own_known.any() else rate, is_towed=signal.unit != SignalName.of(leading).unit
        )
        early, actual, reference = (motion.lagged(x, _SMOOTHING) for x in (values, late, turn.expected(own)))
        sizes = [max(float(np.std(x[compared])), 1e-12) for x in (early, actual, reference)]
        gain = math.sqrt(sizes[0] * sizes[1]) / sizes[2]
        nominal = correlation(actual, reference, compared, 0)
        shifts = range(-30, 31, 2)
        shifted = [correlation(actual, reference, compared, shift) for shift in shifts]
        best = int(np.argmax(shifted))
        possible = max(r for r, shift in zip(shifted, shifts, strict=True) if shift * _STEP <= turn.longest_lead)
        leads = shifted[best] > 0.9 and 1 - possible**2 > _CLEAR_LEAD * (1 - shifted[best] ** 2)
        yield Relation(
            signal=name,
            leading=leading,
            correlation=nominal,
            coherence=max(map(abs, shifted)),
            best=shifted[best],
            inverted=-min(shifted[i] for i, shift in enumerate(shifts) if abs(shift) <= 6),
            lead=shifts[best] * _STEP if leads else 0.0,
            gain=gain,
            gain_sigma=abs(math.log(sizes[0] / sizes[1])) / 2,
            offset=float(np.mean(actual[compared]) - np.sign(nominal) * gain * np.mean(reference[compared])),
            excited=turning and float(np.std(actual[compared])) > turn.least_sigma,
            wheelbase=wheelbase,
            own=(own_name if own_known.any() else leading) if turn.has_other_causes else "",
        )


def _leading_yaw_rate(record: Record) -> str | None:
    """The yaw rate of the unit with the front steer angle, else the first yaw rate, if there is one."""
    yaw_rates = names_of(YAW_RATE, record.signals)
    front = _front_steer(record)
    of_front = [name for name in yaw_rates if front and SignalName.of(name).unit == SignalName.of(front).unit]
    return next(iter([*of_front, *yaw_rates]), None)


def _front_steer(record: Record) -> str | None:
    """The steer angle of the axle that is named front, or the only one, if there is one."""
    steers = names_of(STEER, record.signals)
    named = [name for name in steers if SignalName.of(name).part == "front"]
    found = named or (steers if len(steers) == 1 else ())
    return found[0] if found else None


def _used_differences(record: Record) -> list[str]:
    """The wheel speed differences that estimators use: driven wheels, of the unit with the front steer angle, slip."""
    front, signals = _front_steer(record), {name: SignalName.of(name) for name in all_pairs(record.signals)}
    steered = SignalName.of(front).unit if front else None
    return [n for n, each in signals.items() if each.unit != steered or f"steer.{each.place}" in record.signals]


def common_time(record: Record, step: float) -> Array:
    """Instants (N,) in the span of a record, `step` s apart, `without_gaps`; none where `is_mostly_gaps`."""
    start, stop = record.span
    usable = (stop - start) / step < _MAX_INSTANTS and not is_mostly_gaps(record)
    return without_gaps(np.arange(start, stop, step), record.time) if usable else np.empty(0)


def without_gaps(instants: Array, sample_time: Array) -> Array:
    """The instants (n,) that follow a sample within 10 s: of a longer gap, that much remains."""
    before = np.searchsorted(sample_time, instants, side="right") - 1
    return instants[instants - sample_time[np.maximum(before, 0)] <= _GAP]


def is_mostly_gaps(record: Record) -> bool:
    """Whether almost all of the record's span is in gaps, so that a uniform time base would be almost empty."""
    steps = np.diff(record.time)
    return float(steps[steps <= _GAP].sum()) < _MIN_COVERED * float(record.time[-1] - record.time[0])


def at_common_time(record: Record, name: str, time: Array) -> tuple[Array, NDArray[np.bool_]]:
    """A signal, linear at the instants (N,), and a mask (N,): a sample lies within 0.5 s."""
    unknown = np.zeros(time.size), np.zeros(time.size, dtype=bool)
    if name not in record.signals:
        return unknown
    sample_time, values = present_samples(record, name)
    if sample_time.size < 2:
        return unknown
    after = np.clip(np.searchsorted(sample_time, time), 1, sample_time.size - 1)
    near = np.minimum(np.abs(sample_time[after] - time), np.abs(time - sample_time[after - 1])) < 0.5
    return np.interp(time, sample_time, values), near


def correlation(a: Array, b: Array, mask: NDArray[np.bool_], shift: int) -> float:
    """Correlation of a with b `shift` steps later, where both are in the mask; 0 for constants and under 40 samples."""
    size = max(0, a.size - abs(shift))
    first_a, first_b = max(0, -shift), max(0, shift)
    both = mask[first_a : first_a + size] & mask[first_b : first_b + size]
    x, y = a[first_a : first_a + size][both], b[first_b : first_b + size][both]
    if x.size < 40:
        return 0.0
    x, y = x - x.mean(), y - y.mean()
    squares = float(x @ x), float(y @ y)
    return float(x @ y) / math.sqrt(squares[0] * squares[1]) if min(squares) > 1e-24 * x.size else 0.0


def _exchanged_sides(relation: Relation, *, confirmed: bool) -> Finding:
    """The finding on a wheel speed difference that has the wrong sign."""
    left, right = sides_of(relation.signal)
    problem = (
        f"less {left} contradicts {relation.leading} (correlation {-relation.inverted:.2f}, positive expected); in "
        "a left turn the right wheel is faster; exchange the columns of both in signals.toml"
    )
    problem += "" if confirmed else f", or invert {relation.leading}: sign = -1"
    return error(right, Fault.EXCHANGED, problem, others=(left,))


def _finding(relation: Relation, fault: Fault, *, of_leading: bool, confirmed: bool = False) -> Finding:
    """The finding on the relation's signal, or on the leading yaw rate; `confirmed`: a third signal agrees with it."""
    signal, other = relation.signal, relation.leading
    gain = relation.gain
    if of_leading:
        signal, other, gain = other, signal, 1 / max(gain, 1e-12)
    problem, remedy, cure = _explain(relation, fault, signal=signal, other=other, gain=gain, confirmed=confirmed)
    if fault is Fault.UNIT and remedy["unit"] != "g":
        signal = "speed"
    finding = warning if fault in (Fault.OFFSET, Fault.GAIN) else error
    return finding(signal, fault, f"{problem}; {cure or remedy_text(remedy)}", remedy=remedy)


def _explain(
    relation: Relation, fault: Fault, *, signal: str, other: str, gain: float, confirmed: bool
) -> tuple[str, Mapping[str, str | float], str]:
    """What is wrong with `signal`, the keys of signals.toml that remove it, and the cure where keys do not suffice."""
    unit = si_unit(signal) or ""
    factor = f"{gain:.0f}" if gain >= 10 else f"{gain:.2g}"
    expected = f"{factor} times the value expected from {other}"
    match fault:
        case Fault.SWAPPED_SIGN:
            against = f"{other} (correlation {relation.correlation:.2f}, positive expected)"
            if relation.correlation > 0:
                against = f"other signals, as that of {relation.own or relation.leading} does"
            problem = (
                f"the sign contradicts {against}; in a left "
                "turn steer, yaw rate, lateral acceleration and roll are positive, articulation is negative"
            )
            remedy, more = {"sign": -1}, ""
            if signal != relation.leading and relation.turn.has_other_causes:
                more = "; a sensor that faces backwards inverts roll, and not yaw"
            elif signal != relation.leading and not confirmed:
                more = f", or for {other}"
            return problem, remedy, remedy_text(remedy) + more
        case Fault.WRONG_COLUMN if relation.lead > relation.turn.longest_lead:
            late = f"{relation.leading} by {relation.lead:.1f} s"
            problem = f"the signal leads {late}, which is impossible for a towed unit"
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
                "times as large"
            )
            return problem, {"unit": true_unit}, ""
        case Fault.GAIN:
            problem = f"{expected}, speed and a wheelbase of {relation.wheelbase:.3g} m, 1 expected"
            return problem, {}, "correct gain (1 / steering ratio) in signals.toml, or the unit of speed"
        case _:
            offset = relation.offset
            problem = f"the offset is about {offset:.3g} {unit}: the mean when {other} predicts 0"
            return problem, {"offset": offset}, f"{remedy_text({'offset': offset})} (the offset is subtracted)"
