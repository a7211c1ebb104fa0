"""The model of an observer: the chain with further unknowns, the bank of the road and the offsets of sensors.

The offsets are states. The bank is a state if measurements are to correct it, otherwise a parameter.
"""

import functools
from collections.abc import Mapping, Sequence

import casadi as ca
import numpy as np

from fifthwheel.base.lazy import lazy
from fifthwheel.base.types import Array
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics import ChainModel
from fifthwheel.model.dynamics.symbolic import Matrix, transition_matrix
from fifthwheel.model.dynamics.tyres import Tyres
from fifthwheel.model.dynamics.unit_equations import BANK
from fifthwheel.truck import Vehicle


class ObservedChain:
    """A `estimate.filters.model.Model` without parameters p, built by `observed_chain`.

    The states of the chain come first; the offsets, whose names begin with those of the steer angles, are the last
    states. The bank, the last state of the chain, is either estimated, or the last parameter of c.
    """

    def __init__(self, chain: ChainModel, offsets: tuple[str, ...], estimates_bank: bool) -> None:
        self.chain, self.offsets, self.estimates_bank = chain, offsets, estimates_bank
        self.roll, self.inputs, self.outputs = chain.roll, chain.inputs, chain.outputs
        self.unknowns = (BANK, *offsets)
        self.states = (*(chain.states if estimates_bank else chain.states[:-1]), *offsets)
        self.known = chain.known if estimates_bank else (*chain.known, BANK)  # names of c
        self.sizes = len(self.states), 2 * len(self.inputs), 0, len(self.known), len(self.outputs)
        self.identity = "observed chain", chain.identity, offsets, estimates_bank

    @lazy
    def transition(self) -> ca.Function:
        """(x, dt, d, p, c) -> x+, the state dt seconds later."""
        own, of_chain, n = self._symbols
        return ca.Function("transition", own, [ca.vertcat(self.chain.transition(*of_chain)[:n], own[0][n:])])

    @lazy
    def transition_parts(self) -> ca.Function:
        """(x, dt, d, p, c) -> M, of which exp(M) is the derivative of [x+, bank] by [x, bank] if the bank is a
        parameter, else that of x+ by x."""
        (own, of_chain, n), m = self._symbols, len(self.offsets)
        M, steered = self.chain.exponent(*of_chain), self.chain.steer_offset_exponent(*of_chain)
        n_chain = M.shape[0]
        by_offset = ca.horzcat(steered, ca.SX(n_chain, m - steered.shape[1]))
        M = ca.blockcat([[M, by_offset], [ca.SX(m, n_chain), ca.SX(m, m)]])
        order = [*range(n), *range(n_chain, n_chain + m), *range(n, n_chain)]
        return ca.Function("transition_parts", own, [M[order, order]])

    def transition_matrix(self, exponent: Matrix) -> Matrix:
        """dx+/dx (n, n) from the result of `transition_parts`, and the column of a bank that is a parameter."""
        return transition_matrix(exponent, self.chain.order)[: len(self.states), :]

    @lazy
    def observation(self) -> ca.Function:
        """(x, d, p, c) -> y"""
        own, of_chain, _ = self._instant
        return ca.Function("observation", own, [ca.densify(self.chain.observation(*of_chain))])

    @lazy
    def observation_jacobian(self) -> ca.Function:
        """(x, d, p, c) -> dy/dx, and the column of a bank that is a parameter."""
        own, of_chain, n = self._instant
        by_offset = ca.SX(len(self.outputs), len(self.offsets))
        by_offset[:, self._free] = self.chain.observation_sensitivity(*of_chain)
        H = self.chain.observation_jacobian(*of_chain)
        return ca.Function("observation_jacobian", own, [ca.horzcat(H[:, :n], by_offset, H[:, n:])])

    @property
    def _free(self) -> list[int]:
        """Places of the offsets that are parameters of the chain."""
        return [self.offsets.index(name) for name in self.chain.free]

    @lazy
    def _symbols(self) -> tuple[list[ca.SX], list[ca.SX], int]:
        """[x, dt, d, p, c], the same arguments of the chain, and the number of its states in x."""
        n_x, n_d, _, n_c, _ = self.sizes
        names = (("x", n_x), ("dt", 1), ("d", n_d), ("p", 0), ("c", n_c))
        x, dt, d, p, c = (ca.SX.sym(name, size) for name, size in names)
        n, n_known = n_x - len(self.offsets), len(self.chain.known)
        return [x, dt, d, p, c], [ca.vertcat(x[:n], c[n_known:]), dt, d, x[n:][self._free], c[:n_known]], n

    @property
    def _instant(self) -> tuple[list[ca.SX], list[ca.SX], int]:
        """`_symbols` without dt."""
        (x, _, *own), (state, _, *of_chain), n = self._symbols
        return [x, *own], [state, *of_chain], n

    def known_values(self, values: Mapping[str, float]) -> Array:
        """c from values by name, SI."""
        return np.array([values[name] for name in self.known], dtype=np.float64)


def observed_chain(
    vehicle: Vehicle,
    outputs: Sequence[str],
    *,
    offset_states: Sequence[str] = (),
    roll: bool,
    estimate_bank: bool,
    tyres: Tyres = "linear",
) -> ObservedChain:
    """The model of a vehicle, see `model.dynamics.model`; vehicles of equal topology share one model.

    The offsets of the signals `offset_states` are states, whether or not these are among the outputs. The derivative of
    the speed is an input.
    """
    offsets = tuple(f"{name}.offset" for name in (*vehicle.steer_signals(), *offset_states))
    known = dynamics.all_parameters(vehicle, outputs)
    free = tuple(name for name in offsets if name in known)
    chain = dynamics.model(vehicle, outputs, roll=roll, bank=True, free=free, tyres=tyres, braking=True)
    return _observed_chain(chain, offsets, estimate_bank)


_observed_chain = functools.cache(ObservedChain)
