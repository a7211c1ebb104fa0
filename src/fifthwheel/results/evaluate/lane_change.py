"""Single lane change, ISO 14791:2000: rearward amplification in the time domain.

The largest magnitude of the last unit divided by that of the first one, of yaw rates, and of lateral accelerations
where both units have an accelerometer.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from fifthwheel.base.errors import SignalError
from fifthwheel.data.channels import SignalName
from fifthwheel.results.evaluate.evaluation import MethodResult
from fifthwheel.results.evaluate.motion import MeasuredMotion
from fifthwheel.results.evaluate.repetitions import Response, Words, findings

SHORTEST = 5.0
"""Least duration of a log, s."""
LONGEST = 8.0
"""Of the steering, s."""
FLAT = 0.5
"""Largest fraction of a lobe within a tenth of its peak; a sine has 0.29."""
FREE = 1.5
"""Least time without steering after a lane change, s."""
WORDS = {
    "rearward_amplification_yaw_rate": Words("rearward amplification, yaw rate", "1"),
    "rearward_amplification_lateral_acceleration": Words("rearward amplification, lateral acceleration", "1"),
}


def evaluate(motion: MeasuredMotion) -> MethodResult:
    """The rearward amplification of a motion.

    Raises:
        SignalError: the log has no lane change, or neither yaw rates nor lateral accelerations of first and last unit.
    """
    if len(motion.units) == 1:
        raise SignalError(f"{motion.name}: signals of one unit only; rearward amplification needs those of a trailer")
    pairs = amplified(motion)
    if not pairs:
        for unit in (motion.units[0], motion.units[-1]):
            motion.output(f"yaw_rate.{unit}")
    found = findings(motion, [name for pair in pairs for name in pair], measures, fault, WORDS)
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


def fault(response: Response) -> str:
    """Why a manoeuvre is no lane change."""
    if len(response.lobes) < 2:
        return "no lane change, the steer angle does not change its side"
    if response.end > LONGEST:
        return f"no single lane change, steering for {response.end:.1f} s"
    if max(np.mean(np.abs(lobe) > 0.9 * np.abs(lobe).max()) for lobe in response.lobes) > FLAT:
        return "no lane change, the steer angle stays at a peak"
    free = float(response.time[-1]) - response.end
    return f"no {FREE:g} s without steering after the lane change" if free < FREE else ""


def measures(response: Response) -> Mapping[str, float]:
    """The amplifications in one lane change."""
    peaks = {name: float(np.abs(values).max()) for name, values in response.outputs.items()}
    first, last = response.units[0], response.units[-1]
    quantities = dict.fromkeys(SignalName.of(name).quantity for name in peaks)
    return {f"rearward_amplification_{q}": peaks[f"{q}.{last}"] / peaks[f"{q}.{first}"] for q in quantities}
