"""Signals, numbers and tables as text of C, and those that an observer and a learner have in common."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import casadi as ca
import numpy as np

from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.native import c_code
from fifthwheel.data.channels import si_unit
from fifthwheel.estimate.filters.initial_state import STEER_BANDWIDTH, TYPICAL_STEER_SIGMA, initial_sigma
from fifthwheel.estimate.stream import StreamSettings
from fifthwheel.model.dynamics.chain import state_names
from fifthwheel.model.dynamics.simulation import SPEEDS, step_limit
from fifthwheel.model.dynamics.speed_rate import speed_rate_step
from fifthwheel.truck import Vehicle

LARGEST = 1e30
"""In place of an infinite setting: a number that fits into single precision."""


def identifier(prefix: str, signal: str) -> str:
    """Name of a signal as an enumerator of C: FW_INPUT_STEER_TRACTOR_FRONT for steer.tractor.front."""
    return f"FW_{prefix}_" + "".join(c if c.isascii() and c.isalnum() else "_" for c in signal).upper()


def enumerations(groups: Mapping[str, Mapping[str, str]]) -> list[str]:
    """Lines of enumerations: of each group its prefix, with its names and the text behind each.

    Raises:
        FifthwheelError: two names of a group have the same identifier.
    """
    lines: list[str] = []
    for prefix, names in groups.items():
        identifiers = [identifier(prefix, name) for name in names]
        if len(set(identifiers)) < len(names):
            raise FifthwheelError(f"{', '.join(names)}: two names are equal in C; rename a unit in the vehicle file")
        lines += [f"#define FW_{prefix}_COUNT {len(names)}", f"enum fw_{prefix.lower()} {{"]
        lines += [
            f"    {key} = {i}, /* {name}, {text} */"
            for i, (key, (name, text)) in enumerate(zip(identifiers, names.items(), strict=True))
        ]
        lines += ["};", ""]
    return lines


def header(stream: StreamSettings, states: Iterable[str], sizes: Mapping[str, tuple[int, str]], **groups: Any) -> str:
    """Enumerations of signals, states and other groups, and sizes with a comment each, for the public header."""
    signals = {"INPUT": [rule.name for rule in stream.inputs], "MEASURED": stream.measured, "STATE": states}
    units = {prefix: {name: str(si_unit(name)) for name in names} for prefix, names in signals.items()}
    defined = [f"#define FW_{name} {size} /* {text} */" for name, (size, text) in sizes.items()]
    return "\n".join([*enumerations(units | groups), *defined])


def definitions(
    sizes: Mapping[str, int], numbers: Mapping[str, float], times: Mapping[str, float] | None = None
) -> list[str]:
    """Lines that define integers, real numbers and times in s."""
    return [
        *(f"#define FW_{name} {size}" for name, size in sizes.items()),
        *(f"#define FW_{name} {c_code.literal(min(float(value), LARGEST))}" for name, value in numbers.items()),
        *(f"#define FW_{name} {min(float(value), LARGEST)!r} /* s */" for name, value in (times or {}).items()),
    ]


def table(name: str, values: Iterable[float], *, static: bool = True) -> str:
    """A constant array of real numbers."""
    numbers = [c_code.literal(float(value)) if value <= LARGEST else "FW_REAL_MAX" for value in values]
    return f"{'static ' if static else ''}const fw_real fw_{name}[{len(numbers)}] = {{{', '.join(numbers)}}};"


def integers(name: str, values: Sequence[int]) -> str:
    """A constant array of integers of 16 bits."""
    return f"const int16_t fw_{name}[{len(values)}] = {{{', '.join(map(str, values))}}};"


def texts(name: str, values: Iterable[str]) -> str:
    """A constant array of texts."""
    quoted = [f'"{value}"' for value in values]
    return f"const char *const fw_{name}[{len(quoted)}] = {{{', '.join(quoted)}}};"


def stream_definitions(stream: StreamSettings, vehicle: Vehicle, *, roll: bool) -> list[str]:
    """Definitions for fw_stream.h and fw_algebra.h."""
    return definitions(
        {"MODEL_STATES": len(state_names(vehicle, roll=roll)), "SPEED_COUNT": len(SPEEDS)},
        {
            "MIN_SPEED": stream.min_speed,
            "STEER_RATE": 2 * np.pi * STEER_BANDWIDTH,
            "TYPICAL_STEER_SIGMA": TYPICAL_STEER_SIGMA,
        },
        {"HOLD": stream.hold, "MAX_GAP": stream.max_gap, "COAST": stream.coast},
    )


def stream_tables(stream: StreamSettings, vehicle: Vehicle, *, roll: bool, static: bool) -> list[str]:
    """Tables for fw_stream.h and the start of a filter, and the columns of a log."""
    columns = ("time", *(rule.name for rule in stream.inputs), *stream.measured)
    states = state_names(vehicle, roll=roll)
    speed_rate = with_constant(speed_rate_step().step, ca.DM([1 / stream.speed_smoothing]))
    tables: dict[str, Iterable[float]] = {
        "input_magnitude": [rule.largest for rule in stream.inputs],
        "input_jump": [rule.jump for rule in stream.inputs],
        "input_rate": [rule.rate for rule in stream.inputs],
        "measured_magnitude": stream.measured.values(),
        "initial_variance": [initial_sigma(name) ** 2 for name in states],
        "step_speed": SPEEDS,
        "step_limit": step_limit(vehicle, roll).longest,
    }
    return [
        *(table(name, values, static=static) for name, values in tables.items()),
        texts("names", columns),
        texts("units", [str(si_unit(name)) for name in columns]),
        c_code.function(speed_rate, "fw_speed_rate", ("carry", "sample"), ("next", "out"), static=static),
    ]


def with_constant(step: ca.Function, constant: ca.DM) -> ca.Function:
    """A step (carry, sample, constant) with its constant as numbers."""
    carry, sample = ca.SX.sym("carry", step.numel_in(0)), ca.SX.sym("sample", step.numel_in(1))
    return c_code.step("step", [carry, sample], [*step(carry, sample, constant)])
