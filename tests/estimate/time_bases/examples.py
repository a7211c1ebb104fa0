"""Channels and predictions with known lags."""

import numpy as np

from fifthwheel.estimate.time_bases.predictions import RATE, Prediction

TIME = np.arange(0, 60, 1 / RATE)


def slow_noise(seed: int, time_constant: float, count: int = len(TIME)) -> np.ndarray:
    """First-order noise of variance 1."""
    rng, phi = np.random.default_rng(seed), np.exp(-1 / (RATE * time_constant))
    values = rng.normal(size=count)
    for k in range(1, count):
        values[k] = phi * values[k - 1] + np.sqrt(1 - phi**2) * values[k]
    return values


def excitation(seed: int) -> np.ndarray:
    smooth = np.convolve(slow_noise(seed, 0.5), np.hanning(25), mode="same")
    return smooth / smooth.std()


STEER, YAW, YAW2, ROLL2 = "steer.tractor.front", "yaw_rate.tractor", "yaw_rate.semitrailer", "roll_rate.semitrailer"
ROLL, ANGLE, ACCELERATION = "roll_rate.tractor", "articulation.semitrailer", "lateral_acceleration.tractor"
SOURCES = {name: excitation(k) for k, name in enumerate((YAW, YAW2, ROLL2, ROLL, ANGLE, ACCELERATION))}
WHITE = {name: np.random.default_rng(100 + k).normal(size=TIME.size) for k, name in enumerate(SOURCES)}


def shifted(values, lag, time=TIME):
    return np.interp(time - lag, TIME[: values.size], values)


def prediction_of(measured, variants=None, *, generic=False):
    """A prediction with measured channels; by default one variant without lags."""
    predicted = [{name: SOURCES[name] for name in measured}] if variants is None else variants
    return Prediction(
        time=TIME,
        steer=STEER,
        names=tuple(measured),
        measured=np.column_stack(list(measured.values())),
        predicted=np.array([np.column_stack([variant[name] for name in measured]) for variant in predicted]),
        generic=generic,
    )


def late(lags, noise=0.02):
    """The channels, late by some lags."""
    return {name: shifted(SOURCES[name], lag) + noise * WHITE[name] for name, lag in lags.items()}
