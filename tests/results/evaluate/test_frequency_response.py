"""Frequency responses against those of the linear system."""

import numpy as np
import pytest

import fifthwheel as fw
from fifthwheel.base.errors import SignalError
from fifthwheel.base.units import STANDARD_GRAVITY as G
from fifthwheel.model.dynamics import linear_system
from fifthwheel.truck import get
from tests.results.evaluate.conftest import NOISE, U


@pytest.fixture(scope="module")
def responses(truck):
    """Gains at some frequencies by the equations, by name, with accelerations without gravity."""

    def at(frequency):
        system = linear_system(truck, U, list(NOISE))
        gains = dict(zip(system.outputs, system.frequency_response(frequency)[:, :, 0].T, strict=True))
        for unit in ("tractor", "semitrailer"):
            gains[f"lateral_acceleration.{unit}"] = gains[f"lateral_acceleration.{unit}"] - G * gains[f"roll.{unit}"]
        return gains

    return at


@pytest.mark.slow
def test_gain_phase_and_measures_are_those_of_the_equations(truck, responses):
    """Within their sigma, and 0.2 % of the simulation with steps of 20 ms."""
    log = fw.simulate(truck, manoeuvre="random", speed=U, duration=300.0, sensors=NOISE, rate=50.0, seed=4)
    found = fw.evaluate(log, "frequency_response", vehicle=truck)
    f = found.arrays["frequency"]
    for name, exact in responses(f).items():
        gain, sigma = found.arrays[f"gain.{name}"], found.arrays[f"gain_sigma.{name}"]
        used = np.isfinite(gain) & (f < 0.95)
        assert used.sum() > 10
        relative, error = sigma[used] / gain[used], gain[used] / np.abs(exact[used]) - 1
        assert np.mean(np.abs(error) < 2 * relative + 0.002) > 0.85, name
        lag = np.angle(np.exp(1j * found.arrays[f"phase.{name}"][used]) / exact[used])
        assert np.mean(np.abs(lag) < 2 * relative + 0.002) > 0.85, name
    f = np.linspace(0.02, 1.5, 1481)
    exact = responses(f)
    for q in ("yaw_rate", "lateral_acceleration"):
        ratio = np.abs(exact[f"{q}.semitrailer"] / exact[f"{q}.tractor"]).max()
        measure = found[f"rearward_amplification_{q}"]
        assert measure.value == pytest.approx(ratio, abs=3 * measure.sigma + 0.01 * ratio)
        assert 0 < measure.sigma < 0.05
    lag = -np.unwrap(np.angle(exact["yaw_rate.tractor"]))
    bandwidth = found["bandwidth.yaw_rate.tractor"]
    assert bandwidth.value == pytest.approx(f[np.argmax(lag > np.pi / 4)], abs=3 * bandwidth.sigma + 0.01)
    assert len(found.plots()) == len(NOISE)


@pytest.mark.slow
@pytest.mark.parametrize("manoeuvre", ["sweep", "random"])
def test_ninety_per_cent_of_the_intervals_contain_the_gain(truck, responses, manoeuvre):
    """With good sensors; a periodogram of segments would be biased by up to ten sigma."""
    sensors = {n: v for n, v in NOISE.items() if not n.startswith("lateral_acceleration")}
    inside = dict[str, list[bool]]()
    for seed in range(2):
        log = fw.simulate(truck, manoeuvre=manoeuvre, speed=U, duration=60.0, sensors=sensors, seed=seed)
        arrays = fw.evaluate(log, "frequency_response", vehicle=truck).arrays
        exact = responses(arrays["frequency"])
        for name in sensors:
            error = (arrays[f"gain.{name}"] - np.abs(exact[name])) / arrays[f"gain_sigma.{name}"]
            inside.setdefault(name, []).extend(np.abs(error[np.isfinite(error)]) < 1.645)
    assert all(len(values) > 50 and np.mean(values) > 0.85 for values in inside.values())


@pytest.mark.slow
def test_the_delay_of_a_long_combination_does_not_reduce_its_gain():
    """Its last unit follows the steer angle by up to 2 s."""
    vehicle = get("truck_full_trailer")
    ends = [f"yaw_rate.{vehicle.units[k].name}" for k in (0, -1)]
    run = fw.simulate(vehicle, manoeuvre="random", speed=U, sensors=dict.fromkeys(ends, 0.0), duration=300.0, rate=20.0)
    found = fw.evaluate(run, "frequency_response", vehicle=vehicle)["rearward_amplification_yaw_rate"]
    first, last = np.abs(linear_system(vehicle, U, ends).frequency_response(np.linspace(0.1, 1, 901))[:, :, 0]).T
    assert found.value == pytest.approx((last / first).max(), rel=0.006)
    assert found.sigma < 0.02 * found.value


def test_single_manoeuvres_and_a_log_without_coherent_steering_are_refused(truck):
    log = fw.simulate(truck, manoeuvre="straight", speed=U)
    with pytest.raises(SignalError, match=r"the truck is steered for .* at least 40 % needed; steer continuously"):
        fw.evaluate(log, "frequency_response", vehicle=truck)
    steer = np.random.default_rng(1).normal(size=len(log))
    log = log.with_signals({"steer.tractor.front": 1e-4 * steer})
    with pytest.raises(SignalError, match=r"yaw_rate\.tractor: coherence with the steer angle .* steer at random"):
        fw.evaluate(log, "frequency_response", vehicle=truck)


def test_signals_of_other_quantities_give_no_amplification(truck):
    """An accelerometer on the trailer and a gyro on the tractor do not compare."""
    sensors = {n: NOISE[n] for n in ("yaw_rate.tractor", "lateral_acceleration.semitrailer")}
    log = fw.simulate(truck, manoeuvre="random", speed=U, sensors=sensors)
    found = fw.evaluate(log, "frequency_response", vehicle=truck)
    assert not any(m.name.startswith("rearward") for m in found)
    assert found["gain.yaw_rate.tractor"].sigma > 0
