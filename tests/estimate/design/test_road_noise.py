"""The noise of an uneven road: limits of its spectra, and predicted sigmas against identified ones."""

import numpy as np
import pytest

from fifthwheel.data.record.derived import article_gyro_variance
from fifthwheel.estimate.design import DesignSettings, design_experiment
from fifthwheel.estimate.design.road_noise import ROUGHNESS, TRACK, road_density, road_roll_density
from fifthwheel.estimate.identify import OneStage
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
