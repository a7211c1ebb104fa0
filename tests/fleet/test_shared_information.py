"""The information of single logs, against the identification of all logs together."""

import datetime

import pytest

import fifthwheel as fw
from fifthwheel.fleet.combination import combine
from fifthwheel.fleet.trips import trip_content
from fifthwheel.identify.one_stage.shared_information import identify_with_information
from fifthwheel.options import FleetSettings

TRUCK = fw.vehicle("cheng_cebon_2011")
GUESS = TRUCK.replace({"tractor.front.cornering_stiffness": 4.2e5, "semitrailer.cornering_stiffness": 1.1e6})


def record(seed, *, count=1, without=""):
    made = fw.simulate(TRUCK, count=count, seed=seed, speed=20.0 + seed)
    signals = {name: values for name, values in made.signals.items() if not (without and name.startswith(without))}
    return fw.Record(time=made.time, signals=signals, name=f"run {seed}")


def test_single_logs_combine_to_the_identification_of_all() -> None:
    """Without drift, value and sigma of every parameter are those of the identification of both logs. Each log is
    linearised at its own estimate, which explains the rest of the difference."""
    records = [record(0, count=4), record(1, count=4)]
    together = fw.identify(records, GUESS)
    rows = []
    for k, one in enumerate(records):
        identification, information = identify_with_information(one, GUESS, fw.OneStage())
        labels = {"log": one.name, "truck": "T", "trailer": "A", "load": "", "date": datetime.datetime(2026, 1, 1 + k)}
        rows.append(labels | trip_content(identification, information, one))
    combined = combine("T", rows, FleetSettings(tyre_walk=0.0), 1e-3)
    found = {unknown.name: combined.estimate(1, unknown) for unknown in combined.parameters(1)}
    for expected in together.parameters:
        value, sigma = found[expected.name]
        assert abs(value - expected.value) < 0.1 * expected.sigma
        assert sigma == pytest.approx(expected.sigma, rel=0.05)


def test_a_parameter_that_needs_a_missing_roll_rate_is_not_shared() -> None:
    _, information = identify_with_information(record(2, without="roll_rate"), GUESS, fw.OneStage())
    assert "semitrailer.payload.height" not in information.names
    assert "semitrailer.cornering_stiffness" in information.names
