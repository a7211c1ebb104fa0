"""What own equations of the steering use and return, and which functions are refused; `steering` says what they are."""

import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import casadi as ca
import numpy as np

from fifthwheel.base.errors import SignalError, VehicleError
from fifthwheel.base.native import own_function
from fifthwheel.base.native.own_function import Fault, name_of
from fifthwheel.base.types import Array

ARGUMENTS = ("steer", "states", "motion", "p")
SPEEDS = (3.0, 20.0)
"""At which the equations are checked, m/s."""


class _Used(dict[str, ca.SX]):
    """Symbols for whatever names a function looks up."""

    def __missing__(self, name: str) -> ca.SX:
        self[name] = symbol = ca.SX.sym(name)
        return symbol


@dataclass(frozen=True)
class Trace:
    """What equations use and return; made by `trace`."""

    used: Mapping[str, tuple[str, ...]]
    """Names by argument."""
    symbols: ca.SX
    """(n,) of these names, in the same order."""
    wheels: Mapping[str, ca.SX]
    rates: Mapping[str, ca.SX]

    @cached_property
    def outputs(self) -> ca.SX:
        """(m,) wheels, then rates."""
        return ca.vertcat(ca.SX(0, 1), *self.wheels.values(), *self.rates.values())

    @cached_property
    def slopes(self) -> ca.SX:
        """Derivatives (m, n) of the outputs by the symbols."""
        return ca.jacobian(self.outputs, self.symbols)

    @cached_property
    def values(self) -> dict[str, float]:
        """The outputs at arbitrary inputs: they identify the equations."""
        names = [f"{argument}.{name}" for argument in ARGUMENTS for name in self.used[argument]]
        at = self._at([0.1 + 0.9 * zlib.crc32(name.encode()) / 2**32 for name in names], self.outputs)
        places = [f"in the {kind} {name}" for kind in ("wheels", "rates") for name in getattr(self, kind)]
        return dict(zip(places, at.ravel().tolist(), strict=True))

    @cached_property
    def digest(self) -> str:
        """All that determines the equations."""
        shown = self.used, tuple(self.wheels), tuple(self.rates)
        function = ca.Function("equations", [self.symbols], [ca.densify(self.outputs)])
        return repr(shown) + own_function.digest(function)

    @cached_property
    def code_faults(self) -> tuple[Fault, ...]:
        """Why there is no C code of the equations."""
        return tuple(own_function.code_faults([self.symbols], [self.outputs, self.slopes]))

    def faults_at_zero(self, parameters: Mapping[str, float]) -> Iterator[Fault]:
        """Which outputs are not 0, or not smooth, where all but the speed is 0."""
        for speed in SPEEDS:
            given = {"motion": {"speed": speed}, "p": parameters}
            at = [given.get(a, {}).get(name, 0.0) for a in ARGUMENTS for name in self.used[a]]
            for name, value in zip((*self.wheels, *self.rates), self._at(at, self.outputs).ravel(), strict=True):
                if value != 0:
                    cure = "use functions of casadi, not of math, and avoid 0 / 0"
                    yield f"0 where all is 0, of {name}", f"{value:g}", cure
            if not np.isfinite(self._at(at, self.slopes)).all():
                yield "finite derivatives where all is 0", "others", "let the equations be smooth there"

    def _at(self, inputs: list[float], outputs: ca.SX) -> Array:
        return np.asarray(ca.Function("equations", [self.symbols], [outputs])(inputs), dtype=np.float64)


@lru_cache(maxsize=64)
def trace(equations: Any) -> Trace:
    """What equations use and return; any error of the function itself, or a TypeError for another result.

    A constant of their module that changes later has no effect: it should be a parameter.
    """
    used = [_Used() for _ in ARGUMENTS]
    results = equations(*used)
    if not (isinstance(results, tuple) and len(results) == 2 and all(isinstance(r, Mapping) for r in results)):
        raise TypeError("no pair of dictionaries")
    wheels, rates = ({name: ca.SX(value) for name, value in sorted(result.items())} for result in results)
    for name, value in (*wheels.items(), *rates.items()):
        if not value.is_scalar():
            raise TypeError(f"{name} with {value.numel()} elements")
    ordered = [dict(sorted(symbols.items())) for symbols in used]
    names = {argument: tuple(symbols) for argument, symbols in zip(ARGUMENTS, ordered, strict=True)}
    symbols = ca.vertcat(ca.SX(0, 1), *[symbol for of in ordered for symbol in of.values()])
    return Trace(names, symbols, wheels, rates)


def stored(equations: Any) -> dict[str, Any]:
    """For JSON: the name of the function, and values that identify it."""
    return {"function": name_of(equations), "values": trace(equations).values}


def found(value: Any) -> Any:
    """The equations, also from their name or what `stored` gives.

    A VehicleError if it is not imported, another one, or no function of the arguments with scalar results.
    """
    saved: Any = {"function": value, "values": {}} if isinstance(value, str) else value
    if isinstance(saved, Mapping):
        try:
            name, values = str(saved["function"]), dict[str, float](saved["values"])
            return own_function.restored("equations", name, values, _require, lambda f: trace(f).values)
        except (SignalError, LookupError) as error:
            raise VehicleError(str(error)) from None
    _require(value)
    return value


def message(equations: Any, fault: Fault) -> str:
    """What a fault of the equations is, in words."""
    expected, got, cure = fault
    return f"equations, {name_of(equations)}: expected {expected}, got {got}; {cure}"


def _require(equations: Any) -> None:
    for fault in _definition_faults(equations):
        raise VehicleError(message(equations, fault))


def _definition_faults(equations: Any) -> Iterator[Fault]:
    if not callable(equations):
        yield "a function", repr(equations), "give a function of a module"
    yield from own_function.definition_faults(equations, ARGUMENTS)
    try:
        trace(equations)
    except TypeError as error:
        yield "wheels and rates, two dictionaries of scalars", str(error), "return both, {} for none"
    except Exception as error:
        yield own_function.expression_fault(error)
