"""More information never enlarges a sigma: fits of the nonlinear truck with errors of file and sensors."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from fifthwheel.data.record import Record
from fifthwheel.estimate.identify import OneStage, identify
from fifthwheel.model.manoeuvres import lane_changes
from fifthwheel.model.plant import Plant, article_sensors
from fifthwheel.truck import Vehicle, get

TRUCK = get("cheng_cebon_2011")
ROUNDING = 1.02
"""The noise model of each fit is estimated from its own residuals."""


@pytest.fixture(scope="module")
def logs() -> list[Record]:
    run = Plant(TRUCK).drive(lane_changes(count=1))
    return [replace(run.record(article_sensors(TRUCK), seed=seed), name=f"log {seed}") for seed in range(2)]


@pytest.fixture(scope="module")
def wrong() -> Vehicle:
    """The truck with errors of its file, each about one standard deviation."""
    values, rng = TRUCK.parameters(), np.random.default_rng(3)
    names = [name for name in values if name.endswith(("stiffness", "roll_axis_height", "roll_damping"))]
    errors = {name: values[name] * (1 + 0.1 * rng.normal()) for name in names}
    return TRUCK.replace(errors | {"semitrailer.cog": values["semitrailer.cog"] + 0.1})


def sigmas(logs: list[Record], vehicle: Vehicle, settings: OneStage) -> Mapping[str, float]:
    return {e.name: e.sigma for e in identify(logs, vehicle, settings).parameters if e.sigma is not None}


@pytest.mark.slow
def test_more_information_never_enlarges_a_sigma(logs: list[Record], wrong: Vehicle) -> None:
    """A second log; sensors that are known better; numbers of the vehicle file that are measured."""
    settings, true = OneStage(), TRUCK.parameters()
    usual = sigmas(logs[:1], wrong, settings)
    better = {
        "second log": sigmas(logs, wrong, settings),
        "steer gain": sigmas(logs[:1], wrong, replace(settings, given={**settings.given, "steer.*.gain": "+- 2 %"})),
    }
    for name in ("semitrailer.cog", "semitrailer.roll_stiffness"):
        measured = wrong.replace({name: true[name]}).with_stated({name: 0.002 * abs(true[name])})
        better[name] = sigmas(logs[:1], measured, settings)
    for information, sigma in better.items():
        for name in (name for name in sigma if not name.startswith("road")):
            assert sigma[name] < ROUNDING * usual[name], (information, name)
    assert sum(better["second log"].values()) < sum(usual.values())


@pytest.mark.slow
def test_a_truck_above_its_critical_speed() -> None:
    """Drive tyres of 55 %: no free-running model follows the log; prediction errors identify all parameters."""
    name = "tractor.drive.cornering_stiffness"
    soft = TRUCK.replace({name: 0.55 * TRUCK.parameters()[name]})
    record = Plant(soft).drive(lane_changes(count=1)).record(article_sensors(soft), seed=1)
    result = identify([record], TRUCK, OneStage())
    assert any("from prediction errors" in note for note in result.notes)
    for e in result.parameters:
        assert e.verdict == "converged", e.name
        assert e.name == "road.friction" or abs(e.value - soft.parameters()[e.name]) < 1.645 * e.sigma, e.name
