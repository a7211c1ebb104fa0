"""A parameter of the tyres that only some groups have: estimated, uncertain and fixed by its path."""

import pytest

import fifthwheel as fw
from fifthwheel.identify.unknowns.parameters import one_stage_unknowns
from fifthwheel.identify.unknowns.unknown import UnknownKind

PATH = "tractor.front.pneumatic_trail"
TRUCK = fw.vehicle("cheng_cebon_2011").replace({PATH: 0.05})


def test_it_is_estimated() -> None:
    settings = fw.OneStage(free=("pneumatic_trail",), consider={}, nuisances=False, tyres="linear")
    guess = TRUCK.replace({PATH: 0.03})
    estimates = fw.identify([fw.simulate(TRUCK, count=1, seed=2)], guess, settings).parameters
    estimate = next(each for each in estimates if each.name == PATH)
    assert estimate.sigma < 0.005
    assert abs(estimate.value - 0.05) < 3 * estimate.sigma


def test_it_is_uncertain_or_fixed() -> None:
    def trails(settings: fw.OneStage, truck: fw.Vehicle = TRUCK) -> list[tuple[str, float, UnknownKind]]:
        unknowns = one_stage_unknowns(truck, ["yaw_rate.tractor"], settings)
        return [(u.name, u.scale, u.kind) for u in unknowns if "trail" in u.name.rpartition(".")[2]]

    assert trails(fw.OneStage()) == [(PATH, 0.2, UnknownKind.UNCERTAIN)]
    assert trails(fw.OneStage(), fw.vehicle("cheng_cebon_2011")) == []
    assert trails(fw.OneStage(consider={"pneumatic_trail": 0.1})) == [(PATH, 0.1, UnknownKind.UNCERTAIN)]
    assert trails(fw.OneStage(fixed=(PATH,))) == []
    assert trails(fw.OneStage(free=(PATH,))) == [(PATH, 0.3, UnknownKind.PARAMETER)]
    assert trails(fw.OneStage(), TRUCK.with_stated({PATH: 0.02})) == [(PATH, pytest.approx(0.4), UnknownKind.UNCERTAIN)]
