"""When a learner learns: both sides of every limit, against formulas of continuous time."""

import numpy as np
import pytest

from fifthwheel.estimate.filters.step_rows import play_contact
from fifthwheel.estimate.observe import Status
from fifthwheel.estimate.online import LearnerSettings
from fifthwheel.estimate.online.live_filter import InnovationStatistics, LiveFilter
from fifthwheel.estimate.online.online_model import Excitation, PlayContacts, online_setup
from fifthwheel.truck import Vehicle
from tests.estimate.online.conftest import FIVE

EDGE = 1e-6
SETTINGS = LearnerSettings(hold=0.4, max_steer_dropout=0.1, settling_time=0.7)
SIGNALS = ("speed", "steer.tractor.front", "yaw_rate.tractor")


@pytest.mark.slow
def test_a_long_dropout_of_the_steer_angle_must_settle(guess: Vehicle) -> None:
    """Longer than 0.1 s; then 0.7 s must pass since its end, and the steer angle must be measured now."""
    setup = online_setup(guess, SIGNALS, FIVE)

    def settled(*samples: tuple[float, float | None, float | None]) -> bool:
        """Of a filter after samples of time, speed and steer angle."""
        n = len(setup.unknowns)
        live = LiveFilter(setup, SETTINGS, np.zeros(n), np.eye(n))
        for time, speed, steer in samples:
            assert live.push(time, [speed, steer], [0.0]) is Status.SETTLING
        return live._has_settled()

    start = (0.0, 20.0, 0.1)
    short = (start, (0.1, 20.0, None))
    long = (start, (0.1 + EDGE, 20.0, None))
    assert settled(start)
    assert not settled(*short)
    assert settled(*short, (0.2, 20.0, 0.1))
    assert not settled(*long, (0.2, 20.0, 0.1))
    assert not settled(*long, (0.8, 20.0, 0.1))
    assert settled(*long, (0.8 + 2 * EDGE, 20.0, 0.1))
    assert settled(start, (0.15, None, 0.1), (0.2, 20.0, 0.1))  # a held speed does no harm


def power(amplitude: float, frequency: float, high_pass: float) -> float:
    """Mean square of a sine after a first-order high-pass filter."""
    w = 2 * np.pi * frequency * high_pass
    return amplitude**2 / 2 * w**2 / (1 + w**2)


def excited(excitation: Excitation, amplitude: float, *, mean: float = 0.0, seconds: float = 30.0) -> np.ndarray:
    """Answers to a sine of 0.5 Hz in lateral acceleration at 25 m/s."""
    u, dt = 25.0, 0.01
    gain = u**2 / (excitation.wheelbase + excitation.understeer * u**2)
    times = np.arange(0, seconds, dt)
    accelerations = mean + amplitude * np.sin(np.pi * times)
    return np.array([excitation.update(dt, [u, a / gain]) for a in accelerations])


def test_excitation_is_the_rms_of_the_lateral_acceleration(truck: Vehicle) -> None:
    """With a long window the mean square of a sine is known; learning starts at 0.25 and stops at 0.1 m/s^2."""
    settings = LearnerSettings(excitation_window=5.0, high_pass_time=4.0)
    for rms, on in ((0.23, False), (0.27, True)):
        excitation = Excitation(truck, 1, settings)
        answers = excited(excitation, rms * 2**0.5)
        assert answers[-200:].all() == on == answers[-200:].any()
        assert excitation.power[0] == pytest.approx(power(rms * 2**0.5, 0.5, 4.0), rel=0.08)
        assert excitation.mean[0] == pytest.approx(0.0, abs=0.05)
        excitation.restart()
        assert (excitation.on, excitation.power, excitation.level) == (False, [0.0], [0.0])
    for rms, on in ((0.11, True), (0.09, False)):
        excitation = Excitation(truck, 1, settings)
        assert excited(excitation, 1.0).any()
        assert excited(excitation, rms * 2**0.5, seconds=60.0)[-100:].all() == on


def test_nothing_is_learned_beyond_the_linear_range(truck: Vehicle) -> None:
    """A steady lateral acceleration of 3 m/s^2, to either side."""
    settings = LearnerSettings(excitation_window=5.0)
    for mean, on in ((2.7, True), (-2.7, True), (3.3, False), (-3.3, False)):
        excitation = Excitation(truck, 1, settings)
        answers = excited(excitation, 0.8, mean=mean)
        assert answers[-200:].all() == on == answers[-200:].any()
    assert excited(Excitation(truck, 1, settings, tyres="saturating"), 0.8, mean=5.0)[-200:].all()


def test_the_steering_equals_that_of_a_record() -> None:
    """Contacts of a play sample by sample, and rates of the steer angles."""
    time = np.arange(0, 10, 0.01)
    steer = 0.02 * np.sin(3 * time) + 0.005 * np.sin(17 * time)
    for play in (0.01, 0.001):
        steering, contacts = PlayContacts(1), [0.0]
        for k in range(1, time.size):
            last, inputs = [20.0, steer[k - 1]], [21.0, steer[k]]
            before, after = steering.update(0.01, last, inputs, [play])
            rate = (steer[k] - steer[k - 1]) / 0.01
            assert before == pytest.approx([*last, contacts[-1], rate])
            contacts.append(after[2])
            assert after == pytest.approx([*inputs, contacts[-1], rate])
        np.testing.assert_allclose(contacts, play_contact(steer, play), atol=1e-12)
    before, after = PlayContacts(1).update(0.0, [20.0, 0.1], [20.0, 0.2], [])
    assert before[2] == after[2] == 0.0  # exactly no play
    assert after[3] == pytest.approx(0.1 / 1e-3)  # the shortest step


def test_innovation_statistics_follow_a_change_with_their_time_constant() -> None:
    """A first-order lag of 5 s for the mean square, of missing and limited innovations none."""
    statistics = InnovationStatistics(["a", "b", "c"], 5.0, 3.0)
    for k in range(1, 1001):
        statistics.update(0.01, [2.0, 9.0, 9.0], [1.0, 1.0, 0.0])
        lagged = 1 - np.exp(-0.01 * k / 5.0)
        assert statistics.mean_square == pytest.approx([1 + 3 * lagged, 1 + 8 * lagged, 1.0], rel=2e-3)
    assert statistics.autocorrelation[2] == 1.0
    before = statistics.as_dict()
    constant, weight, average, expected = InnovationStatistics(["a"], 5.0, 3.0), 0.01 / 1.01, 0.0, 1.0
    for _ in range(2000):  # after the average has settled, 1 / (w / (2 - w)) is approached with 50 s
        constant.update(0.01, [1.0], [1.0])
        average += weight * (1 - average)
        expected += 0.01 / 50.01 * (average**2 / (weight / (2 - weight)) - expected)
    assert constant.autocorrelation[0] == pytest.approx(expected)
    statistics.update(0.0, [2.0, 9.0, 9.0], [1.0, 1.0, 1.0])
    assert statistics.as_dict() == before
    other = InnovationStatistics(["c", "d", "a"], 5.0, 3.0)
    other.restore(**before)
    assert other.mean_square == [1.0, 1.0, statistics.mean_square[0]]
    assert other.autocorrelation == [1.0, 1.0, statistics.autocorrelation[0]]
