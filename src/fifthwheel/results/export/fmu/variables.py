"""Variables of an FMU: their roles, units and limits, and their table in C."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from fifthwheel.data.channels import SignalName, si_unit


class Role(StrEnum):
    """Role of a variable; the value is its name in C."""

    TIME = "FMU_TIME"
    INPUT = "FMU_INPUT"
    FIXED = "FMU_FIXED"
    TUNABLE = "FMU_TUNABLE"
    OUTPUT = "FMU_OUTPUT"
    INTEGER_OUTPUT = "FMU_INTEGER_OUTPUT"


@dataclass(frozen=True, kw_only=True)
class Variable:
    """A variable; its value reference is its place among the variables of the FMU."""

    name: str
    role: Role
    unit: str | None  # SI; None for an integer
    description: str
    start: float = 0.0  # of inputs and parameters
    limits: tuple[float, float] | None = None  # of inputs and parameters; None if every value is accepted


@dataclass(frozen=True, kw_only=True)
class FmuModel:
    """What an FMU contains: its variables and the C of its model."""

    name: str  # of the vehicle and of what the FMU computes
    description: str
    variables: tuple[Variable, ...]
    interpolates: bool  # whether it uses the derivatives of its inputs
    step: float  # recommended communication step, s
    header: str  # C: macros and the type fmu_model
    sources: dict[str, str]  # C files by name, besides those of every FMU
    notes: tuple[str, ...]  # for its documentation

    @property
    def identifier(self) -> str:
        """Name of its shared library, an identifier of C."""
        text = "".join(c if c.isascii() and c.isalnum() else "_" for c in self.name)
        return text if text[:1].isalpha() else f"model_{text}"


def of_signal(signal: str, role: Role, words: str = "", name: str = "", **limits: Any) -> Variable:
    """The variable of a signal, by default under its own name, described by the words and what the signal is."""
    description = f"{words} {described(signal)}".strip()
    return Variable(name=name or signal, role=role, unit=si_unit(signal), description=description, **limits)


TIME = Variable(name="time", role=Role.TIME, unit="s", description="time")


def described(name: str) -> str:
    """Description of a signal: "yaw_rate.tractor" -> "yaw rate of tractor"."""
    signal = SignalName.of(name)
    quantity = signal.quantity.replace("_", " ")
    return f"{quantity} of {signal.place}" if signal.place else f"{quantity} of the vehicle"


def table(variables: Sequence[Variable]) -> str:
    """C of the table of the variables."""
    rows = [f"    {{{_row(variable)}}}, /* {variable.name} */" for variable in variables]
    return "\n".join(['#include "fmu.h"', "", "const fmu_variable fmu_variables[FMU_COUNT] = {", *rows, "};", ""])


def _row(variable: Variable) -> str:
    least, most = variable.limits or (0.0, 0.0)
    cure = "connect it, in SI units" if variable.role is Role.INPUT else "set it in SI units"
    expected = f'"{variable.name}: expected {least:.6g} to {most:.6g} {variable.unit}; {cure}"'
    return f"{variable.role}, {variable.start!r}, {least!r}, {most!r}, {expected if variable.limits else 'NULL'}"
