"""Information of any steer angle at one speed, from two short runs: one without steering, one with a pulse of steering.

At constant speed the model is linear with constant coefficients. So the part of the outputs' derivatives that a steer
angle causes is the steer angle convolved with the response to a pulse. Each unknown acts either only with steering, as
a cornering stiffness does, or only without, as the offset of a sensor does.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft

from fifthwheel._types import Array
from fifthwheel.identify.dataset import LogData
from fifthwheel.identify.design.predict import InformationPredictor
from fifthwheel.identify.one_stage.problem import Problem
from fifthwheel.manoeuvres.linear import DECAY_TIME, steer_record

PULSE_SIZE = 1e-5
"""Steer angle of the pulse, rad.

The response is linear in it; small, because the initial state's prior depends on the rms of the steer angle.
"""


@dataclass(frozen=True, kw_only=True, eq=False)
class ScaledInformation:
    """Information on k unknowns as a function of the size of the steer angle."""

    unit: Array
    """Information (k, k) at size 1."""
    steered: NDArray[np.bool_]
    """Whether each unknown acts only with steering (k,)."""

    def at(self, size: float) -> Array:
        """Information (k, k) with a steer angle `size` times as large."""
        factor = np.where(self.steered, size, 1.0)
        return np.asarray(self.unit * np.outer(factor, factor))


@dataclass(frozen=True, kw_only=True, eq=False)
class ImpulseResponse:
    """Derivatives of m channels with respect to k unknowns at one speed, relative to the noise; made by `of`."""

    names: tuple[str, ...]
    """Names of the unknowns (k,)."""
    straight: Array
    """Derivatives (k, M, m) without steering."""
    pulse: Array
    """Derivatives (k, M - 1, m) for a pulse of 1 rad at the first sample; zero for unknowns that act without it."""
    steered: NDArray[np.bool_]
    """Whether each unknown acts only with steering (k,)."""

    @classmethod
    def of(
        cls, predictor: InformationPredictor, speed: float, *, rate: float, noise: Mapping[str, float]
    ) -> "ImpulseResponse":
        """Compute the derivatives of both runs.

        Args:
            predictor: of a truck that is stable at this speed.
            speed: m/s.
            rate: sampling rate, Hz.
            noise: variance of each logged channel, SI squared.
        """
        steer = np.zeros(round(DECAY_TIME * rate))
        names, straight = _derivatives(predictor, speed, steer, rate, noise)
        steered = np.asarray(~straight.any(axis=(1, 2)), dtype=np.bool_)
        steer[1] = PULSE_SIZE  # linear between samples: the pulse begins to act after the first sample
        _, pulse = _derivatives(predictor, speed, steer, rate, noise)
        return cls(
            names=names, straight=straight, pulse=pulse[:, 1:] / PULSE_SIZE * steered[:, None, None], steered=steered
        )

    def information(self, steer: Array, period: int, count: int) -> list[ScaledInformation]:
        """Information of 1, 2, ... `count` repetitions of a manoeuvre, to the left and to the right in turn.

        Args:
            steer: (N,) of one repetition and its decay, rad; starts at zero.
            period: samples from the start of a repetition to the start of the next.
            count: number of repetitions.
        """
        size, response = count * period, self._response(steer)
        settled = np.repeat(self.straight[:, -1:], max(size - self.straight.shape[1], 0), axis=1)
        derivatives = np.concatenate([self.straight, settled], axis=1)[:, :size]
        for i in range(count):
            segment = derivatives[:, i * period : i * period + response.shape[1]]
            segment += (-1) ** i * response[:, : segment.shape[1]]
        k = len(self.names)
        result, total = [], np.zeros((k, k))
        for i in range(count):
            rows = derivatives[:, i * period : (i + 1) * period].reshape(k, -1)
            total = total + rows @ rows.T
            result.append(ScaledInformation(unit=total, steered=self.steered))
        return result

    def _response(self, steer: Array) -> Array:
        """Derivatives (k, N + M - 1, m) that a steer angle (N,) causes, until they have decayed."""
        length = len(steer) + self.pulse.shape[1]
        size = next_fast_len(length, real=True)
        response = irfft(rfft(self.pulse, size, axis=1) * rfft(steer, size)[:, None], size, axis=1)
        return np.asarray(response[:, :length])


def _derivatives(
    predictor: InformationPredictor, speed: float, steer: Array, rate: float, noise: Mapping[str, float]
) -> tuple[tuple[str, ...], Array]:
    """Names (k,) of the unknowns, and the derivatives (k, N, m) of the channels over the noise's standard deviation."""
    record = steer_record(predictor.vehicle, speed, steer, rate, "impulse response")
    log = LogData(name=record.name, segments=[record])
    problem = Problem(predictor.model, predictor.vehicle, [log], predictor.unknowns, predictor.settings)
    block = problem.block(np.zeros(len(problem.names)), 0, 0)
    channels = [predictor.channels.index(name) for name in noise]
    jacobian = block.jacobian[..., channels] / np.sqrt(list(noise.values()))
    return tuple(problem.names[i] for i in block.indices), np.asarray(jacobian)
