"""A parameter of the tyres that only some groups have: estimated, uncertain and fixed by its path."""

import pytest

import fifthwheel as fw
from fifthwheel.estimate.identify.given import applied
from fifthwheel.estimate.identify.unknowns.parameters import one_stage_unknowns

PATH = "tractor.front.pneumatic_trail"
TRUCK = fw.vehicle("cheng_cebon_2011").replace({PATH: 0.05})


@pytest.mark.slow
def test_it_is_estimated() -> None:
    settings = fw.OneStage(given={"*": "exact", "pneumatic_trail": "free"}, tyres="linear")
    guess = TRUCK.replace({PATH: 0.03})
    estimates = fw.identify([fw.simulate(TRUCK, count=1, seed=2)], guess, settings).parameters
    estimate = next(each for each in estimates if each.name == PATH)
    assert estimate.sigma < 0.005
    assert abs(estimate.value - 0.05) < 3 * estimate.sigma


def test_it_is_uncertain_or_fixed() -> None:
    def trails(settings: fw.OneStage, truck: fw.Vehicle = TRUCK) -> list[tuple[str, float, bool]]:
        truck, settings = applied(truck, settings)
        unknowns = one_stage_unknowns(truck, ["yaw_rate.tractor"], settings)
        return [(u.name, u.scale, u.reported) for u in unknowns if "trail" in u.name.rpartition(".")[2]]

    assert trails(fw.OneStage()) == [(PATH, 0.2, False)]
    assert trails(fw.OneStage(), fw.vehicle("cheng_cebon_2011")) == []
    known = fw.OneStage(given={"others": "exact", "pneumatic_trail": "+- 10 %"})
    assert trails(known) == [(PATH, pytest.approx(0.1), False)]
    assert trails(fw.OneStage(given={PATH: "exact"})) == []
    assert trails(fw.OneStage(given={PATH: "free"})) == [(PATH, 0.3, True)]
    assert trails(fw.OneStage(), TRUCK.with_stated({PATH: 0.02})) == [(PATH, pytest.approx(0.4), False)]
