"""The one-stage problem's cost, and its derivatives against differences."""

import numpy as np
import pytest

from fifthwheel import dynamics
from fifthwheel.identify import OneStage
from fifthwheel.identify.parameters import one_stage_unknowns
from fifthwheel.identify.problem import Problem
from fifthwheel.identify.stage import Log
from fifthwheel.logs import Record
from fifthwheel.observe.prepare import fast_enough, locked_but
from fifthwheel.simulate import simulate
from fifthwheel.vehicle import Vehicle


def problem(truck: Vehicle, records: list[Record], settings: OneStage) -> Problem:
    truck = locked_but(truck, records[0].signals, "the records")
    outputs = tuple(name for name in records[0].signals if "rate" in name)
    free = tuple(dynamics.all_parameters(truck, outputs))
    model = dynamics.model(truck, outputs, roll=True, bank=settings.nuisances, free=free)
    logs = [Log(name=r.name, sections=fast_enough(r, 5.0)) for r in records]
    return Problem(model, truck, logs, one_stage_unknowns(truck, outputs, settings), settings)


@pytest.fixture(scope="module")
def records(truck: Vehicle) -> list[Record]:
    """Two logs, one of them with a stop that cuts it in two, a gap in a channel and a spike."""
    first, second = (simulate(truck, count=1, seed=seed, name=f"log {seed}").cut(0.5, 5.0) for seed in (1, 2))
    speed, gyro = first.signals["speed"].copy(), first.signals["yaw_rate.tractor"].copy()
    speed[200:260], gyro[300:340], gyro[100] = 3.0, np.nan, 3.0
    return [first.with_signals({"speed": speed, "yaw_rate.tractor": gyro}), second]


@pytest.mark.parametrize("form", ["output_error", "prediction_error"])
def test_gradient(truck: Vehicle, records: list[Record], form: str) -> None:
    """Of everything: parameters, steer and gyro errors, delay, initial states and bank."""
    whole = problem(truck, records, OneStage(form=form, initial_payload_height=1.0, rate_gain_prior=0.05))
    rng = np.random.default_rng(3)
    z = 0.1 * rng.normal(size=len(whole.names))
    found = whole.expand(z, directions="all")
    assert found.cost == pytest.approx(whole.cost(z), rel=1e-9)
    step = 1e-4
    for i in range(0, len(z), 1 if form == "output_error" else 3):
        if whole.names[i].endswith(".delay"):
            continue  # samples between which a steer angle bends come and go
        moved = np.eye(len(z))[i] * step
        expected = (whole.cost(z + moved) - whole.cost(z - moved)) / (2 * step)
        scale = np.sqrt(found.hessian[i, i])
        assert abs(found.gradient[i] - expected) < 2e-4 * (abs(expected) + scale), whole.names[i]
    assert np.linalg.eigvalsh(found.hessian).min() > 0.99


def test_a_delay_moves_the_steer_angle(truck: Vehicle) -> None:
    whole = problem(truck, [simulate(truck, count=1, seed=1)], OneStage(initial_payload_height=None))
    i = whole.names.index("steer.tractor.front.delay")
    costs = []
    for late in (-0.03, 0.0, 0.03):
        z = np.zeros(len(whole.names))
        z[i] = late / 0.1
        costs.append(whole.cost(z))
    assert costs[1] < min(costs[0], costs[2]) - 1


def test_names_of_logs_and_sections(truck: Vehicle, records: list[Record]) -> None:
    whole = problem(truck, records, OneStage())
    assert len(set(whole.names)) == len(whole.names)
    for name in ("steer.tractor.front.offset@0", "steer.tractor.front.offset@1", "bank.road@0.0", "bank.road@0.1"):
        assert name in whole.names
    assert "steer.tractor.front.gain" in whole.names
    assert whole.sections() == [(0, 0), (0, 1), (1, 0)]
    assert not problem(truck, records, OneStage(form="prediction_error")).starts[0][0].size


def test_the_hessian_is_the_information(truck: Vehicle) -> None:
    """Scores of many drives scatter as the Hessian at the truth says."""
    settings = OneStage(priors={}, consider={}, nuisances=False, initial_payload_height=None, outlier=100.0)
    scores = []
    for seed in range(60):
        whole = problem(truck, [simulate(truck, count=1, seed=seed).cut(0.5, 4.5)], settings)
        found = whole.expand(np.zeros(len(whole.names)))
        scores.append(found.gradient[:5])
    spread = np.cov(np.array(scores).T)
    information = (found.hessian - np.eye(len(whole.names)))[:5, :5]
    # 60 draws: a variance is known to 18 %
    assert np.diag(spread) / np.diag(information) == pytest.approx(np.ones(5), abs=0.55)


def test_noise_is_found_in_spite_of_spikes(truck: Vehicle) -> None:
    record = simulate(truck, count=1, seed=4)
    gyro = record.signals["yaw_rate.tractor"].copy()
    clean = problem(truck, [record], OneStage(initial_payload_height=None))
    gyro[::97] += 2.0
    spiked = problem(truck, [record.with_signals({"yaw_rate.tractor": gyro})], OneStage(initial_payload_height=None))
    for whole in (clean, spiked):
        for _ in range(8):
            whole.adapt(np.zeros(len(whole.names)), coloured=False)
    found, expected = (w.logs[0].noise["yaw_rate.tractor"] for w in (spiked, clean))
    assert expected == pytest.approx(0.000016, rel=0.15)
    assert expected < found < 1.5 * expected
