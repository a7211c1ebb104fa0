"""Sine with dwell, ISO 18375:2016: ratios of the yaw rate after the steering to its second peak.

A ratio is the yaw rate at `INSTANTS` after the end of steering divided by the one with the largest magnitude since the
steer angle changed its side; it is negative if the yaw rate has changed its side. The standard is for low friction, and
for trucks with stability control.
"""

from collections.abc import Mapping

import numpy as np

from fifthwheel.data.channels import YAW_RATE
from fifthwheel.results.evaluate.evaluation import MethodResult
from fifthwheel.results.evaluate.motion import MeasuredMotion
from fifthwheel.results.evaluate.repetitions import Response, Words, crossing, findings

SHORTEST = 6.0
"""Least duration of a log, s."""
INSTANTS = (1.0, 1.75)
"""After the end of steering, s: those of passenger cars (ISO 19365)."""
DWELL = 0.3
"""Least time at the second peak, s."""
WORDS = {
    f"yaw_rate_ratio_{1000 * t:.0f}ms": Words(f"yaw rate ratio, {t:g} s after the steering", "1") for t in INSTANTS
}


def evaluate(motion: MeasuredMotion) -> MethodResult:
    """The ratios of every yaw rate.

    Raises:
        SignalError: the log has no yaw rate of the first unit, or no sine with dwell.
    """
    motion.output(f"yaw_rate.{motion.units[0]}")
    return findings(motion, list(motion.outputs(YAW_RATE.quantity)), measures, fault, WORDS)


def fault(response: Response) -> str:
    """Why a manoeuvre is no sine with dwell."""
    lobes, rate = response.lobes, 1 / (response.time[1] - response.time[0])
    if len(lobes) != 2:
        return "no sine with dwell, the steer angle does not change its side once"
    second = np.abs(lobes[1])
    if (second > 0.95 * second.max()).sum() < DWELL * rate:
        return f"no sine with dwell, the steer angle does not stay at its second peak for {DWELL:g} s"
    if response.time[-1] - response.end < max(INSTANTS) + 0.2:
        return f"no {max(INSTANTS) + 0.2:g} s without steering after the sine with dwell"
    return ""


def measures(response: Response) -> Mapping[str, float]:
    """The ratios in one manoeuvre."""
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
        for key, instant in zip(WORDS, INSTANTS, strict=True):
            values[f"{key}.{name}"] = float(np.interp(end + instant, t, output) / peak)
    return values
