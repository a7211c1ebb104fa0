"""Score tests with a stiffness that varies from window to window, against the same tests with an unknown per window."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from fifthwheel.identify import OneStage, identify
from fifthwheel.identify.doubts import DoubtKind, ScoreTest, score_tests
from fifthwheel.identify.one_stage.stiffness_variation import VARIATION, WINDOW, StiffnessVariation
from fifthwheel.identify.unknowns.unknown import Unknown, UnknownKind
from fifthwheel.manoeuvres import course
from fifthwheel.plant import Plant, Properties, article_sensors
from fifthwheel.vehicle import Vehicle

NAMES = ("tractor.front.cornering_stiffness", "steer.tractor.front.gain", "tractor.cog", "tractor.mass")
CONSIDERED = NAMES[2:]
PRIOR = 0.3


def stand_in(**consider: float) -> Any:
    """What `StiffnessVariation` needs of a problem."""
    stiffness = Unknown(
        name=NAMES[0], centre=4e5, scale=PRIOR, lower=1e5, upper=1e6, logarithmic=True, kind=UnknownKind.PARAMETER
    )
    gain = Unknown(name=NAMES[1], centre=1.0, scale=0.1, lower=0.5, upper=2.0, kind=UnknownKind.PARAMETER)
    return SimpleNamespace(names=NAMES, unknowns=(stiffness, gain), settings=OneStage(consider=consider))


def windows(seed: int) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Gradient and information of the logs in three windows."""
    rng = np.random.default_rng(seed)
    jacobians = [10 * rng.normal(size=(20, 4)) @ (np.eye(4) + 0.4 * rng.normal(size=(4, 4))) for _ in range(3)]
    return [-J.T @ rng.normal(size=20) for J in jacobians], [J.T @ J for J in jacobians]


def reduced_tests(variation: StiffnessVariation, gradients: list[Any], informations: list[Any]) -> list[ScoreTest]:
    indices = np.arange(len(NAMES))
    for gradient, information in zip(gradients, informations, strict=True):
        for _ in range(2):  # each window comes in two halves
            variation.add(WINDOW / 2, indices, gradient / 2, information / 2)
    variation.end_window()
    gradient, information = sum(gradients) - variation.gradient, sum(informations) - variation.information
    return score_tests(NAMES, gradient, information, CONSIDERED)


@pytest.mark.parametrize("seed", range(5))
def test_it_is_one_more_unknown_in_each_window(seed: int) -> None:
    gradients, informations = windows(seed)
    k, step = len(NAMES), VARIATION / PRIOR  # of z in one window, for a standard deviation of the variation
    H, g = np.zeros((k + 3, k + 3)), np.zeros(k + 3)
    for w, (gradient, information) in enumerate(zip(gradients, informations, strict=True)):
        to_all = np.zeros((k + 3, k))
        to_all[:k], to_all[k + w, 0] = np.eye(k), step
        H += to_all @ information @ to_all.T
        g += to_all @ gradient
    expected = score_tests((*NAMES, "window 0", "window 1", "window 2"), g, H, CONSIDERED)
    actual = reduced_tests(StiffnessVariation(stand_in(softening=1.0), {NAMES[0]: 3e5}), gradients, informations)
    for test, other in zip(actual, expected, strict=True):
        assert test.name == other.name
        assert (test.statistic, test.implied) == pytest.approx((other.statistic, other.implied), rel=1e-9)
        assert test.shifts == pytest.approx(other.shifts[:k], rel=1e-9)


def test_linear_tyres_do_not_vary() -> None:
    gradients, informations = windows(0)
    variation = StiffnessVariation(stand_in(), {NAMES[0]: 3e5})
    reduced_tests(variation, gradients, informations)
    assert not variation.gradient.any()
    assert not variation.information.any()


@pytest.mark.slow
def test_everyday_driving_of_the_nonlinear_truck_gives_no_doubt(truck: Vehicle) -> None:
    """With a constant stiffness, its bends are evidence for a latency of the tractor's gyro, with a statistic of 9."""
    run = Plant(truck, Properties()).drive(course("everyday", truck, duration=600.0, seed=0))
    result = identify([run.record(article_sensors(truck), seed=0)], truck)
    assert DoubtKind.ASSUMPTION not in {doubt.kind for doubt in result.doubts}
