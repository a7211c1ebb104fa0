"""Pulse input, ISO 14791:2000: yaw damping by the decay after a pulse of the steer angle.

The decrement of successive peaks of the last articulation angle, or of the last yaw rate without it (measured ones
before reference signals, where they have two peaks above the noise), gives the damping ratio as in
`results.assess.yaw_damping`. Peaks within `NOISE` standard deviations of the noise are not used.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from fifthwheel.base.errors import SignalError
from fifthwheel.results.assess.yaw_damping import SMALLEST_PEAK, decay
from fifthwheel.results.evaluate.evaluation import MethodResult
from fifthwheel.results.evaluate.motion import MeasuredMotion
from fifthwheel.results.evaluate.repetitions import Response, Words, findings
from fifthwheel.truck.spoken_names import named

SHORTEST = 5.0
"""Least duration of a log, s."""
WIDEST = 1.2
"""Longest pulse, s."""
FREE = 3.0
"""Least time without steering after the pulse, s."""
NOISE = 5.0
"""Standard deviations of the noise above which a peak is used."""
WORDS = {"yaw_damping": Words("yaw damping, pulse", "1")}


def evaluate(motion: MeasuredMotion) -> MethodResult:
    """The yaw damping of a motion.

    Raises:
        SignalError: the log has neither articulation angle nor yaw rate of the last unit, no pulse, or no two peaks
            above the noise.
    """
    last = motion.units[-1]
    names = [n for n in (f"articulation.{last}", f"yaw_rate.{last}") if n in motion.signals]
    if not names:
        motion.output(f"yaw_rate.{last}")
    for name in sorted(names, key=motion.references.__contains__):  # a measured one first
        found = findings(motion, [name], measures, fault, WORDS)
        if found.measures:
            return replace(found, notes=(*found.notes, f"Decay of {named(name)}."))
    raise SignalError(
        f"{name}: fewer than two peaks above the noise after the pulse in {motion.name}; steer a larger pulse, or "
        "the motion does not oscillate"
    )


def fault(response: Response) -> str:
    """Why a manoeuvre is no pulse."""
    if len(response.lobes) > 1 or response.end > WIDEST:
        return f"no pulse, but steering for {response.end:.1f} s"
    free = float(response.time[-1]) - response.end
    return f"no {FREE:g} s without steering after the pulse" if free < FREE else ""


def measures(response: Response) -> Mapping[str, float]:
    """The damping ratio of one decay; NaN with fewer than two peaks."""
    ((name, output),) = response.outputs.items()
    smallest = max(NOISE * response.noise[name], SMALLEST_PEAK * float(np.abs(output).max()))
    damping = decay(output[response.time >= response.end], smallest)
    return {"yaw_damping": damping if damping is not None else float("nan")}
