"""The noise of an uneven road: limits of its spectra, and predicted sigmas against identified ones."""

from collections.abc import Mapping

import numpy as np
import pytest

import fifthwheel as fw
from fifthwheel.data.record import Record
from fifthwheel.data.record.derived import article_gyro_variance
from fifthwheel.estimate.design import DesignSettings, design_experiment
from fifthwheel.estimate.design.predict import InformationPredictor
from fifthwheel.estimate.design.road_noise import ROUGHNESS, TRACK, road_density, road_noise, road_roll_density
from fifthwheel.estimate.identify import OneStage, identify
from fifthwheel.estimate.identify.dataset import LogData
from fifthwheel.model.plant import Sensor, measure
from fifthwheel.truck import Vehicle

SPEED, STEER, ROLL_RATE = "speed", "steer.tractor.front", "roll_rate.semitrailer"
GYROS = article_gyro_variance(["tractor", "semitrailer"])


def test_tracks_are_independent_for_short_waves_and_equal_for_long_ones() -> None:
    speed = 20.0
    short, long = np.array([40.0]), np.array([1e-3])
    heights = ROUGHNESS * (short / speed / 0.1) ** -2.0
    assert road_roll_density(short, speed) == pytest.approx(2 * heights / TRACK**2 / speed, rel=1e-6)
    heights = ROUGHNESS * (long / speed / 0.1) ** -2.0
    assert road_roll_density(long, speed) < 1e-4 * 2 * heights / TRACK**2 / speed


def test_a_slow_body_follows_the_road(truck: Vehicle) -> None:
    """At low frequency the roll angle is that of the road, and gravity adds to it; above resonance it stays behind."""
    speed = 20.0
    (group,) = truck.unit("semitrailer").axle_groups
    lever = truck.derived()["semitrailer.cog_height"] - truck.parameters()["semitrailer.roll_axis_height"]
    gravity = truck.unit("semitrailer").laden_sprung_mass * 9.80665 * lever
    frequency = np.array([0.01, 1.1, 8.0])
    rate = (2 * np.pi * frequency) ** 2 * road_roll_density(frequency, speed)
    gain = np.sqrt(road_density(truck, ROLL_RATE, speed, frequency) / rate)
    stiffness = group.total_roll_stiffness
    assert gain[0] == pytest.approx(stiffness / (stiffness - gravity), rel=1e-3)
    assert gain[1] > 1.5
    assert gain[2] < 0.1
    assert road_density(truck, "lateral_acceleration.tractor", speed, frequency) == pytest.approx([0.0] * 3)


@pytest.mark.slow
def test_a_design_counts_the_road(truck: Vehicle) -> None:
    height = "semitrailer.payload.height"
    sigmas = [
        design_experiment(
            truck,
            {height: 0.5},
            OneStage(given={"others": "exact", "sensors": "exact"}, tyres="linear"),
            planning=DesignSettings(speeds=(80 / 3.6,), frequencies=(0.4,), repetitions=(1,), roughness=roughness),
        ).best.sigma[height]
        for roughness in (0.0, ROUGHNESS, 4 * ROUGHNESS)
    ]
    assert 1.1 * sigmas[0] < sigmas[1] < 0.9 * sigmas[2]


def noise(density: np.ndarray, n: int, dt: float, rng: np.random.Generator) -> np.ndarray:
    """Noise (n,) with a one-sided density at the frequencies of an FFT."""
    amplitude = np.sqrt(density * n / (2 * dt))
    phasors = (rng.normal(size=len(density)) + 1j * rng.normal(size=len(density))) / np.sqrt(2)
    phasors[0] = 0.0
    return np.fft.irfft(amplitude * phasors, n)


def on_the_road(truth: Mapping[str, np.ndarray], time: np.ndarray, truck: Vehicle, seed: int) -> Record:
    """A log with the noise of the road and of the sensors."""
    n, dt, rng = len(time), time[1] - time[0], np.random.default_rng(seed)
    frequency = np.maximum(np.fft.rfftfreq(n, dt), 0.5 / (n * dt))
    measured = {name: truth[name] for name in (SPEED, STEER)}
    for name in GYROS:
        measured[name] = truth[name] + noise(road_density(truck, name, truth[SPEED].mean(), frequency), n, dt, rng)
    sensors = {name: Sensor(variance=GYROS.get(name, 0.0)) for name in measured}
    return Record(time=time, signals=measure(time, measured, sensors, seed=seed), name="log")


def sigma_ratios(truth: Mapping[str, np.ndarray], time: np.ndarray, truck: Vehicle, seeds: int) -> dict[str, float]:
    """Predicted over identified sigma of each parameter."""
    records = [on_the_road(truth, time, truck, seed) for seed in range(seeds)]
    results = [identify([record], truck) for record in records]
    speed = float(truth[SPEED].mean())
    predictor = InformationPredictor.of(truck.with_logged_steering([STEER], "log"), OneStage(), [speed])
    models = road_noise(truck, speed, 100.0, GYROS)
    log = LogData(name="log", segments=[records[0]], noise=dict(GYROS), noise_models=models)
    posterior = predictor.posterior([predictor.run_information(log, list(GYROS))])
    return {
        name: posterior.sigma_of(name) * predictor.prior_sigma(name) / float(np.mean([r[name].sigma for r in results]))
        for name in predictor.setup.estimated
    }


@pytest.mark.slow
def test_predicted_sigmas_are_those_of_logs_with_road_noise(truck: Vehicle) -> None:
    record = fw.simulate(truck, count=1, sensors=dict.fromkeys(GYROS, 1e-12))
    ratios = sigma_ratios(record.signals, record.time, truck, seeds=2)
    assert list(ratios.values()) == pytest.approx([1.0] * 5, abs=0.2)
