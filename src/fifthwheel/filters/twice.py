"""A joint filter, and a second one that goes over what there was to learn from again.

An extended Kalman filter that starts far off linearises where it then stands, and what it so learns it believes for
ever. So the samples of a stretch to learn from are kept, and the second filter begins where the first one did. It goes
over them some samples behind the first, linearised at what that has learned since, and then, from the stretch's begin
and linearised at its own last result, as often as that changes anything. The first then goes on from what it found.

Later stretches are linearised where the last one was, as long as the result stays near: gradients from many places
seem to tell what none of them tells (Huang, Mourikis and Roumeliotis 2010). Memory and time of a sample are bounded,
the two filters are lanes of one compiled step.
"""

import ctypes
from dataclasses import dataclass
from typing import Any

import numpy as np

from fifthwheel.filters import joint
from fifthwheel.filters.dual import Scaling
from fifthwheel.filters.kalman import Noise
from fifthwheel.filters.model import Array, Model, pack_array, sizes, unpack_array


@dataclass(frozen=True, kw_only=True)
class Looks:
    """How often a stretch is gone over."""

    most: int = 4
    """At most so many times; with 0 the filter is an extended Kalman filter."""
    behind: int = 200
    """The first time so many samples behind."""
    samples: int = 1000
    """After so many a stretch is over, and another one begins."""
    settled: float = 0.5
    """One look is enough if it ends no more of a standard deviation than this from where the first filter does."""
    far: float = 2.0
    """A result farther than this, in standard deviations, from where it was linearised asks for another look."""


class Twice:
    """Both filters of a model.

    Args:
        model: what is filtered.
        c: its other parameters.
        noise: Q per second, R and the gate.
        scaling: how z becomes p.
        free: (n_p,) 1 for each z that may be learned, 0 for one that is only considered.
        looks: of the second filter.
    """

    def __init__(self, model: Model, *, c: Array, noise: Noise, scaling: Scaling, free: Array, looks: Looks) -> None:
        n_x, n_d, n_p, _, n_y = sizes(model)
        self.layout = layout = joint.Layout(n_x, n_p)
        self.scan = joint.step(model, scaling.logarithmic)
        self.looks = looks
        self.carry = carry = np.zeros((layout.size, joint.LANES))
        self.sample = sample = np.zeros((self.scan.n_sample, joint.LANES))
        self.output = output = np.zeros((self.scan.n_output, joint.LANES))
        self._constant = joint.constants(c, noise, scaling, free)
        self._addresses = tuple(a.ctypes.data for a in (carry, sample, self._constant, output))
        # the same memory as plain doubles: an element of a NumPy array costs ten times as much
        self.row: Any = (ctypes.c_double * sample.size).from_buffer(sample.data)
        self.out: Any = (ctypes.c_double * output.size).from_buffer(output.data)
        k = 1 + n_d + 2 * n_y + 1  # of a sample up to whether to learn from it
        self._learn = joint.LANES * (k - 1)
        self._lost = joint.LANES * 2 * n_y
        # what moves between the lanes, as views
        self._z, self._Pz = carry[layout.z, 0], carry[layout.Pz, 0]
        self._second_z, self._second_Pz = carry[layout.z, 1], carry[layout.Pz, 1]
        self._first_sample, self._second_sample, self._second_base = sample[:k, 0], sample[:k, 1], sample[k:, 1]
        self._d, self._second_d = sample[1 : 1 + n_d, 0], sample[1 : 1 + n_d, 1]
        self._second_rest = sample[1 + n_d + n_y :, 1]
        # the stretch: where the first filter was before it, and its samples
        self._begin = np.zeros(layout.size)
        self._samples = np.zeros((looks.samples, k))
        self._places = list(self._samples)
        self._variances = layout.Pz.start + np.cumsum([0, *range(n_p, 1, -1)])
        self.believe(np.zeros(n_p), np.eye(n_p))

    def believe(self, z: Array, Pz: Array) -> None:
        """Know z (n_p,) with covariance Pz (n_p, n_p), and nothing of where that was linearised."""
        self._z[:], self._Pz[:] = z, pack_array(Pz)
        self._anchor: Array | None = None  # where the second filter linearises; None for where the first one is
        self._close()

    def start(self, x: Array, P: Array, V: Array, d: Array) -> None:
        """Begin anew with the state x (n_x,), its covariance P and V = dx/dz (n_x, n_p); what was learned stays.

        What d (n_d,) brings stands in the sample from now on, with no time gone by and nothing measured.
        """
        self.conclude()
        self.carry[self.layout.x, 0] = x
        self.carry[self.layout.P, 0] = pack_array(P)
        self.carry[self.layout.V, 0] = V.ravel(order="F")
        self.carry[:, 1] = self.carry[:, 0]
        self.sample[:, 0] = 0.0
        self._d[:] = d
        self._idle()

    def learned(self) -> tuple[Array, Array]:
        """z (n_p,) and its covariance (n_p, n_p), all samples counted: the second filter's, were it done already.

        Within a stretch that takes as long as the samples which the second filter has still to go over.
        """
        z, Pz, _ = self._all_looks()
        return z, Pz

    def advance(self, stretch: bool, learn: bool) -> tuple[bool, bool]:
        """Take the sample in the first lane of `sample`, of which `row` is the memory, from dt to the weights.

        Args:
            stretch: whether it is one of a stretch from which there is something to learn.
            learn: whether to learn from this one of them.

        Returns:
            Whether a measurement was used, and whether the state must be begun anew; `out` holds the step's output.
        """
        self.row[self._learn] = learn
        torn = False
        if stretch and self.looks.most:
            torn = self._keep()
        else:
            self._over = True
        if self._count:
            self._bring_second()
        self.scan.vector(1, 1, *self._addresses)
        out = self.out
        if self._count:
            if out[self._lost + 1]:
                self._close()
            elif self._over and self._place == self._count:
                torn = self._end_look()
        return any(out[: self._lost // 2 : joint.LANES]), torn or out[self._lost] > 0

    def _keep(self) -> bool:
        """Add the sample to the stretch, or begin one with it; whether an old one's end tore the state off."""
        if self._count and (self._over or self._count == self.looks.samples) and self.conclude():
            return True
        if not self._count:
            self._begin[:] = self.carry[:, 1] = self.carry[:, 0]
        self._over = False
        np.copyto(self._places[self._count], self._first_sample)
        self._count += 1
        return False

    def _bring_second(self) -> None:
        """Give the second filter its next sample."""
        if self._over or self._count - self._place > self.looks.behind:
            np.copyto(self._second_sample, self._places[self._place])
            np.copyto(self._second_base, self._z if self._anchor is None else self._anchor)
            self._place += 1
        else:
            self._idle()

    def _idle(self) -> None:
        """Give the second filter a sample that changes nothing: no time goes by and nothing is measured."""
        self.row[1] = 0.0
        np.copyto(self._second_d, self._d)
        self._second_rest[:] = 0.0

    def _close(self) -> None:
        """Keep no samples."""
        self._count = 0  # of the stretch's samples
        self._place = 0  # how many of them the second filter has seen in this look
        self._look = 1  # which look that is
        self._over = True  # whether the stretch is
        self._idle()

    def _end_look(self) -> bool:
        """Begin the next one, or go on from what this one found; whether that tears the state off."""
        if self._settled(self.carry, self._anchor, self._look):
            Pz = unpack_array(self._second_Pz, self.layout.n_p)
            return self._go_on_from(self._second_z.copy(), Pz, self._anchor)
        self._anchor = self._second_z.copy()
        self._place, self._look = 0, self._look + 1
        self.carry[:, 1] = self._begin
        return False

    def conclude(self) -> bool:
        """End the stretch and go on from what all looks at it find; whether that tears the state off."""
        return self._go_on_from(*self._all_looks()) if self._count else False

    def _all_looks(self) -> tuple[Array, Array, Array | None]:
        """z, its covariance, and where the last look at the stretch is linearised."""
        carry, place, look, anchor = self.carry.copy(), self._place, self._look, self._anchor
        while self._count:
            lost = self._run(carry, self._samples[place : self._count], self._z if anchor is None else anchor)
            if lost:
                break
            z, Pz = carry[self.layout.z, 1].copy(), unpack_array(carry[self.layout.Pz, 1], self.layout.n_p)
            if self._settled(carry, anchor, look):
                return z, Pz, anchor
            place, look, anchor = 0, look + 1, z
            carry[:, 1] = self._begin
        return self._z.copy(), unpack_array(self._Pz, self.layout.n_p), self._anchor

    def _run(self, carry: Array, samples: Array, base: Array) -> bool:
        """Take the second filter of a carry through samples; whether it was lost."""
        rows = np.empty((len(samples), *self.sample.shape))
        rows[:, : samples.shape[1]] = samples[:, :, None]
        rows[:, samples.shape[1] :] = base[:, None]
        output = np.empty((len(samples), *self.output.shape))
        arrays = (carry, rows, self._constant, output)
        self.scan.vector(len(rows), 1, *[a.ctypes.data for a in arrays])
        return bool(output[:, -1, 1].any())

    def _settled(self, carry: Array, anchor: Array | None, look: int) -> bool:
        """Whether a look ended where it was linearised, or was the last one."""
        z, sigma = carry[self.layout.z, 1], np.sqrt(carry[self._variances, 1])
        base, near = (self._z, self.looks.settled) if anchor is None else (anchor, self.looks.far)
        return look >= self.looks.most or bool((np.abs(z - base) <= near * sigma).all())

    def _go_on_from(self, z: Array, Pz: Array, anchor: Array | None) -> bool:
        """Let the first filter believe this; whether its state cannot follow so far.

        The state goes with z to first order, and may be off by as much as it moves.
        """
        layout = self.layout
        V = self.carry[layout.V, 0].reshape(layout.n_x, layout.n_p, order="F")
        moved = V @ (z - self._z)
        self.carry[layout.x, 0] += moved
        self.carry[layout.P, 0] += pack_array(np.outer(moved, moved))
        torn = bool((np.abs(z - self._z) > self.looks.far * np.sqrt(np.diag(Pz))).any())
        self.believe(z, Pz)
        self._anchor = z if anchor is None else anchor
        return torn
