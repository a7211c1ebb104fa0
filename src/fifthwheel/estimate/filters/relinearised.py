"""A joint filter with relinearisation: a second filter repeats the samples of a segment from a better estimate.

An extended Kalman filter that starts far from the truth linearises at a poor estimate, and the error of the linearised
model remains in its estimate and its covariance. Therefore the samples of each segment with excitation are stored, and
a second filter processes them again, from the state of the first filter at the beginning of the segment. In its first
pass it follows the first filter at a distance of some samples and linearises at the first filter's estimate. In each
further pass it starts again and linearises at its own last result, until the result converges (an iterated filter;
Bell and Cathey 1993). The first filter then continues from this result.

Later segments are linearised at the same point as long as the result stays near it: gradients from many points appear
to contain information in directions in which no single one does (Huang, Mourikis and Roumeliotis 2010). Memory and time
per sample are bounded. One compiled step advances both filters.
"""

import copy
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np

from fifthwheel.base.settings import Count, Limits, Settings
from fifthwheel.base.types import Array
from fifthwheel.estimate.filters import joint
from fifthwheel.estimate.filters.joint import JointLayout
from fifthwheel.estimate.filters.kalman import Noise
from fifthwheel.estimate.filters.model import Model, pack_array, sizes, unpack_array
from fifthwheel.estimate.filters.scaling import Scaling


@dataclass(frozen=True, kw_only=True)
class RelinearisationSettings(Settings):
    """How often the second filter repeats a segment."""

    max_passes: Annotated[int, Limits(ge=0)] = 4
    """Largest number of passes; with 0 the filter is an extended Kalman filter."""
    lag: Annotated[int, Limits(ge=0)] = 200
    """Distance of the second filter behind the first one in the first pass, in samples."""
    samples: Count = 1000
    """Largest number of samples of a segment; then a new segment begins."""
    first_pass_limit: float = 0.5
    """The first pass is the last one if its result is within so many standard deviations of the first filter's."""
    pass_limit: float = 2.0
    """Another pass follows if a result is more standard deviations away from its point of linearisation."""


_ARRAYS = ("carry", "sample", "output", "_begin", "_samples")
_MEMORY = (*_ARRAYS, "_base", "_count", "_position", "_pass", "_complete")
"""Attributes of a `RelinearisedFilter` that change."""


@dataclass(frozen=True, kw_only=True)
class JointEstimate:
    """Estimated parameters z and the effect of considered parameters c on them; see `joint`."""

    z: Array  # (n_z,)
    Pz: Array  # (n_z, n_z) covariance if c is known
    B: Array  # (n_z, n_c) derivative of z with respect to c
    gradient: Array  # (n_c,) of the score tests
    information: Array  # (n_c,) of the score tests
    correlation: Array  # (n_c, n_c) of c

    @classmethod
    def prior(cls, n_z: int, correlation: Array) -> "JointEstimate":
        """The estimate before the first sample."""
        n_c = len(correlation)
        none, B = np.zeros(n_c), np.zeros((n_z, n_c))
        return cls(z=np.zeros(n_z), Pz=np.eye(n_z), B=B, gradient=none, information=none, correlation=correlation)

    @classmethod
    def of(cls, vector: Array, layout: JointLayout, correlation: Array) -> "JointEstimate":
        """The inverse of `vector`."""
        z, Pz, B, gradient, information = np.split(vector, np.cumsum(layout.lengths[3:-1]))
        Pz, B = unpack_array(Pz, layout.n_z), B.reshape(layout.n_z, layout.n_c, order="F")
        return cls(z=z, Pz=Pz, B=B, gradient=gradient, information=information, correlation=correlation)

    def vector(self) -> Array:
        """In the order of the carry, without the correlation."""
        return np.concatenate([self.z, pack_array(self.Pz), self.B.ravel(order="F"), self.gradient, self.information])

    def with_variance_inflation(self, factor: float) -> "JointEstimate":
        """The estimate if `factor` innovations contain the information of one; no variance exceeds the prior's."""
        scale = np.sqrt(np.clip(1 / np.diag(self.Pz), 1.0, factor))
        return replace(
            self,
            Pz=self.Pz * np.outer(scale, scale),
            gradient=self.gradient / factor,
            information=self.information / factor,
        )

    def covariance(self) -> Array:
        """Of all parameters, the estimated ones first (n_p, n_p)."""
        gains, cross = self.B @ np.linalg.cholesky(self.correlation), self.B @ self.correlation
        return np.block([[self.Pz + gains @ gains.T, cross], [cross.T, self.correlation]])


class RelinearisedFilter:
    """Both filters of a model.

    The first row of `carry`, `sample` and `output` belongs to the first filter, the second row to the second filter.
    Of the first filter, `row` is the memory of its sample, `weights` of the weights there, `z` of its estimates, and
    `innovations` of the innovations over their standard deviations; Python accesses these views ten times as fast as an
    array. For c, noise, scaling and walk see `joint.constants`; `correlation` is that of the considered parameters
    (n_c, n_c).
    """

    def __init__(
        self,
        model: Model,
        *,
        c: Array,
        noise: Noise,
        scaling: Scaling,
        walk: Array,
        correlation: Array,
        settings: RelinearisationSettings,
    ) -> None:
        n_x, n_d, n_p, _, n_y = sizes(model)
        n_z = len(walk)
        self.layout = layout = JointLayout(n_x, n_z, n_p - n_z)
        self.scan = joint.joint_step(model, scaling.logarithmic, n_z)
        self.c, self.noise, self.walk, self.settings = c, noise, walk, settings
        self.correlation = correlation
        self.carry = carry = np.zeros((2, layout.size))
        self.sample = sample = np.zeros((2, self.scan.n_sample))
        self.output = output = np.zeros((2, self.scan.n_output))
        self.constant = joint.constants(c, noise, scaling, walk)
        self._addresses = tuple(a.ctypes.data for a in (carry, sample, self.constant, output))
        self.row: Any = sample[0].data
        self.z: Any = carry[0, layout.z].data
        self.weights: Any = sample[0, 1 + n_d + n_y : 1 + n_d + 2 * n_y].data
        self.innovations: Any = output[0, n_y : 2 * n_y].data
        self._out: Any = output[0].data
        k = 1 + n_d + 2 * n_y + 1  # length of [dt, d, y, weight, learn]
        self._learn, self._n_y = k - 1, n_y
        # views of what is copied between the filters
        self._z, self._estimate = carry[0, layout.z], carry[0, layout.estimate]
        self._second_z = carry[1, layout.z]
        self._first_sample, self._second_sample, self._second_base = sample[0, :k], sample[1, :k], sample[1, k:]
        self._d = sample[0, 1 : 1 + n_d]
        # the segment: carry of the first filter before it, and its samples
        self._begin = np.zeros(layout.size)
        self._samples = np.zeros((settings.samples, k))
        self._sample_views = list(self._samples)
        self._variances = layout.Pz.start + np.cumsum([0, *range(n_z, 1, -1)])
        self.set_estimate(JointEstimate.prior(n_z, correlation))

    def set_estimate(self, estimate: JointEstimate) -> None:
        """Set the estimate, and discard the segment."""
        self._estimate[:] = estimate.vector()
        self._base: Array | None = None  # point of linearisation of the second filter; None for the first filter's z
        self._clear_segment()

    def start(self, x: Array, P: Array, V: Array, d: Array) -> None:
        """End the segment and set the state (n_x,), its covariance (n_x, n_x) and V = dx/dz (n_x, n_p).

        The estimate stays. `sample` then contains the inputs d (n_d,), with dt = 0 and without measurements.
        """
        self.end_segment()
        self.carry[0, self.layout.x] = x
        self.carry[0, self.layout.P] = pack_array(P)
        self.carry[0, self.layout.V] = V.ravel(order="F")
        self.sample[0] = 0.0
        self._d[:] = d

    def estimate(self, *, finished: bool = True) -> JointEstimate:
        """The estimate after all passes over all samples.

        Within a segment it finishes the passes on a copy, which takes time in proportion to the remaining samples; if
        not `finished`, it is the present estimate of the first filter.
        """
        vector, _ = self._finish_passes() if finished else (self._estimate.copy(), None)
        return JointEstimate.of(vector, self.layout, self.correlation)

    def advance(self, in_segment: bool, learn: bool) -> tuple[bool, bool]:
        """Process the sample in the first row of `sample`: [dt, d, y, weight]. `in_segment`: it belongs to a segment
        with excitation; `learn`: the parameters are estimated from it.

        It gives whether a measurement was used, and whether the state must be started again.
        """
        self.row[self._learn] = learn
        restart = False
        if in_segment and self.settings.max_passes:
            restart = self._store_sample()
        else:
            self._complete = True
        repeats = self._count > 0 and self._next_of_second()
        self.scan.single(1, 1 + repeats, *self._addresses)
        out = self._out
        if self._count:
            if repeats and self.output[1, -1]:
                self._clear_segment()
            elif self._complete and self._position == self._count:
                restart = self._end_pass()
        return any(out[: self._n_y]), restart or out[-1] > 0

    def memory(self) -> dict[str, Any]:
        """Everything that changes, for `restore`."""
        return {name: copy.deepcopy(getattr(self, name)) for name in _MEMORY}

    def restore(self, memory: Mapping[str, Any]) -> None:
        """Continue where a filter of the same model and settings was."""
        for name, value in memory.items():
            if name in _ARRAYS:
                getattr(self, name)[...] = value  # the compiled step has their addresses
            else:
                setattr(self, name, value)

    def _store_sample(self) -> bool:
        """Add the sample to the segment, or begin a segment with it; whether the state must be started again."""
        if self._count and (self._complete or self._count == self.settings.samples) and self.end_segment():
            return True
        if not self._count:
            self._begin[:] = self.carry[1] = self.carry[0]
        self._complete = False
        np.copyto(self._sample_views[self._count], self._first_sample)
        self._count += 1
        return False

    def _next_of_second(self) -> bool:
        """Give the second filter its next sample; whether there is one."""
        if self._count - self._position <= (0 if self._complete else self.settings.lag):
            return False
        np.copyto(self._second_sample, self._sample_views[self._position])
        np.copyto(self._second_base, self._z if self._base is None else self._base)
        self._position += 1
        return True

    def _clear_segment(self) -> None:
        """Discard the samples of the segment."""
        self._count = 0  # number of samples of the segment
        self._position = 0  # number of samples that the second filter has processed in this pass
        self._pass = 1  # number of this pass
        self._complete = True  # whether the segment has ended

    def _end_pass(self) -> bool:
        """Begin the next pass, or continue from the result of this one; whether the state must be started again."""
        if self._is_last(self.carry[1], self._base, self._pass):
            return self._continue_from(self.carry[1, self.layout.estimate].copy(), self._base)
        self._base = self._second_z.copy()
        self._position, self._pass = 0, self._pass + 1
        self.carry[1] = self._begin
        return False

    def end_segment(self) -> bool:
        """End the segment, finish its passes and continue from the result; whether the state must be started again."""
        return self._continue_from(*self._finish_passes()) if self._count else False

    def _finish_passes(self) -> tuple[Array, Array | None]:
        """Vector of the estimate, and the point of linearisation after all passes over the segment."""
        carry, position, number, base = self.carry[1].copy(), self._position, self._pass, self._base
        while self._count:
            samples = self._samples[position : self._count]
            if self._run_second(carry, samples, self._z if base is None else base):
                break
            if self._is_last(carry, base, number):
                return carry[self.layout.estimate].copy(), base
            position, number, base = 0, number + 1, carry[self.layout.z].copy()
            carry[:] = self._begin
        return self._estimate.copy(), self._base

    def _run_second(self, carry: Array, samples: Array, base: Array) -> bool:
        """Run the second filter over samples, with its carry in place; whether it diverged."""
        rows = np.hstack([samples, np.broadcast_to(base, (len(samples), len(base)))])
        output = np.empty((len(samples), self.scan.n_output))
        arrays = (carry, rows, self.constant[1], output)
        self.scan.single(len(rows), 1, *[a.ctypes.data for a in arrays])
        return bool(output[:, -1].any())

    def _is_last(self, carry: Array, base: Array | None, number: int) -> bool:
        """Whether the result of a pass is near its point of linearisation, or the pass is the last one allowed."""
        z, sigma = carry[self.layout.z], np.sqrt(carry[self._variances])
        point, limit = (self._z, self.settings.first_pass_limit) if base is None else (base, self.settings.pass_limit)
        return number >= self.settings.max_passes or bool((np.abs(z - point) <= limit * sigma).all())

    def _continue_from(self, vector: Array, base: Array | None) -> bool:
        """Set the estimate of the first filter, to first order; whether the change is too large for its state."""
        layout, estimate = self.layout, JointEstimate.of(vector, self.layout, self.correlation)
        V = self.carry[0, layout.V].reshape(layout.n_x, -1, order="F")[:, : layout.n_z]
        difference = estimate.z - self._z
        change = V @ difference
        self.carry[0, layout.x] += change
        self.carry[0, layout.P] += pack_array(np.outer(change, change))
        restart = bool((np.abs(difference) > self.settings.pass_limit * np.sqrt(np.diag(estimate.Pz))).any())
        self.set_estimate(estimate)
        self._base = estimate.z if base is None else base
        return restart
