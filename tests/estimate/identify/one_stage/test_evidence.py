"""Doubts on logs of the linear truck with a known fault, and none without one."""

from dataclasses import replace

import numpy as np
import pytest

from fifthwheel.data.record import Record
from fifthwheel.estimate.identify import Identification, OneStage, identify
from fifthwheel.estimate.identify.doubts import Doubt, DoubtKind
from fifthwheel.estimate.identify.verdict import Verdict
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import Vehicle

YAW, TRAILER = "yaw_rate.tractor", "yaw_rate.semitrailer"
LINEAR = OneStage(tyres="linear")
FRONT = "tractor.front.cornering_stiffness"


@pytest.fixture(scope="module")
def clean(truck: Vehicle) -> Record:
    return simulate(truck, count=2, seed=1)


def late(record: Record, delay: float, *names: str) -> Record:
    return record.with_signals({n: np.interp(record.time - delay, record.time, record.signals[n]) for n in names})


def doubts(result: Identification, kind: DoubtKind) -> list[Doubt]:
    return [doubt for doubt in result.doubts if doubt.kind is kind]


@pytest.mark.slow
def test_a_clean_log_gives_no_doubt(truck: Vehicle, clean: Record) -> None:
    result = identify([clean], truck, LINEAR)
    assert result.doubts == ()
    assert {e.verdict for e in result.parameters} == {Verdict.CONVERGED}


@pytest.mark.slow
def test_a_late_gyro_is_the_most_likely_cause(truck: Vehicle, clean: Record) -> None:
    """70 ms are seven standard deviations of the prior of a latency; the cause and its size are found. An unknown delay
    of the steering would explain much of that of the tractor."""
    settings = replace(LINEAR, given={"steer.*.delay": "+- 5 ms"})
    result = identify([late(clean, 0.07, YAW)], truck, settings)
    (doubt,) = doubts(result, DoubtKind.ASSUMPTION)
    cause = doubt.causes[0]
    assert cause.name == f"{YAW}.delay"
    assert cause.changes == {f"{YAW}.delay": pytest.approx(0.07, abs=0.03)}
    assert cause.prior_sigmas == pytest.approx(cause.changes[f"{YAW}.delay"] / 0.01)
    doubtful = {e.name for e in result.parameters if e.verdict is Verdict.DOUBTFUL}
    assert doubtful == set(doubt.parameters)
    truth = truck.parameters()
    assert all(abs(e.value - truth[e.name]) < 3.5 * e.sigma for e in result.parameters)


@pytest.mark.slow
def test_a_late_time_base_that_is_known_is_estimated(truck: Vehicle, clean: Record) -> None:
    names = (TRAILER, "roll_rate.semitrailer")
    record = replace(late(clean, 0.05, *names), time_bases=dict.fromkeys(names, "trailer logger"))
    result = identify([record], truck, LINEAR)
    assert result.doubts == ()
    (delay,) = [e for e in result.sensors if e.name == "time_base.trailer logger.delay"]
    assert abs(delay.value - 0.05) < 3.5 * delay.sigma
    assert delay.sigma < 0.02


@pytest.mark.slow
def test_an_unusual_sensor_error(truck: Vehicle, clean: Record) -> None:
    """A bias of ten standard deviations. The two yaw rates do not show which of them is biased, so both are named."""
    biased = clean.with_signals({YAW: clean.signals[YAW] + 0.04})
    result = identify([biased], truck, OneStage(tyres="linear", given={"others": "exact"}))
    (doubt,) = result.doubts
    assert doubt.kind is DoubtKind.ASSUMPTION
    causes = {cause.name: cause for cause in doubt.causes}
    assert causes.keys() == {f"{YAW}.offset@0", f"{TRAILER}.offset@0"}
    for name, sign in ((YAW, 1), (TRAILER, -1)):
        cause = causes[f"{name}.offset@0"]
        assert cause.prior_sigmas == pytest.approx(sign * 10, abs=1)
        assert cause.changes == {f"{name}.offset": pytest.approx(cause.prior_sigmas * 0.004)}


def test_an_unusual_estimate(truck: Vehicle, clean: Record) -> None:
    """A stiffness of 30 % of the true value in the vehicle file is doubtful, and no other one."""
    wrong = truck.replace({FRONT: 0.3 * truck.parameters()[FRONT]})
    result = identify([clean], wrong, OneStage(tyres="linear", given={"others": "exact"}))
    (doubt,) = result.doubts
    assert (doubt.kind, doubt.parameters) == (DoubtKind.ESTIMATE, (FRONT,))
    (cause,) = doubt.causes
    assert cause.prior_sigmas == pytest.approx(np.log(1 / 0.3) / 0.3, rel=0.1)
    assert cause.changes == {FRONT: pytest.approx(result[FRONT].value - wrong.parameters()[FRONT])}
    verdicts = {e.name: e.verdict for e in result.parameters}
    assert verdicts.pop(FRONT) is Verdict.DOUBTFUL
    assert set(verdicts.values()) == {Verdict.CONVERGED}
