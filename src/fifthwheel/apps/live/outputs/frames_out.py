"""States, status and parameters as CAN frames, and the DBC that describes them.

The messages have consecutive ids: status, then the states, two values with their sigmas in each, then the parameters,
one in each frame in turn. A 29-bit id counts in its parameter group number, an 11-bit id by one.
"""

import math
import re
import struct
from collections.abc import Sequence
from pathlib import Path

from fifthwheel.apps.live.node import Output
from fifthwheel.apps.live.status import LiveFault, NodeStatus
from fifthwheel.base.atomic import atomic_write
from fifthwheel.base.errors import FifthwheelError
from fifthwheel.data.channels import si_unit
from fifthwheel.data.logs.can.database import Frame
from fifthwheel.estimate.identify.verdict import Verdict
from fifthwheel.estimate.online import LearnedValue

SCALE = 1e-4
"""Resolution of states and sigmas, SI."""
NIS_SCALE = 0.01
_VALUE, _SIGMA = 0x7FFF, 0xFFFE
"""Largest raw value and raw sigma; beyond them is "not available"."""
_NO_VALUE, _NO_SIGMA = -0x8000, 0xFFFF
_VERDICTS = tuple(Verdict)
_LONGEST_NAME = 32
_PARAMETER = "Parameters"


class FrameEncoder:
    """Frames of the states and the learned parameters of a node, given by their names.

    `first` is the id of the status message, above 0x7FF of 29 bits; a FifthwheelError if the ids do not fit.
    """

    def __init__(self, first: int, states: Sequence[str], parameters: Sequence[str] = ()) -> None:
        self.extended = first > 0x7FF
        self.states, self.parameters = tuple(states), tuple(parameters)
        self._pairs = [self.states[i : i + 2] for i in range(0, len(self.states), 2)]
        step, largest = (0x100, 0x1FFFFFFF) if self.extended else (1, 0x7FF)
        self.ids = tuple(first + step * k for k in range(1 + len(self._pairs) + bool(parameters)))
        fits = first >> 16 == self.ids[-1] >> 16 if self.extended else True
        if not first >= 0 or self.ids[-1] > largest or not fits:
            raise FifthwheelError(
                f"--send {first:#x}: the {len(self.ids)} ids up to {self.ids[-1]:#x} do not fit; give a lower id, such "
                "as 0x500, or 0x18FF0080"
            )
        self._counter = 0

    def encode(self, output: Output, *, known: int = 0) -> list[Frame]:
        """The frames of status and states; `known` is the number of parameters with the verdict converged."""
        self._counter = (self._counter + 1) % 256
        nis = output.states.get("nis", math.nan)
        learning = output.states.get("learning", 0.0) > 0
        status = struct.pack(
            "<BBHHBB",
            output.status,
            self._counter,
            output.faults,
            min(round(nis / NIS_SCALE), _SIGMA) if math.isfinite(nis) else _NO_SIGMA,
            min(known, 255),
            learning,
        )
        frames = [self._frame(0, output.bus_time, status)]
        for k, pair in enumerate(self._pairs, 1):
            data = b"".join(
                _packed(output.states.get(name, math.nan), output.states.get(f"{name}.sigma", math.nan))
                for name in pair
            )
            frames.append(self._frame(k, output.bus_time, data.ljust(8, b"\xff")))
        return frames

    def encode_parameter(self, estimate: LearnedValue, time: float) -> Frame:
        """The frame of one learned parameter: number, verdict, relative sigma, value."""
        relative = abs(estimate.sigma / estimate.value) if estimate.value else math.inf
        data = struct.pack(
            "<BBHf",
            self.parameters.index(estimate.name),
            _VERDICTS.index(estimate.verdict),
            min(round(relative / SCALE), _SIGMA) if math.isfinite(relative) else _NO_SIGMA,
            estimate.value,
        )
        return self._frame(-1, time, data)

    def _frame(self, k: int, time: float, data: bytes) -> Frame:
        return Frame(time, self.ids[k], data, self.extended)

    def dbc(self) -> str:
        """The messages as a DBC file."""
        number = [i | 0x80000000 if self.extended else i for i in self.ids]
        statuses = " ".join(f'{s.value} "{s.name}"' for s in NodeStatus)
        verdicts = " ".join(f'{i} "{v.value}"' for i, v in enumerate(_VERDICTS))
        bits = ", ".join(f"{fault.value} {fault.name}" for fault in LiveFault)
        lines = ['VERSION ""', "NS_ :", "BS_:", "BU_: fifthwheel", f"BO_ {number[0]} Status: 8 fifthwheel"]
        lines += [
            _signal("status", 0, 8),
            _signal("counter", 8, 8),
            _signal("faults", 16, 16),
            _signal("nis", 32, 16, scale=NIS_SCALE, largest=_SIGMA),
            _signal("known_parameters", 48, 8),
            _signal("learning", 56, 8),
        ]
        comments = [f'CM_ SG_ {number[0]} faults "Sum of: {bits}.";']
        values = [f"VAL_ {number[0]} status {statuses} ;", f'VAL_ {number[0]} nis {_NO_SIGMA} "not available" ;']
        for i, pair in zip(number[1:], self._pairs, strict=False):
            lines += ["", f"BO_ {i} {_identifier('States ' + ' '.join(pair))}: 8 fifthwheel"]
            for k, name in enumerate(pair):
                signal, unit = _identifier(name), si_unit(name) or ""
                sigma = _identifier(f"{name}.sigma")
                lines.append(_signal(signal, 32 * k, 16, signed=True, scale=SCALE, largest=_VALUE, unit=unit))
                lines.append(_signal(sigma, 32 * k + 16, 16, scale=SCALE, largest=_SIGMA, unit=unit))
                comments.append(f'CM_ SG_ {i} {signal} "{name}, valid if its raw value is not {_NO_VALUE}.";')
                values.append(f'VAL_ {i} {signal} {_NO_VALUE} "not available" ;')
                values.append(f'VAL_ {i} {sigma} {_NO_SIGMA} "not available" ;')
        if self.parameters:
            i = number[-1]
            lines += ["", f"BO_ {i} {_PARAMETER}: 8 fifthwheel", _signal("parameter M", 0, 8)]
            lines += [_signal("verdict", 8, 8), _signal("relative_sigma", 16, 16, scale=SCALE, largest=_SIGMA)]
            values.append(f"VAL_ {i} verdict {verdicts} ;")
            values.append(f'VAL_ {i} relative_sigma {_NO_SIGMA} "not available" ;')
            floats = []
            for k, name in enumerate(self.parameters):
                lines.append(_signal(f"{_identifier(name)} m{k}", 32, 32, signed=True))
                comments.append(f'CM_ SG_ {i} {_identifier(name)} "{name}, SI.";')
                floats.append(f"SIG_VALTYPE_ {i} {_identifier(name)} : 1;")
            values += floats
        return "\n".join([*lines, "", *comments, *values, ""])

    def write_dbc(self, path: Path) -> None:
        """Write the DBC; OSError if it cannot be written."""
        with atomic_write(path) as temporary:
            temporary.write_text(self.dbc(), encoding="cp1252")


def _packed(value: float, sigma: float) -> bytes:
    """A value and its sigma; a value beyond the range saturates."""
    if not math.isfinite(value):
        return struct.pack("<hH", _NO_VALUE, _NO_SIGMA)
    raw = max(-_VALUE, min(_VALUE, round(value / SCALE)))
    return struct.pack("<hH", raw, min(_SIGMA, round(sigma / SCALE)) if math.isfinite(sigma) else _NO_SIGMA)


def _signal(
    name: str, start: int, length: int, *, signed: bool = False, scale: float = 1, largest: int = 0, unit: str = ""
) -> str:
    """A line SG_; without `largest` there is no range."""
    low, high, sign = -largest * scale if signed else 0, largest * scale, "-" if signed else "+"
    return f' SG_ {name} : {start}|{length}@1{sign} ({scale:g},0) [{low:g}|{high:g}] "{unit}" Vector__XXX'


def _identifier(name: str) -> str:
    """A name that a DBC may have: letters, digits and underscores, of at most 32 characters."""
    text = re.sub(r"\W", "_", name, flags=re.ASCII)
    if len(text) <= _LONGEST_NAME:
        return text
    words = text.split("_")
    return "_".join(word[: max(1, _LONGEST_NAME // len(words) - 1)] for word in words)[:_LONGEST_NAME]
