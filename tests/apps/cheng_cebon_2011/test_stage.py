"""One stage of the dual filter: what it estimates, and that it changes none of its arguments."""

import numpy as np
import pytest

from fifthwheel.apps.cheng_cebon_2011 import TwoStage
from fifthwheel.apps.cheng_cebon_2011.problem import DualProblem, parameter_unknowns, sensor_unknowns
from fifthwheel.apps.cheng_cebon_2011.stage import StageResult, has_changed, run_stage
from fifthwheel.estimate.identify.dataset import prepare_dataset
from fifthwheel.estimate.identify.unknowns import parameters
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import Vehicle

RATES = ("yaw_rate.tractor", "yaw_rate.semitrailer")
OFFSET = "steer.tractor.front.offset"


def test_has_changed() -> None:
    settings = TwoStage(tolerance=0.01)
    assert not has_changed(0.0009, 1.0, 0.0, settings)
    assert has_changed(0.0011, 1.0, 0.0, settings)
    assert not has_changed(0.0011, 1.0, 0.1, settings)


def test_shift_delays(truck: Vehicle) -> None:
    """The model has only the part of a delay that the rows do not have."""
    settings = TwoStage()
    unknowns = tuple(sensor_unknowns(truck, RATES, settings))
    problem = DualProblem(vehicle=truck, outputs=RATES, roll=False, unknowns=unknowns, settings=settings)
    names, scaling = problem.names, problem.scaling
    shifted = problem.shifted_scaling({"steer.tractor.front.delay": 0.02, OFFSET: 0.01})
    assert {n for n, a, b in zip(names, scaling.centre, shifted.centre, strict=True) if a != b} == {
        "steer.tractor.front.delay"
    }
    z = np.zeros(len(names))
    z[names.index("steer.tractor.front.delay")] = 0.4
    assert shifted.to_p(z)[names.index("steer.tractor.front.delay")] == pytest.approx(0.0, abs=1e-12)


def stage_1(truck: Vehicle, active: list[str] | None = None, **changes: object) -> tuple[StageResult, dict, tuple]:
    """Stage 1 on two logs with steering offsets of their own; its result, initial values and logs."""
    settings = TwoStage(**changes)
    records = []
    for seed, offset in ((1, 0.004), (2, -0.003)):
        record = simulate(truck, count=3, seed=seed, name=f"log {seed}", roll=False)
        records.append(record.with_signals({"steer.tractor.front": record.signals["steer.tractor.front"] + offset}))
    dataset = prepare_dataset(records, truck, settings)
    vehicle = dataset.vehicle
    unknowns = (
        *parameter_unknowns(vehicle, parameters.stage_1_names(vehicle), settings),
        *sensor_unknowns(vehicle, dataset.yaw, settings),
    )
    logs = tuple(log.with_noise(vehicle, dataset.yaw, settings.R) for log in dataset.logs)
    start = {u.name: u.centre for u in unknowns if not u.is_sensor_error}
    result = run_stage(
        DualProblem(vehicle=vehicle, outputs=dataset.yaw, roll=False, unknowns=unknowns, settings=settings),
        logs,
        active=[u.name for u in unknowns] if active is None else active,
        start=start,
        passes=settings.passes,
    )
    return result, start, logs


def test_estimates_sensor_errors_of_each_log_and_returns_new_logs(truck: Vehicle) -> None:
    result, start, logs = stage_1(truck)
    assert result.settled
    for name in parameters.stage_1_names(truck):
        assert result.values[name] == pytest.approx(truck.parameters()[name], rel=0.03)
    assert [log.errors[OFFSET] for log in result.logs] == pytest.approx([0.004, -0.003], abs=0.0008)
    for log in result.logs:
        assert log.effective_variance("yaw_rate.tractor") >= log.noise["yaw_rate.tractor"] > 0
    assert start == {name: truck.parameters()[name] for name in parameters.stage_1_names(truck)}
    assert all(not log.errors and not log.autocorrelation_factor for log in logs)
    again, *_ = stage_1(truck)
    assert again.values == result.values
    assert again.history.values.tobytes() == result.history.values.tobytes()


def test_inactive_unknowns_keep_their_values(truck: Vehicle) -> None:
    front, drive, *_ = parameters.stage_1_names(truck)
    result, start, logs = stage_1(truck, [front], passes=2)
    assert result.history.names == (front,)
    assert result.values[front] != start[front]
    assert result.values[drive] == start[drive]
    assert all(not log.errors for log in result.logs)
    assert [log.noise.keys() for log in result.logs] == [log.noise.keys() for log in logs]


def test_noise_stays_without_adaptation(truck: Vehicle) -> None:
    result, _, logs = stage_1(truck, adapt_noise=False, passes=2)
    assert [log.noise for log in result.logs] == [log.noise for log in logs]
