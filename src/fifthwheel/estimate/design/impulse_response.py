"""Information of a manoeuvre of any size and number of repetitions at one speed.

At constant speed the model is linear with constant coefficients. So the part of the outputs' derivatives that a steer
angle causes is the steer angle convolved with the response to a pulse, which two short runs give: one without steering,
one with a pulse of steering. Each unknown acts either only with steering, as a cornering stiffness does, or only
without, as the offset of a sensor does.

Superposition does not hold for the softening of tyres, which is quadratic in the slip angle, nor for errors of sensors
that are not `linear`. The derivatives with respect to these few unknowns are computed along the complete run
(`along_run`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from fifthwheel.base.names import ParameterPath, split_log
from fifthwheel.base.types import Array
from fifthwheel.data.channels import SensorErrorName
from fifthwheel.estimate.design.predict import InformationPredictor, with_every_sample
from fifthwheel.estimate.filters.noise_model import NoiseModel
from fifthwheel.estimate.identify.dataset import LogData
from fifthwheel.estimate.identify.one_stage.problem import Problem
from fifthwheel.estimate.identify.unknowns.unknown import Unknown
from fifthwheel.model.manoeuvres.accelerations import DECAY_TIME, steer_record
from fifthwheel.model.manoeuvres.candidates import CandidateManoeuvre

PULSE_SIZE = 1e-5
"""Steer angle of the pulse, rad.

The response is linear in it; small, because the initial state's prior depends on the rms of the steer angle.
"""


def along_run(name: str) -> bool:
    """Whether the derivatives with respect to an unknown are computed along the complete run."""
    error = SensorErrorName.of(split_log(name)[0])
    row = error.row if error else None
    return not row.linear if row else ParameterPath.of(name).quantity == "softening"


@dataclass(frozen=True, kw_only=True, eq=False)
class ManoeuvreInformation:
    """Information on k unknowns of 1, 2, ... n repetitions of a manoeuvre, as a function of its size."""

    response: "ImpulseResponse"
    steer: Array  # steer angle (N,) of all repetitions at size 1, rad
    derivatives: Array
    """Whitened derivatives (n, k, N m / n) of the samples of each repetition at size 1; zero for unknowns of
    `along_run`."""

    def at(self, size: float) -> Array:
        """Information (n, k, k) of 1, 2, ... n repetitions with a steer angle `size` times as large."""
        factor, own = np.where(self.response.steered, size, 1.0), list(self.response.separate)
        result = self._linear * np.outer(factor, factor)
        if own:
            along = np.split(self.response.along(size * self.steer), len(result), axis=1)
            rows = np.stack([part.reshape(len(own), -1) for part in along])
            cross = np.cumsum(self.derivatives @ rows.transpose(0, 2, 1), axis=0) * factor[:, None]
            cross[:, own] = np.cumsum(rows @ rows.transpose(0, 2, 1), axis=0)
            result[:, :, own], result[:, own, :] = cross, cross.transpose(0, 2, 1)
        return np.asarray(result)

    @cached_property
    def _linear(self) -> Array:
        """Information (n, k, k) at size 1; zero for unknowns of `along_run`."""
        return np.cumsum(self.derivatives @ self.derivatives.transpose(0, 2, 1), axis=0)


@dataclass(frozen=True, kw_only=True, eq=False)
class ImpulseResponse:
    """Derivatives of m channels with respect to k unknowns at one speed; made by `of`."""

    predictor: InformationPredictor
    speed: float  # m/s
    rate: float  # sampling rate, Hz
    noise: Mapping[str, NoiseModel]  # of each logged channel
    names: tuple[str, ...]  # names of the unknowns (k,)
    straight: Array  # derivatives (k, M, m) without steering
    pulse: Array
    """Derivatives (k, M - 1, m) for a pulse of 1 rad at the first sample; zero for unknowns that act without it, and
    for those of `along_run`."""
    steered: NDArray[np.bool_]  # whether each unknown acts only with steering (k,)

    @classmethod
    def of(
        cls, predictor: InformationPredictor, speed: float, *, rate: float, noise: Mapping[str, NoiseModel]
    ) -> "ImpulseResponse":
        """Derivatives of both runs at a speed, m/s, and sampling rate, Hz, for the noise of each logged channel."""
        steer = np.zeros(round(DECAY_TIME * rate))
        names, straight = _derivatives(predictor, predictor.setup.unknowns, speed, steer, rate, list(noise))
        steered = np.asarray(~straight.any(axis=(1, 2)), dtype=np.bool_)
        steer[1] = PULSE_SIZE  # linear between samples: the pulse begins to act after the first sample
        _, pulse = _derivatives(predictor, predictor.setup.unknowns, speed, steer, rate, list(noise))
        superposed = steered & [not along_run(name) for name in names]
        return cls(
            predictor=predictor,
            speed=speed,
            rate=rate,
            noise=noise,
            names=names,
            straight=straight,
            pulse=pulse[:, 1:] / PULSE_SIZE * superposed[:, None, None],
            steered=steered,
        )

    @property
    def separate(self) -> tuple[int, ...]:
        """Indices of the unknowns of `along_run`."""
        return tuple(i for i, name in enumerate(self.names) if along_run(name))

    def along(self, steer: Array) -> Array:
        """Whitened derivatives (q, N, m) for the q unknowns of `along_run` and a steer angle (N,), rad."""
        unknowns = [u for u in self.predictor.setup.unknowns if along_run(u.name)]
        names, derivatives = _derivatives(self.predictor, unknowns, self.speed, steer, self.rate, list(self.noise))
        return self._whitened(derivatives[[names.index(self.names[i]) for i in self.separate]])

    def _whitened(self, derivatives: Array) -> Array:
        """Derivatives (k, N, m) through the filter that makes the noise of each channel white with variance 1."""
        channels = [model.whitened(derivatives[..., i], 1 / self.rate) for i, model in enumerate(self.noise.values())]
        return np.stack(channels, axis=-1)

    def information(self, manoeuvre: CandidateManoeuvre, steer: Array, count: int) -> ManoeuvreInformation:
        """Information of 1, 2, ... `count` repetitions of a manoeuvre, to the left and to the right in turn.

        `steer` (N,) is that of one repetition and its decay, rad; it starts at zero.
        """
        period, response = round(manoeuvre.period * self.rate), self._response(steer)
        size = count * period
        settled = np.repeat(self.straight[:, -1:], max(size - self.straight.shape[1], 0), axis=1)
        derivatives = np.concatenate([self.straight, settled], axis=1)[:, :size]
        for i in range(count):
            segment = derivatives[:, i * period : i * period + response.shape[1]]
            segment += (-1) ** i * response[:, : segment.shape[1]]
        derivatives = self._whitened(derivatives)
        return ManoeuvreInformation(
            response=self,
            steer=manoeuvre.repeated(steer, count, self.rate),
            derivatives=np.stack([part.reshape(len(self.names), -1) for part in np.split(derivatives, count, axis=1)]),
        )

    def _response(self, steer: Array) -> Array:
        """Derivatives (k, N + M - 1, m) that a steer angle (N,) causes, until they have decayed."""
        from scipy.fft import irfft, next_fast_len, rfft  # slow to import

        length = len(steer) + self.pulse.shape[1]
        size = next_fast_len(length, real=True)
        response = irfft(rfft(self.pulse, size, axis=1) * rfft(steer, size)[:, None], size, axis=1)
        return np.asarray(response[:, :length])


def _derivatives(
    predictor: InformationPredictor,
    unknowns: Sequence[Unknown],
    speed: float,
    steer: Array,
    rate: float,
    logged: Sequence[str],
) -> tuple[tuple[str, ...], Array]:
    """Names (k,) of the unknowns, and the derivatives (k, N, m) of the logged channels."""
    record = steer_record(predictor.setup.vehicle, speed, steer, rate, "impulse response")
    log = LogData(name=record.name, segments=[with_every_sample(record, predictor.setup.outputs)])
    problem = Problem(replace(predictor.setup, unknowns=tuple(unknowns)), [log])
    jacobian, first = np.zeros((len(problem.names), len(record), len(logged))), 0
    channels = [predictor.setup.outputs.index(name) for name in logged]
    for block in problem.blocks(np.zeros(len(problem.names)), 0, 0):
        rows = slice(first, first + len(block.time))
        jacobian[block.indices, rows] = np.moveaxis(block.jacobian[:, channels], -1, 0)
        first = rows.stop
    return problem.names, jacobian
