"""Which signals are inverted: the most usual frames of devices that explain the signs of all signals together.

In a turn the sign of each signal follows from that of any other one. Two explanations remain, each the mirror image of
the other. A device has one frame: x forward, y left, z up of ISO 8855 inverts nothing; z down (FRD, NED, SAE J670)
inverts yaw rate and lateral acceleration, but no roll. A body rolls outwards: the roll shows which side is left.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from fifthwheel.data.channels import ARTICULATION, STEER, WHEEL_SPEED_DIFFERENCE, SignalName, is_of

_Z_DOWN = frozenset({"yaw_rate", "lateral_acceleration"})
_FRAMES = {
    frozenset[str](): 0.0,
    _Z_DOWN: 2.0,
    frozenset({"lateral_acceleration", "roll_rate", "roll"}): 3.0,
    frozenset({"yaw_rate", "roll_rate", "roll"}): 4.0,
}
"""What the frame of a device inverts: usual, z down, one that faces backwards, and both; with minus the logarithm of
how common it is."""
_CHANNEL = {"yaw_rate": 3.0, "lateral_acceleration": 3.0, "roll_rate": 4.0, "roll": 4.0}
"""The same of one channel that the frame of its device does not explain."""
_AGAIN = 0.4
"""Fraction of it where another unit has the same already."""
_STEER, _ARTICULATION, _WHEELS = 1.5, 0.7, 1.5
"""Of a steer angle, of an articulation, and of exchanged wheel speeds, of one axle or of all."""
_STEER_Z_DOWN = 0.5
"""Of a steer angle in a log whose devices are z down."""
_SIGN = 0.3
"""Of each inverted signal: where all else is equal, the fewest are."""


@dataclass(frozen=True, kw_only=True)
class Signs:
    """The two explanations of the signs."""

    inverted: tuple[str, ...]
    """The inverted signals of the more likely one."""
    others: tuple[str, ...]
    """Those of the mirror image: all other signals whose sign is clear."""
    margin: float
    """Logarithm of the odds of the first one."""


def likely_signs(signs: Mapping[str, int]) -> Signs:
    """The explanations of signs relative to the first signal, by signal."""
    one, other = (tuple(name for name, sign in signs.items() if sign == wanted) for wanted in (-1, 1))
    margin = _cost(other, signs) - _cost(one, signs) if one else np.inf
    return (
        Signs(inverted=one, others=other, margin=margin)
        if margin >= 0
        else Signs(inverted=other, others=one, margin=-margin)
    )


def _cost(inverted: Collection[str], names: Collection[str]) -> float:
    """Minus the logarithm of how usual it is that these of the signals are inverted, and the others are not."""
    seen: list[tuple[frozenset[str], tuple[str, ...]]] = []
    cost = _SIGN * len(inverted)
    for unit in dict.fromkeys(SignalName.of(name).unit for name in names):
        device = {name: SignalName.of(name).quantity for name in names if SignalName.of(name).unit == unit}
        options = []
        for frame, usual in _FRAMES.items():
            wrong = tuple(q for name, q in device.items() if q in _CHANNEL and (name in inverted) != (q in frame))
            fraction = _AGAIN if (frame, wrong) in seen else 1.0
            options.append((fraction * (usual + sum(_CHANNEL[q] for q in wrong)), frame, wrong))
        best, frame, wrong = min(options, key=lambda option: option[0])
        cost += best
        seen.append((frame, wrong))
    z_down = any(frame == _Z_DOWN for frame, _ in seen)
    cost += (_STEER_Z_DOWN if z_down else _STEER) * any(is_of(name, STEER) for name in inverted)
    cost += _ARTICULATION * any(is_of(name, ARTICULATION) for name in inverted)
    return cost + _WHEELS * any(is_of(name, WHEEL_SPEED_DIFFERENCE) for name in inverted)
