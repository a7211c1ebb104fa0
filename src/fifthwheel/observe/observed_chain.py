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

    @lazy
    def transition(self) -> ca.Function:
        """(x, dt, d, p, c) -> x+, the state dt seconds later."""
        s = self._symbols
        later = self.chain.transition(*s.step)[: s.n]
        return s.later("transition", ca.vertcat(later, s.x[s.n :]))

    @lazy
    def state_jacobian(self) -> ca.Function:
        """(x, dt, d, p, c) -> dx+/dx (n, n)."""
        s, m = self._symbols, len(self.offsets)
        F, steered = self.chain.state_jacobian(*s.step)[: s.n, : s.n], self.chain.steer_offset_jacobian(*s.step)
        by_offset = ca.horzcat(steered[: s.n, :], ca.SX(s.n, m - steered.shape[1]))
        F = ca.blockcat([[F, by_offset], [ca.SX(m, s.n), ca.SX.eye(m)]])
        return s.later("state_jacobian", F)

    @lazy
    def bank_jacobian(self) -> ca.Function:
        """(x, dt, d, p, c) -> dx+/db (n, 1) of a bank b that is a parameter."""
        s = self._symbols
        by_bank = ca.vertcat(self.chain.state_jacobian(*s.step)[: s.n, s.n :], ca.SX(len(self.offsets), 1))
        return s.later("bank_jacobian", by_bank)

    @lazy
    def observation(self) -> ca.Function:
        """(x, d, p, c) -> y"""
        s = self._symbols
        return s.now("observation", ca.densify(self.chain.observation(*s.instant)))

    @lazy
    def observation_jacobian(self) -> ca.Function:
        """(x, d, p, c) -> dy/dx."""
        s = self._symbols
        by_offset = ca.SX(len(self.outputs), len(self.offsets))
        by_offset[:, s.free] = self.chain.observation_sensitivity(*s.instant)
        H = ca.horzcat(self.chain.observation_jacobian(*s.instant)[:, : s.n], by_offset)
        return s.now("observation_jacobian", H)

    @lazy
    def observation_bank_jacobian(self) -> ca.Function:
        """(x, d, p, c) -> dy/db of a bank b that is a parameter."""
        s = self._symbols
        by_bank = self.chain.observation_jacobian(*s.instant)[:, s.n :]
        return s.now("observation_bank_jacobian", by_bank)

    @lazy
    def _symbols(self) -> "_Symbols":
        return _Symbols.of(self)

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


class _Symbols(NamedTuple):
    """Arguments of the functions of a model, and those of its chain in terms of them."""

    x: ca.SX
    dt: ca.SX
    d: ca.SX
    p: ca.SX
    c: ca.SX
    n: int  # states of the chain among x
    free: list[int]  # indices of the offsets that are parameters of the chain
    step: list[ca.SX]  # state, dt, d, p and c of the chain
    instant: list[ca.SX]  # the same without dt

    @classmethod
    def of(cls, model: ObservedChain) -> "_Symbols":
        """The symbols of a model."""
        chain, considered = model.chain, not model.estimates_bank
        n, n_c = len(chain.states) - considered, len(chain.known)
        x, dt, d, p, c = (
            ca.SX.sym(name, size)
            for name, size in (
                ("x", n + len(model.offsets)),
                ("dt", 1),
                ("d", 2 * len(chain.inputs)),
                ("p", 0),
                ("c", n_c + considered),
            )
        )
        free = [model.offsets.index(name) for name in chain.free]
        state, instant = ca.vertcat(x[:n], c[n_c:]), [d, x[n:][free], c[:n_c]]
        return cls(x, dt, d, p, c, n, free, [state, dt, *instant], [state, *instant])

    def later(self, name: str, result: ca.SX) -> ca.Function:
        """(x, dt, d, p, c) -> result"""
        return ca.Function(name, [self.x, self.dt, self.d, self.p, self.c], [result])

    def now(self, name: str, result: ca.SX) -> ca.Function:
        """(x, d, p, c) -> result"""
        return ca.Function(name, [self.x, self.d, self.p, self.c], [result])
