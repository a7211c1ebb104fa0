"""Faults that only several channels together show: a turn ties them all to the leading unit's yaw rate.

With speed u, yaw rate r of the leading unit and left positive: steer is r (l + K u^2) / u; a towed unit of length L
follows as L/u r2' + r2 = r, at an articulation of -r2 L/u, so that a LEFT turn articulates to the NEGATIVE; lateral
acceleration is u r, and a body rolls outwards with it, so that its roll rate goes with (u r)'. Rough, but a sign or a
factor of 57 is not missed.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fifthwheel.logs.faults import Fault, Finding
from fifthwheel.logs.record import Array, Record
from fifthwheel.logs.samples import LIMITS, lone, seen

_STEP = 0.05
"""s; step of the grid on which signals are compared."""
_AHEAD = 0.4
"""s; a towed unit that is so much earlier than it can be does not follow."""
_MOST = 1e7
"""Instants of a grid; six days."""
_TOWED = 8.0
"""m; length of a towed unit, coupling to axles, when nothing is known of it."""
UNDERSTEER = 0.004
"""s^2/m; understeer gradient of a heavy truck; measured ones lie between 0.002 and 0.008."""
_LEAN = 0.03
"""rad s^2/m; roll of a body by lateral acceleration."""
_LEANING = 0.15
"""s; two lags of this stand for the roll mode, 1 Hz and well damped."""
_STRONG = {"steer": 0.003, "yaw_rate": 0.01, "articulation": 0.01, "lateral_acceleration": 0.3, "roll_rate": 0.003}
"""Standard deviation above which a signal tells of turns rather than of noise, SI."""
_OFFSET = {"steer": 0.02, "yaw_rate": 0.02, "articulation": 0.04, "lateral_acceleration": 1.0}
"""Offset worth a warning, SI."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Relation:
    """A signal against what the hub, the leading yaw rate, lets expect of it."""

    signal: str
    hub: str
    correlation: float
    """Of the two, smoothed, at the nominal delay."""
    coherence: float
    """The largest magnitude of the correlation at any delay from -1.5 to 1.5 s."""
    lead: float
    """By how much the signal comes before what is expected, s; 0 where they hardly go together."""
    gain: float
    """Standard deviation of the signal by that expected."""
    offset: float
    """Mean of the signal where 0 is expected, SI."""
    strong: bool
    """Whether both vary enough to be judged."""
    wheelbase: float
    """m, of the leading unit."""

    @property
    def fault(self) -> Fault | None:
        """What the relation says is wrong, if anything; of the hub when a hub's inverse gain explains it."""
        quantity = self.signal.partition(".")[0]
        if quantity == "roll_rate":  # roads and winds roll a body too, and how far it leans is not known
            if self.strong and self.correlation < -0.5:
                return Fault.SWAPPED_SIGN
            return Fault.DEGREES if self.correlation > 0.8 and self.gain > 20 else None
        if self.strong and self.coherence < 0.3:
            return Fault.WRONG_COLUMN
        if self.strong and self.correlation < -0.5:
            return Fault.SWAPPED_SIGN
        if self.strong and quantity == "yaw_rate" and self.lead > _AHEAD:
            return Fault.WRONG_COLUMN
        if abs(self.correlation) > 0.8:
            if quantity == "steer" and (7 < self.gain < 38 or self.gain > 300):
                return Fault.STEERING_WHEEL
            if self.gain < 1 / 20 or (self.gain > 20 and quantity != "lateral_acceleration"):
                return Fault.DEGREES
            if quantity == "lateral_acceleration" and (self.gain < 0.4 or 2.5 < self.gain < 5):
                return Fault.UNIT
            if self.strong and quantity == "steer" and not 0.35 < self.gain < 2.2:
                return Fault.GAIN
            if self.strong and abs(self.offset) > _OFFSET[quantity]:
                return Fault.OFFSET
        return None


def disagreements(record: Record, *, wheelbase: float, min_speed: float) -> Iterator[Finding]:
    """Findings on the signals that contradict the leading yaw rate, or on that itself where most contradict it."""
    found = list(relations(record, wheelbase=wheelbase, min_speed=min_speed))
    doubtful = {
        relation.signal.partition(".")[2]
        for relation in found
        if relation.signal.startswith("yaw_rate.") and relation.fault
    }
    rolling = [relation for relation in found if relation.signal.startswith("roll_rate.")]
    found = [relation for relation in found if relation not in rolling]
    faults = [relation.fault for relation in found]
    counts = Counter(faults)
    # The fewest faults that explain what is seen: one of the hub, with all that agree with it, or each its own.
    blamed = {
        fault for fault in (Fault.SWAPPED_SIGN, Fault.WRONG_COLUMN) if counts[fault] > 1 + len(found) - counts[fault]
    }
    for culprit in blamed:
        yield _finding(next(r for r in found if r.fault is culprit), culprit, hub=True)
    for relation, fault in zip(found, faults, strict=True):
        if fault is Fault.DEGREES and relation.gain < 1:
            yield _finding(relation, fault, hub=True)
        elif fault is not None and fault not in blamed:
            yield _finding(relation, fault, hub=False)
    for relation in rolling:  # they are compared with their own unit's yaw rate, which must be in order
        if relation.fault and not blamed and relation.signal.partition(".")[2] not in doubtful:
            yield _finding(relation, relation.fault, hub=False)


def relations(record: Record, *, wheelbase: float, min_speed: float) -> Iterator[Relation]:
    """Every signal to be expected from the leading unit's yaw rate, where faster than `min_speed` m/s."""
    hub = _hub(record)
    if hub is None or "speed" not in record.signals:
        return
    time = grid(record, _STEP)
    (speed, known), (rate, there) = on_grid(record, "speed", time), on_grid(record, hub, time)
    fast = known & there & (speed > min_speed) & (speed < LIMITS["speed"].most)
    if fast.sum() * _STEP < 3.0:
        return
    u = np.maximum(speed, min_speed)
    towed = _lag(rate, _TOWED / u)
    expected = {
        "steer": rate * (wheelbase + UNDERSTEER * u**2) / u,
        "yaw_rate": towed,
        "articulation": -towed * _TOWED / u,
        "lateral_acceleration": u * rate,
    }
    turning = float(np.std(rate[fast])) > _STRONG["yaw_rate"]
    for name in record.signals:
        quantity, _, place = name.partition(".")
        if quantity == "roll_rate":  # of the unit's own yaw rate, if there is one
            own, known_own = on_grid(record, f"yaw_rate.{place}", time)
            sideways = u * (own if known_own.any() else rate)
            for _ in range(2):
                sideways = _lag(sideways, np.full(time.size, _LEANING))
            expected["roll_rate"] = _LEAN * np.gradient(sideways, _STEP)
        if quantity not in expected or name == hub or (quantity == "steer" and not place.endswith(".front")):
            continue
        values, seen_here = on_grid(record, name, time)
        if quantity == "steer":
            values = _lag(values, np.full(time.size, 0.25))
        here = fast & seen_here
        if here.sum() * _STEP < 3.0:
            continue
        mine, theirs = (_lag(x, np.full(time.size, 0.3)) for x in (values, expected[quantity]))
        gain = float(np.std(mine[here]) / max(float(np.std(theirs[here])), 1e-12))
        together = correlation(mine, theirs, here, 0)
        shifts = range(-30, 31, 2)
        beside = [correlation(mine, theirs, here, shift) for shift in shifts]
        best = int(np.argmax(beside))
        yield Relation(
            signal=name,
            hub=hub,
            correlation=together,
            coherence=max(map(abs, beside)),
            lead=shifts[best] * _STEP if beside[best] > 0.9 else 0.0,
            gain=gain,
            offset=float(np.mean(mine[here]) - np.sign(together) * gain * np.mean(theirs[here])),
            strong=turning and float(np.std(mine[here])) > _STRONG[quantity],
            wheelbase=wheelbase,
        )


def _hub(record: Record) -> str | None:
    """The yaw rate of the unit that steers in front, else the first yaw rate there is."""
    rates = [name for name in record.signals if name.startswith("yaw_rate.")]
    leading = [n.split(".")[1] for n in record.signals if n.startswith("steer.") and n.endswith(".front")]
    return next((name for name in rates if name.partition(".")[2] in leading), rates[0] if rates else None)


def grid(record: Record, step: float) -> Array:
    """Instants (N,) s from the record's first to its last, `step` s apart; none where a stamp has gone wild."""
    start, stop = record.span
    return np.arange(start, stop, step) if (stop - start) / step < _MOST else np.empty(0)


def on_grid(record: Record, name: str, time: Array) -> tuple[Array, NDArray[np.bool_]]:
    """A signal (N,) without its spikes, linear on the grid, and where it has a sample within 0.5 s."""
    if name not in record.signals:
        return np.zeros(time.size), np.zeros(time.size, dtype=bool)
    at, values = seen(record, name)
    keep = ~lone(at, values, LIMITS[name.partition(".")[0]].jump)
    if keep.sum() < max(2, 0.9 * keep.size):
        keep = np.ones(at.size, dtype=bool)
    at, values = at[keep], values[keep]
    if at.size < 2:
        return np.zeros(time.size), np.zeros(time.size, dtype=bool)
    after = np.clip(np.searchsorted(at, time), 1, at.size - 1)
    near = np.minimum(np.abs(at[after] - time), np.abs(time - at[after - 1])) < 0.5
    return np.interp(time, at, values), near


def _lag(values: Array, constant: Array) -> Array:
    """First-order lag with a time constant (N,) s."""
    state, out = float(values[0]), np.empty(values.size)
    for k, (value, share) in enumerate(zip(values.tolist(), (_STEP / (constant + _STEP)).tolist(), strict=True)):
        state += share * (value - state)
        out[k] = state
    return out


def correlation(a: Array, b: Array, where: NDArray[np.bool_], shift: int) -> float:
    """Of a with b `shift` grid steps later; 0 where either is constant or little is left."""
    stop = max(0, a.size - abs(shift))
    one, other = max(0, -shift), max(0, shift)
    both = where[one : one + stop] & where[other : other + stop]
    x, y = a[one : one + stop][both], b[other : other + stop][both]
    if x.size < 40 or np.std(x) < 1e-12 or np.std(y) < 1e-12:
        return 0.0
    return float(np.corrcoef(x, y)[0, 1])


def _finding(relation: Relation, fault: Fault, *, hub: bool) -> Finding:
    """The fault in words, blamed on the relation's signal or on its hub."""
    blamed, other = (relation.hub, relation.signal) if hub else (relation.signal, relation.hub)
    quantity = blamed.partition(".")[0]
    unit = LIMITS[quantity].unit
    c, g = relation.correlation, relation.gain if not hub else 1 / max(relation.gain, 1e-12)
    says = {
        Fault.SWAPPED_SIGN: f"goes against {other} (correlation {c:.2f}); left turns are positive in yaw rate, "
        "steer and acceleration, negative in articulation, and roll is positive in them; set sign = -1 here"
        + ("" if hub else f", or for {other}"),
        Fault.WRONG_COLUMN: f"comes {relation.lead:.1f} s before a towed unit could that follows {relation.hub}; "
        "the two columns look exchanged, or their clocks differ"
        if relation.lead > _AHEAD and quantity == "yaw_rate"
        else f"has nothing to do with {other} (coherence {relation.coherence:.2f}, expected 0.3) "
        "though both vary; map another column, or check the delay",
        Fault.DEGREES: f"{g:.0f} times what {other} lets expect, looks like degrees; set unit = "
        f'"{unit.replace("rad", "deg")}"',
        Fault.STEERING_WHEEL: f"{g:.0f} times what {other} lets expect, looks like the steering-wheel angle"
        + (' or like degrees; set unit = "deg" or ' if 28 < g <= 300 else "; set ")
        + "gain = 1 / steering ratio"
        + (' and unit = "deg"' if g > 300 else ""),
        Fault.UNIT: f"speed * {other} is {1 / g:.1f} times {relation.signal}; "
        + (
            'the acceleration looks like g, set its unit = "g"'
            if g < 0.18
            else 'looks like km/h, set unit = "km/h"'
            if g < 1
            else 'it looks like m/s already, set unit = "m/s"'
        ),
        Fault.GAIN: f"{g:.2g} times what {other}, speed and a wheelbase of {relation.wheelbase:.3g} m let expect; "
        "check the steering ratio (gain), and whether speed is in km/h",
        Fault.OFFSET: f"about {relation.offset:.3g} {unit} where {other} lets expect 0; subtract it with offset = "
        f"{relation.offset:.3g}",
    }[fault]
    if fault is Fault.UNIT and g >= 0.18:
        blamed = "speed"
    severe = fault not in (Fault.OFFSET, Fault.GAIN)
    return Finding(signal=blamed, fault=fault, severity="error" if severe else "warning", message=f"{blamed}: {says}")
