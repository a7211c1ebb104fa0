"""Test methods whose log repeats one manoeuvre: what is one, and what it gives.

Step input, ISO 14793:2011. Time counts from the instant at which the steer angle has half of its step. The response
time is that of the first 90 % of the steady value, the peak response time that of the largest value where it is clear
of noise. The overshoot is the largest value less the steady one, divided by the steady one. Steady values are means
over the last third of the step, without the end, where the driver may return.

Single lane change, ISO 14791:2000. Rearward amplification in the time domain: the largest magnitude of the last unit
divided by that of the first one, of yaw rates, and of lateral accelerations where both units have an accelerometer.

Pulse input, ISO 14791:2000. The decrement of successive peaks of the last articulation angle, or of the last yaw rate
without it (measured ones before reference signals, where they have two peaks above the noise), gives the damping ratio
as in `results.assess.yaw_damping`. Peaks within `NOISE` standard deviations of the noise are not used.

Sine with dwell, ISO 18375:2016. A ratio is the yaw rate at `INSTANTS` after the end of steering divided by the one with
the largest magnitude since the steer angle changed its side; it is negative if the yaw rate has changed its side. The
standard is for low friction, and for trucks with stability control.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fifthwheel.base.errors import SignalError
from fifthwheel.base.types import Array
from fifthwheel.data.channels import LATERAL_ACCELERATION, ROLL, YAW_RATE, SignalName
from fifthwheel.results.assess.yaw_damping import SMALLEST_PEAK, decay
from fifthwheel.results.evaluate.evaluation import MethodResult
from fifthwheel.results.evaluate.motion import MeasuredMotion
from fifthwheel.results.evaluate.repetitions import RepeatedManoeuvre, Response, Words, crossing, findings
from fifthwheel.truck.spoken_names import named

HELD, RISE = 3.0, 0.5
"""Of a step: least duration, and longest time from 10 to 90 % of it, s."""
STEADY = 0.1
"""Largest standard deviation of the steer angle while it is steady, as a fraction of the step."""
BEFORE_END = 0.9
"""Fraction of the step after which signals are not used, since the driver may return."""
CLEAR = 4.5
"""Least overshoot for a peak response time, in standard deviations of the noise."""
LONGEST = 8.0
"""Of the steering of a lane change, s."""
FLAT = 0.5
"""Largest fraction of a lobe within a tenth of its peak; a sine has 0.29."""
WIDEST = 1.2
"""Longest pulse, s."""
NOISE = 5.0
"""Standard deviations of the noise above which a peak is used."""
DWELL = 0.3
"""Least time at the second peak of a sine with dwell, s."""
INSTANTS = (1.0, 1.75)
"""After the end of steering, s: those of passenger cars (ISO 19365)."""
RATIOS = {
    f"yaw_rate_ratio_{1000 * t:.0f}ms": Words(f"yaw rate ratio, {t:g} s after the steering", "1") for t in INSTANTS
}
FREE = {"lane change": 1.5, "pulse": 3.0, "sine with dwell": max(INSTANTS) + 0.2}
"""Least time without steering after a manoeuvre, s."""


def step(motion: MeasuredMotion) -> MethodResult:
    """The response of every yaw rate, lateral acceleration and roll angle to steps.

    Raises:
        SignalError: the log has no yaw rate of the first unit, or no step.
    """
    motion.output(f"yaw_rate.{motion.units[0]}")
    return findings(
        motion, [n for c in (YAW_RATE, LATERAL_ACCELERATION, ROLL) for n in motion.outputs(c.quantity)], STEP
    )


def lane_change(motion: MeasuredMotion) -> MethodResult:
    """The rearward amplification in lane changes.

    Raises:
        SignalError: the log has no lane change, or neither yaw rates nor lateral accelerations of first and last unit.
    """
    if len(motion.units) == 1:
        raise SignalError(f"{motion.name}: signals of one unit only; rearward amplification needs those of a trailer")
    pairs = amplified(motion)
    if not pairs:
        for unit in (motion.units[0], motion.units[-1]):
            motion.output(f"yaw_rate.{unit}")
    found = findings(motion, [name for pair in pairs for name in pair], LANE_CHANGE)
    return replace(found, notes=(*found.notes, compared(motion)))


def amplified(motion: MeasuredMotion) -> list[tuple[str, str]]:
    """First and last signal of each quantity whose amplification the log shows."""
    first, last = motion.units[0], motion.units[-1]
    pairs = [(f"{q}.{first}", f"{q}.{last}") for q in ("yaw_rate", "lateral_acceleration")]
    return [pair for pair in pairs if first != last and all(name in motion.signals for name in pair)]


def compared(motion: MeasuredMotion) -> str:
    """Which units a rearward amplification compares, or why there is none."""
    first, last = motion.units[0], motion.units[-1]
    order = "" if motion.vehicle else ", in the order of the columns, since no vehicle is given"
    if not amplified(motion):
        return (
            f"No rearward amplification, which needs the same signal of {first} and {last}, first and last unit{order}."
        )
    return f"Rearward amplification: {last} divided by {first}{order}."


def pulse(motion: MeasuredMotion) -> MethodResult:
    """The yaw damping by the decay after pulses.

    Raises:
        SignalError: the log has neither articulation angle nor yaw rate of the last unit, no pulse, or no two peaks
            above the noise.
    """
    last = motion.units[-1]
    names = [n for n in (f"articulation.{last}", f"yaw_rate.{last}") if n in motion.signals]
    if not names:
        motion.output(f"yaw_rate.{last}")
    for name in sorted(names, key=motion.references.__contains__):  # a measured one first
        found = findings(motion, [name], PULSE)
        if found.measures:
            return replace(found, notes=(*found.notes, f"Decay of {named(name)}."))
    raise SignalError(
        f"{name}: fewer than two peaks above the noise after the pulse in {motion.name}; steer a larger pulse, or "
        "the motion does not oscillate"
    )


def sine_with_dwell(motion: MeasuredMotion) -> MethodResult:
    """The ratios of every yaw rate after sines with dwell.

    Raises:
        SignalError: the log has no yaw rate of the first unit, or no sine with dwell.
    """
    motion.output(f"yaw_rate.{motion.units[0]}")
    return findings(motion, list(motion.outputs(YAW_RATE.quantity)), SINE_WITH_DWELL)


def _not_a_step(response: Response) -> str:
    if response.end < HELD:
        return f"no step that lasts at least {HELD:g} s, but steering for {response.end:.1f} s"
    last = response.steer[_steady(response)]
    if len(response.lobes) > 1 or last.std() > STEADY * abs(last.mean()):
        return "no step, the steer angle does not stay"
    rise = crossing(response.time, response.steer / last.mean(), 0.9)
    return f"no step, the steer angle rises for {rise:.1f} s" if rise > RISE else ""


def _not_a_lane_change(response: Response) -> str:
    if len(response.lobes) < 2:
        return "no lane change, the steer angle does not change its side"
    if response.end > LONGEST:
        return f"no single lane change, steering for {response.end:.1f} s"
    if max(np.mean(np.abs(lobe) > 0.9 * np.abs(lobe).max()) for lobe in response.lobes) > FLAT:
        return "no lane change, the steer angle stays at a peak"
    return _steered_again(response, "lane change")


def _not_a_pulse(response: Response) -> str:
    if len(response.lobes) > 1 or response.end > WIDEST:
        return f"no pulse, but steering for {response.end:.1f} s"
    return _steered_again(response, "pulse")


def _not_a_sine_with_dwell(response: Response) -> str:
    lobes, rate = response.lobes, 1 / (response.time[1] - response.time[0])
    if len(lobes) != 2:
        return "no sine with dwell, the steer angle does not change its side once"
    second = np.abs(lobes[1])
    if (second > 0.95 * second.max()).sum() < DWELL * rate:
        return f"no sine with dwell, the steer angle does not stay at its second peak for {DWELL:g} s"
    return _steered_again(response, "sine with dwell")


def _steered_again(response: Response, manoeuvre: str) -> str:
    least = FREE[manoeuvre]
    is_free = float(response.time[-1]) - response.end >= least
    return "" if is_free else f"no {least:g} s without steering after the {manoeuvre}"


def _of_a_step(response: Response) -> Mapping[str, float]:
    held = response.time <= BEFORE_END * response.end
    steady = _steady(response)
    steer = response.steer[steady].mean()
    start = crossing(response.time, response.steer / steer, 0.5)
    values: dict[str, float] = {}
    for name, output in response.outputs.items():
        final = output[steady].mean()
        relative = output / final
        at, highest = _peak(response.time[held], relative[held])
        values[f"steady_gain.{name}"] = float(final / steer)
        values[f"response_time.{name}"] = crossing(response.time, relative, 0.9) - start
        is_clear = highest - 1 > CLEAR * response.noise[name] / abs(final)
        values[f"peak_response_time.{name}"] = at - start if is_clear else float("nan")
        values[f"overshoot.{name}"] = highest - 1
    return values


def _steady(response: Response) -> NDArray[np.bool_]:
    return np.asarray((response.time > 2 / 3 * response.end) & (response.time <= BEFORE_END * response.end))


def _peak(time: Array, values: Array) -> tuple[float, float]:
    """Time and value of the largest of values (N,), by a parabola through it and its neighbours."""
    k = int(np.clip(np.argmax(values), 1, len(values) - 2))
    before, top, after = values[k - 1 : k + 2]
    bent = before - 2 * top + after
    shift = 0.5 * (before - after) / bent if bent < 0 else 0.0
    return float(time[k] + shift * (time[k] - time[k - 1])), float(top - 0.25 * (before - after) * shift)


def _of_a_lane_change(response: Response) -> Mapping[str, float]:
    peaks = {name: float(np.abs(values).max()) for name, values in response.outputs.items()}
    first, last = response.units[0], response.units[-1]
    quantities = dict.fromkeys(SignalName.of(name).quantity for name in peaks)
    return {f"rearward_amplification_{q}": peaks[f"{q}.{last}"] / peaks[f"{q}.{first}"] for q in quantities}


def _of_a_pulse(response: Response) -> Mapping[str, float]:
    ((name, output),) = response.outputs.items()
    smallest = max(NOISE * response.noise[name], SMALLEST_PEAK * float(np.abs(output).max()))
    damping = decay(output[response.time >= response.end], smallest)
    return {"yaw_damping": damping if damping is not None else float("nan")}


def _of_a_sine_with_dwell(response: Response) -> Mapping[str, float]:
    second = -np.sign(response.lobes[0][0]) * response.steer / np.abs(response.lobes[-1]).max()
    t = response.time
    changed = t[(t > 0) & (second > 0.3)][0]
    later = t > changed
    falls = [crossing(t[later], -second[later], -level) for level in (0.3, 0.1)]
    end = falls[1] + (falls[1] - falls[0]) / 2  # the last tenth of the steer angle, on the line through both
    values = {}
    for name, output in response.outputs.items():
        inside = output[(t > changed) & (t < end)]
        peak = inside[np.abs(inside).argmax()]
        for key, instant in zip(RATIOS, INSTANTS, strict=True):
            values[f"{key}.{name}"] = float(np.interp(end + instant, t, output) / peak)
    return values


STEP = RepeatedManoeuvre(
    fault=_not_a_step,
    measures=_of_a_step,
    words={
        "steady_gain": Words("steady gain", None),
        "response_time": Words("response time, 90 %", "s"),
        "peak_response_time": Words("peak response time", "s"),
        "overshoot": Words("overshoot", "1"),
    },
)
LANE_CHANGE = RepeatedManoeuvre(
    fault=_not_a_lane_change,
    measures=_of_a_lane_change,
    words={
        "rearward_amplification_yaw_rate": Words("rearward amplification, yaw rate", "1"),
        "rearward_amplification_lateral_acceleration": Words("rearward amplification, lateral acceleration", "1"),
    },
)
PULSE = RepeatedManoeuvre(
    fault=_not_a_pulse, measures=_of_a_pulse, words={"yaw_damping": Words("yaw damping, pulse", "1")}
)
SINE_WITH_DWELL = RepeatedManoeuvre(fault=_not_a_sine_with_dwell, measures=_of_a_sine_with_dwell, words=RATIOS)
