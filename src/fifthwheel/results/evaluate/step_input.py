"""Step input, ISO 14793:2011: gains, response times and overshoots after a step of the steer angle.

Time counts from the instant at which the steer angle has half of its step. The response time is that of the first 90 %
of the steady value, the peak response time that of the largest value where it is clear of noise. The overshoot is the
largest value less the steady one, divided by the steady one. Steady values are means over the last third of the step,
without the end, where the driver may return.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from fifthwheel.base.types import Array
from fifthwheel.data.channels import LATERAL_ACCELERATION, ROLL, YAW_RATE
from fifthwheel.results.evaluate.evaluation import MethodResult
from fifthwheel.results.evaluate.motion import MeasuredMotion
from fifthwheel.results.evaluate.repetitions import Response, Words, crossing, findings

SHORTEST = 5.0
"""Least duration of a log, s."""
HELD = 3.0
"""Least duration of a step, s."""
RISE = 0.5
"""Longest time from 10 to 90 % of the step, s."""
STEADY = 0.1
"""Largest standard deviation of the steer angle while it is steady, as a fraction of the step."""
BEFORE_END = 0.9
"""Fraction of the step after which signals are not used, since the driver may return."""
CLEAR = 4.5
"""Least overshoot for a peak response time, in standard deviations of the noise."""
WORDS = {
    "steady_gain": Words("steady gain", None),
    "response_time": Words("response time, 90 %", "s"),
    "peak_response_time": Words("peak response time", "s"),
    "overshoot": Words("overshoot", "1"),
}


def evaluate(motion: MeasuredMotion) -> MethodResult:
    """The response of every yaw rate, lateral acceleration and roll angle.

    Raises:
        SignalError: the log has no yaw rate of the first unit, or no step.
    """
    motion.output(f"yaw_rate.{motion.units[0]}")
    outputs = [name for c in (YAW_RATE, LATERAL_ACCELERATION, ROLL) for name in motion.outputs(c.quantity)]
    return findings(motion, outputs, measures, fault, WORDS)


def fault(response: Response) -> str:
    """Why a manoeuvre is no step."""
    if response.end < HELD:
        return f"no step that lasts at least {HELD:g} s, but steering for {response.end:.1f} s"
    last = response.steer[_steady(response)]
    if len(response.lobes) > 1 or last.std() > STEADY * abs(last.mean()):
        return "no step, the steer angle does not stay"
    rise = crossing(response.time, response.steer / last.mean(), 0.9)
    return f"no step, the steer angle rises for {rise:.1f} s" if rise > RISE else ""


def measures(response: Response) -> Mapping[str, float]:
    """The measures of one step."""
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
