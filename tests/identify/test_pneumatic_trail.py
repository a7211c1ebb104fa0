"""A parameter of the tyres that only some groups have: estimated, considered and fixed by its path, with both laws."""

import pytest

import fifthwheel as fw
from fifthwheel.dynamics.tyres import TyreLaw
from fifthwheel.identify.unknowns.parameters import one_stage_unknowns

PATH = "tractor.front.pneumatic_trail"
TRUCK = fw.vehicle("cheng_cebon_2011").replace({PATH: 0.05})


@pytest.mark.parametrize("tyres", ["linear", pytest.param("saturating", marks=pytest.mark.slow)])
def test_it_is_estimated(tyres: TyreLaw) -> None:
    free, fixed = ("pneumatic_trail",), ("road.friction",)
    settings = fw.OneStage(free=free, fixed=fixed, friction=1.5, consider={}, nuisances=False, tyres=tyres)
    guess = TRUCK.replace({PATH: 0.03})
    estimates = fw.identify([fw.simulate(TRUCK, count=1, seed=2)], guess, settings).parameters
    estimate = next(each for each in estimates if each.name == PATH)
    assert estimate.sigma < 0.005
    assert abs(estimate.value - 0.05) < 3 * estimate.sigma


def test_it_is_considered_and_fixed() -> None:
    def trails(settings: fw.OneStage, truck: fw.Vehicle = TRUCK) -> list[tuple[str, float, bool]]:
        unknowns = one_stage_unknowns(truck, ["yaw_rate.tractor"], settings)
        return [(u.name, u.scale, not u.is_estimated) for u in unknowns if "trail" in u.name.rpartition(".")[2]]

    assert trails(fw.OneStage()) == [(PATH, 0.2, True)]
    assert trails(fw.OneStage(), fw.vehicle("cheng_cebon_2011")) == []
    assert trails(fw.OneStage(consider={"pneumatic_trail": 0.1})) == [(PATH, 0.1, True)]
    assert trails(fw.OneStage(fixed=(PATH,))) == []
    assert trails(fw.OneStage(free=(PATH,))) == [(PATH, 0.3, False)]
    assert trails(fw.OneStage(), TRUCK.with_stated({PATH: 0.02})) == [(PATH, pytest.approx(0.4), True)]
