"""The model of an observer: the chain with further unknowns, the bank of the road and the offsets of sensors.

The offsets are states. The bank is a state if measurements are to correct it, otherwise a parameter.
"""

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import casadi as ca
import numpy as np

from fifthwheel import dynamics
from fifthwheel._lazy import lazy
from fifthwheel._types import Array
from fifthwheel.dynamics import ChainModel
from fifthwheel.dynamics.chain import BANK
from fifthwheel.dynamics.saturation import TyreLaw
from fifthwheel.vehicle import Vehicle


@dataclass(frozen=True, kw_only=True, eq=False)
class ObservedChain:
    """A `filters.model.Model` without parameters p, built by `observed_chain`.

    The states are those of the chain, then the offsets.
    """

    chain: ChainModel
    offsets: tuple[str, ...]
    """Names of the offsets, those of the steer angles first. `chain.free` are those that it depends on."""
    estimates_bank: bool
    """Whether the bank is a state, the last one of the chain; otherwise it is the last parameter of c."""

    @property
    def identity(self) -> tuple[object, ...]:
        """All that determines the functions."""
        return "observed chain", self.chain.identity, self.offsets, self.estimates_bank

    @property
    def sizes(self) -> tuple[int, int, int, int, int]:
        """Numbers of elements of x, d, p, c and y."""
        return len(self.states), 2 * len(self.inputs), 0, len(self.known), len(self.outputs)

    @property
    def transition(self) -> ca.Function:
        """(x, dt, d, p, c) -> x+, the state dt seconds later."""
        return self._functions.transition

    @property
    def observation(self) -> ca.Function:
        """(x, d, p, c) -> y"""
        return self._functions.observation

    @property
    def state_jacobian(self) -> ca.Function:
        """(x, dt, d, p, c) -> dx+/dx (n, n)."""
        return self._functions.state_jacobian

    @lazy
    def _functions(self) -> "_Functions":
        return _build(self)

    @property
    def roll(self) -> bool:
        """Whether the chain has roll."""
        return self.chain.roll

    @property
    def unknowns(self) -> tuple[str, ...]:
        """Names of the bank and of the offsets."""
        return (BANK, *self.offsets)

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states."""
        return (*(self.chain.states if self.estimates_bank else self.chain.states[:-1]), *self.offsets)

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs of the chain."""
        return self.chain.inputs

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs."""
        return self.chain.outputs

    @property
    def known(self) -> tuple[str, ...]:
        """Names of c."""
        return self.chain.known if self.estimates_bank else (*self.chain.known, BANK)

    def known_values(self, values: Mapping[str, float]) -> Array:
        """c from values by name, SI."""
        return np.array([values[name] for name in self.known], dtype=np.float64)


def observed_chain(
    vehicle: Vehicle,
    outputs: Sequence[str],
    *,
    accelerometers: Sequence[str] = (),
    roll: bool,
    estimate_bank: bool,
    tyres: TyreLaw = "linear",
) -> ObservedChain:
    """The model of a vehicle; vehicles of equal topology share one model.

    Args:
        vehicle, outputs, roll: as in `dynamics.model`, also the errors.
        accelerometers: signals whose offsets are states, whether or not they are among the outputs.
        estimate_bank: whether the bank is a state.
        tyres: law of the side forces; with saturating tyres, the derivative of the speed is an input.
    """
    offsets = tuple(f"{name}.offset" for name in (*vehicle.steer_signals(), *accelerometers))
    known, braking = dynamics.all_parameters(vehicle, outputs), tyres == "saturating"
    free = tuple(name for name in offsets if name in known)
    chain = dynamics.model(vehicle, outputs, roll=roll, bank=True, free=free, tyres=tyres, braking=braking)
    return _observed_chain(chain, offsets, estimate_bank)


@functools.cache
def _observed_chain(chain: ChainModel, offsets: tuple[str, ...], estimate_bank: bool) -> ObservedChain:
    return ObservedChain(chain=chain, offsets=offsets, estimates_bank=estimate_bank)


class _Functions(NamedTuple):
    """The functions of a model."""

    transition: ca.Function
    observation: ca.Function
    state_jacobian: ca.Function


def _build(model: ObservedChain) -> _Functions:
    """Build the symbolic functions."""
    chain, considered = model.chain, not model.estimates_bank
    n, m = len(chain.states) - considered, len(model.offsets)
    x, dt, d, p, c = (
        ca.SX.sym(name, size)
        for name, size in (
            ("x", n + m),
            ("dt", 1),
            ("d", 2 * len(chain.inputs)),
            ("p", 0),
            ("c", len(chain.known) + considered),
        )
    )
    state, offsets, known = ca.vertcat(x[:n], c[len(chain.known) :]), x[n:], c[: len(chain.known)]
    free = offsets[[model.offsets.index(name) for name in chain.free]]
    later = chain.transition(state, dt, d, free, known)[:n]
    F = chain.state_jacobian(state, dt, d, free, known)[:n, :n]
    F = ca.blockcat([[F, ca.jacobian(later, offsets)], [ca.SX(m, n), ca.SX.eye(m)]])
    y = chain.observation(state, d, free, known)
    arguments = [x, dt, d, p, c]
    return _Functions(
        transition=ca.Function("transition", arguments, [ca.vertcat(later, offsets)]),
        observation=ca.Function("observation", [x, d, p, c], [ca.densify(y)]),
        state_jacobian=ca.Function("state_jacobian", arguments, [F]),
    )
