"""A self-steering trailer axle: stated, and not stated, in which case the estimates are doubtful."""

from dataclasses import replace

import pytest

import fifthwheel as fw
from fifthwheel.estimate.identify.doubts import DoubtKind
from fifthwheel.estimate.identify.given import applied
from fifthwheel.estimate.identify.unknowns.parameters import one_stage_unknowns
from fifthwheel.truck import Vehicle
from tests.model.dynamics.test_steered_axles import LIFTED, with_axle

PATH = "semitrailer.rear.self_steering"
FIXED, CASTOR = with_axle({}), with_axle({"self_steering": 0.8})
LINEAR = fw.OneStage(tyres="linear")
EXACT = replace(LINEAR, given={"self_steering": "exact"})


def unknowns(truck: Vehicle, settings: fw.OneStage = LINEAR) -> dict[str, tuple[float, float, bool]]:
    """Prior mean, sigma and kind of what steers itself."""
    truck, settings = applied(truck, settings)
    found = one_stage_unknowns(truck, ["yaw_rate.tractor"], settings)
    assert all(0 <= u.lower < u.upper == 1 for u in found if u.name == PATH)
    return {u.name: (u.centre, u.scale, u.reported) for u in found if "self_steering" in u.name}


def test_a_last_axle_may_be_a_castor_axle() -> None:
    reported = False
    assert unknowns(FIXED) == {PATH: (0.0, 0.015, reported)}
    assert unknowns(FIXED.replace({PATH: 0.0}).with_stated({PATH: 0.05})) == {PATH: (0.0, 0.05, reported)}
    assert unknowns(FIXED.replace({PATH: 0.0}).with_stated({PATH: 0.0})) == {}
    assert unknowns(FIXED.with_stated(dict.fromkeys(FIXED.parameters(), 0.0))) == {}
    assert unknowns(with_axle(LIFTED)) == {"semitrailer.middle.self_steering": (0.0, 0.015, reported)}
    assert unknowns(with_axle({"steerable": True})) == unknowns(with_axle({"command_steering": 0.3})) == {}
    assert unknowns(FIXED, EXACT) == {}
    assert set(unknowns(fw.vehicle("auburn_6x4"))) == {"semitrailer.rear.self_steering"}


def test_a_castor_axle_of_the_file_is_uncertain() -> None:
    assert unknowns(CASTOR) == {PATH: (0.8, 0.1, False)}
    assert unknowns(CASTOR.with_stated({PATH: 0.03})) == {PATH: (0.8, 0.03, False)}
    assert unknowns(CASTOR.with_stated({PATH: 0.0})) == unknowns(CASTOR, EXACT) == {}
    assert unknowns(CASTOR, replace(LINEAR, given={PATH: "free"})) == {PATH: (0.8, 0.3, True)}
    stated = unknowns(CASTOR, replace(LINEAR, given={PATH: "+- 20 %"}))
    assert stated == {PATH: (0.8, pytest.approx(0.16), False)}
    settings = replace(EXACT, given={**EXACT.given, PATH: "0.7 +- 0.05"})
    assert unknowns(FIXED, settings) == unknowns(CASTOR, settings) == {PATH: (0.7, 0.05, False)}


def blamed(result: fw.Identification) -> list[str]:
    """The causes of what contradicts the file."""
    return [c.name for d in result.doubts if d.kind is DoubtKind.ASSUMPTION for c in d.causes]


def largest_error(result: fw.Identification) -> float:
    """Of the estimates, in their sigmas."""
    truth = CASTOR.parameters()
    return max(abs(e.value - truth[e.name]) / e.sigma for e in result.parameters if e.name in truth and e.sigma)


@pytest.mark.slow
def test_a_log_contradicts_a_fixed_axle() -> None:
    record = fw.simulate(CASTOR, count=2, seed=1)
    doubtful, right = (fw.identify([record], file, LINEAR) for file in (FIXED, CASTOR))
    assert PATH in blamed(doubtful)
    assert "doubtful" in {e.verdict for e in doubtful.parameters}
    assert blamed(right) == []
    assert largest_error(right) < 3
