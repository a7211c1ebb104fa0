"""Open loops: the steer angle for a lateral acceleration against the yaw-roll model, and the shape of each."""

import numpy as np
import pytest

from fifthwheel.base.errors import SignalError
from fifthwheel.model import dynamics
from fifthwheel.model.manoeuvres import single_sine, step_input
from fifthwheel.model.manoeuvres.open_loops import (
    pulse,
    random,
    sine_with_dwell,
    single_track_steer,
    slowly_increasing_steer,
    sweep,
)
from fifthwheel.truck import get
from tests.model.manoeuvres.conftest import KMH_88, G


@pytest.mark.parametrize("name", ["cheng_cebon_2011", "auburn_6x4_unladen"])
@pytest.mark.parametrize("frequency", [0.01, 0.4, 0.8])
def test_single_track_steer_is_close_to_the_yaw_roll_model(name, frequency):
    vehicle, speed = get(name), 20.0
    m = dynamics.matrices(vehicle, speed, roll=True)
    response = dynamics.frequency_response(vehicle, speed, np.array([frequency]), roll=True)[0, :, 0]
    velocity, yaw_rate = (response[m.states.index(f"{q}.tractor")] for q in ("lateral_velocity", "yaw_rate"))
    s, tractor = 2j * np.pi * frequency, vehicle.units[0]
    front = s * (velocity + (tractor.axles[0].position - tractor.cog) * yaw_rate) + speed * yaw_rate
    assert single_track_steer(vehicle, speed, 1.5, frequency) * abs(front) == pytest.approx(1.5, rel=0.3)
    assert single_track_steer(vehicle, speed, 1.0, 0.002) == pytest.approx(
        single_track_steer(vehicle, speed, 1.0), rel=1e-2
    )


def test_steady_steer_is_that_of_the_text_books(truck):
    loads = truck.axle_loads()
    understeer = loads["tractor.front"] / 475e3 - loads["tractor.drive"] / 766e3
    assert single_track_steer(truck, 20.0, 2.0) == pytest.approx(2.0 * (3.7 / 400 + understeer / G))


def test_single_sine_step_and_pulse(truck):
    sine = single_sine(truck, frequency=0.5, lead=2.0)
    steered = np.flatnonzero(np.abs(sine.steer) > 1e-12)
    assert sine.time[steered[[0, -1]]] == pytest.approx([2.01, 3.99])
    assert sine.steer.max() == pytest.approx(-sine.steer.min(), rel=1e-3)
    step = step_input(truck, acceleration=2.0)
    assert step.steer[-1] == single_track_steer(truck, KMH_88, 2.0)
    ramp = step.time[(step.steer > 1e-9) & (step.steer < step.steer[-1] - 1e-9)]
    assert ramp == pytest.approx(np.arange(1.01, 1.095, 0.01))
    driven = pulse(truck, acceleration=3.0, width=0.4, lead=2.0)
    inside = (driven.time > 2.0) & (driven.time < 2.4)
    assert driven.steer.max() == pytest.approx(single_track_steer(truck, KMH_88, 3.0))
    assert (driven.steer[inside] > 0).all()
    assert driven.steer[~inside] == pytest.approx(0.0, abs=1e-12)


def test_random_is_limited_to_its_band(truck):
    noise = random(truck, duration=200, seed=5)
    power = np.abs(np.fft.rfft(noise.steer)) ** 2
    frequency = np.fft.rfftfreq(len(noise.steer), 0.01)
    assert power[(frequency > 0.04) & (frequency < 1.01)].sum() > 0.99 * power.sum()
    np.testing.assert_array_equal(noise.steer, random(truck, duration=200, seed=5).steer)
    assert not np.array_equal(noise.steer, random(truck, duration=200, seed=6).steer)


def test_sweep_has_the_phase_of_a_linear_sweep(truck):
    wave = sweep(truck)
    crossings = wave.time[1:-1][wave.steer[:-2] * wave.steer[1:-1] < 0]
    cycles = 0.1 * crossings + (1.5 - 0.1) * crossings**2 / (2 * 60)  # integral of the frequency from 0.1 to 1.5 Hz
    np.testing.assert_allclose(cycles, np.arange(1, len(cycles) + 1) / 2, atol=0.02)


def test_the_sine_dwells_at_its_second_peak(truck):
    driven = sine_with_dwell(truck, frequency=0.5, dwell=1.0, lead=2.0)
    lowest = driven.steer <= 0.9999 * driven.steer.min()
    assert driven.time[driven.steer.argmax()] == pytest.approx(2.5)
    assert np.ptp(driven.time[lowest]) == pytest.approx(1.0, abs=0.03)
    assert driven.time[lowest][0] == pytest.approx(3.5, abs=0.02)
    outside = (driven.time < 2.0) | (driven.time > 5.0)
    assert driven.steer[outside] == pytest.approx(0.0, abs=1e-12)
    assert driven.steer.max() == pytest.approx(-driven.steer.min())


def test_the_slowly_increasing_steer_rises_at_a_constant_rate(truck):
    driven = slowly_increasing_steer(truck, acceleration=2.5, lead=3.0, duration=28.0)
    rates = np.diff(driven.steer[driven.time >= 3.0])
    assert rates == pytest.approx(rates[0])
    assert driven.steer[-1] == pytest.approx(single_track_steer(truck, KMH_88, 2.5))
    with pytest.raises(SignalError, match="duration after the lead: expected a number above 0"):
        slowly_increasing_steer(truck, duration=2.0)
