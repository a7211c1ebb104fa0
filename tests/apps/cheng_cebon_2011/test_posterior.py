"""The posterior of two stages against finite differences of the free-running model, and against estimates."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

from fifthwheel.apps.cheng_cebon_2011 import TwoStage
from fifthwheel.apps.cheng_cebon_2011.posterior import TwoStagePosterior, evaluate_posterior
from fifthwheel.apps.cheng_cebon_2011.problem import DualProblem, parameter_unknowns, sensor_unknowns
from fifthwheel.apps.cheng_cebon_2011.stage import run_stage
from fifthwheel.data.record import Record
from fifthwheel.estimate.filters.initial_state import steady_initial_state
from fifthwheel.estimate.filters.step_rows import corrected_inputs
from fifthwheel.estimate.identify.dataset import LogData, prepare_dataset
from fifthwheel.estimate.identify.unknowns import parameters
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics.simulation import free_response
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import Vehicle

YAW, TRAILER = "yaw_rate.tractor", "yaw_rate.semitrailer"
NOISE = {YAW: 3e-4, TRAILER: 2e-3}
SMOOTH = TwoStage(Q_x={"*": 0.0}, R=NOISE, adapt_noise=False)


class Stage1:
    """The yaw model with all unknowns of stage 1 at the values of the vehicle."""

    def __init__(self, records: list[Record], truck: Vehicle, settings: TwoStage) -> None:
        self.dataset, self.settings = prepare_dataset(records, truck, settings), settings
        self.vehicle, self.channels = self.dataset.vehicle, self.dataset.yaw
        self.names = parameters.stage_1_names(self.vehicle)
        self.unknowns = (
            *parameter_unknowns(self.vehicle, self.names, settings),
            *sensor_unknowns(self.vehicle, self.channels, settings),
        )
        self.problem = DualProblem(
            vehicle=self.vehicle, outputs=self.channels, roll=False, unknowns=self.unknowns, settings=settings
        )
        self.values = {name: self.vehicle.parameters()[name] for name in self.names}
        self.logs = [log.with_noise(self.vehicle, self.channels, settings.R) for log in self.dataset.logs]

    def scaled_logs(self, factor: float) -> list[LogData]:
        """The logs with the variance of the noise multiplied by a factor."""
        return [replace(log, noise={name: factor * v for name, v in log.noise.items()}) for log in self.logs]

    def posterior(self, *, gated: bool = True, factor: float = 1.0, **values: float) -> TwoStagePosterior:
        """With the variance of the noise multiplied by a factor."""
        return evaluate_posterior(self.problem, self.scaled_logs(factor), self.values | values, gated=gated)

    def response(self, segment: Record, values: dict[str, float]) -> np.ndarray:
        """The channels (N, m) of the free-running yaw model from the steady state of the first inputs."""
        model = dynamics.model(self.vehicle, self.channels, roll=False)
        errors = {u.name: u.centre for u in self.unknowns} | values
        first = {name: float(segment.input(name)[0]) for name in model.inputs}
        start, _ = steady_initial_state(self.vehicle, first, errors, roll=False)
        known = dynamics.all_parameters(self.vehicle, self.channels) | errors
        known |= {name: 0.0 for name in known if name.endswith(".delay")}
        return free_response(model, known, segment.time, corrected_inputs(segment, model.inputs, errors), start)[1]

    def information(self, segment: Record, **values: float) -> tuple[np.ndarray, np.ndarray]:
        """Sums of J' J / R (n, n) and J' e / R (n,) over samples that are measured, with the errors e of the model.

        J is by central differences with respect to z.
        """
        columns, values = [], self.values | values
        for u in self.unknowns:
            at = values.get(u.name, u.centre)
            step = 1e-4 * u.slope(at)
            higher, lower = (self.response(segment, {**values, u.name: at + s}) for s in (step, -step))
            columns.append((higher - lower) / 2e-4)
        deviation = np.sqrt([NOISE[name] for name in self.channels])
        measured = np.column_stack([segment.signals[name] for name in self.channels])
        error, present = (measured - self.response(segment, values)) / deviation, np.isfinite(measured)
        jacobian = (np.stack(columns, axis=-1) / deviation[:, None])[present]
        return jacobian.T @ jacobian, jacobian.T @ error[present]


def damaged(record: Record) -> Record:
    """Without the first 2 s of one gyro."""
    return record.with_signals({TRAILER: np.where(record.time < 2, np.nan, record.signals[TRAILER])})


@pytest.fixture(scope="module")
def noisy(truck: Vehicle) -> Stage1:
    """One lane change and a damaged one, with so much noise that the filter follows the model."""
    records = [simulate(truck, count=1, seed=seed, roll=False, name=str(seed)) for seed in (1, 2)]
    rng = np.random.default_rng(5)
    records = [
        r.with_signals({n: r.signals[n] + np.sqrt(v) * rng.normal(size=len(r)) for n, v in NOISE.items()})
        for r in (records[0], damaged(records[1]))
    ]
    return Stage1([replace(r, signals={n: r.signals[n] for n in ("speed", "steer.tractor.front", *NOISE)})
                   for r in records], truck, SMOOTH)  # fmt: skip


def test_information_is_that_of_the_free_running_model(noisy: Stage1) -> None:
    """Summed over the logs; each has steering and gyro offsets of its own. A delay of the steering shifts it. So are
    the Hessian, and the gradient, which contains the prior.

    The noise is so large that neither the filter nor its initial covariance has an effect.
    """
    factor, delay = 1e4, 0.05
    values = {"steer.tractor.front.delay": delay}
    posterior = noisy.posterior(gated=False, factor=factor, **values)
    offsets = [u.name for u in noisy.unknowns if u.per_log]
    shared = [u.name for u in noisy.unknowns if not u.per_log]
    assert posterior.names == (*shared, *[f"{name}@{i}" for i in range(2) for name in offsets])
    expected, gradient = np.zeros((len(posterior.names), len(posterior.names))), np.zeros(len(posterior.names))
    for i, log in enumerate(noisy.logs):
        (segment,) = log.segments
        rows = [posterior.names.index(f"{u.name}@{i}" if u.per_log else u.name) for u in noisy.unknowns]
        information, scores = noisy.information(segment, **values)
        expected[np.ix_(rows, rows)] += information / factor
        gradient[rows] += scores / factor
    root, own = np.sqrt(np.diag(expected)), np.eye(len(expected))
    for actual in (np.linalg.inv(posterior.covariance) - own, posterior.hessian - own):
        np.testing.assert_allclose(actual / np.outer(root, root), expected / np.outer(root, root), atol=2e-3)
    (prior,) = [u.scale for u in noisy.unknowns if u.name == "steer.tractor.front.delay"]
    gradient[posterior.names.index("steer.tractor.front.delay")] -= delay / prior
    np.testing.assert_allclose(posterior.gradient / root, gradient / root, atol=2e-3)


def test_the_estimate_of_several_passes_is_the_most_probable_one(noisy: Stage1) -> None:
    """Against a least-squares fit of the free-running model with the prior, from whose mean every unknown is one sigma
    away.

    Each log has steering and gyro offsets of its own. Neither a sample nor the prior counts twice.
    """
    shared, own = ([i for i, u in enumerate(noisy.unknowns) if u.per_log == per_log] for per_log in (False, True))

    def of_logs(z: np.ndarray) -> list[dict[str, float]]:
        """Values of the unknowns in each log."""
        rows = np.zeros((2, len(noisy.unknowns)))
        rows[:, shared], rows[:, own] = z[: len(shared)], z[len(shared) :].reshape(2, -1)
        p = noisy.problem.scaling.to_p(rows)
        return [dict(zip([u.name for u in noisy.unknowns], row.tolist(), strict=True)) for row in p]

    factor, rng = 1e3, np.random.default_rng(7)
    sigma = np.sqrt([factor * NOISE[name] for name in noisy.channels])
    logs = []
    for log, values in zip(noisy.scaled_logs(factor), of_logs((-1.0) ** np.arange(12)), strict=True):
        (segment,) = log.segments
        y = noisy.response(segment, values) + sigma / 3 * rng.normal(size=(len(segment), 2))
        logs.append(replace(log, segments=[segment.with_signals(dict(zip(noisy.channels, y.T, strict=True)))]))

    def residuals(z: np.ndarray) -> np.ndarray:
        parts = [z]
        for log, values in zip(logs, of_logs(z), strict=True):
            (segment,) = log.segments
            measured = np.column_stack([segment.signals[name] for name in noisy.channels])
            parts.append(((measured - noisy.response(segment, values)) / sigma).ravel())
        return np.concatenate(parts)

    fit = least_squares(residuals, np.zeros(12))
    result = run_stage(
        replace(noisy.problem, settings=replace(SMOOTH, tolerance=1e-6)),
        logs,
        active=noisy.problem.names,
        start=noisy.values,
        passes=30,
    )
    assert result.settled
    values = [{**result.values, **log.errors} for log in result.logs]
    z = noisy.problem.scaling.to_z(np.array([[v[u.name] for u in noisy.unknowns] for v in values]))
    np.testing.assert_allclose(z[:, shared], [fit.x[: len(shared)]] * 2, atol=0.05)
    np.testing.assert_allclose(z[:, own], fit.x[len(shared) :].reshape(2, -1), atol=0.08)


def test_the_bias_is_the_error_of_the_yaw_model(truck: Vehicle) -> None:
    """Against estimates from a log without noise of the truck that rolls."""
    quiet = TwoStage(adapt_noise=False, given={"sensors": "exact"})
    record = simulate(truck, count=1, seed=1, sensors=dict.fromkeys((YAW, TRAILER), 0.0))
    signals = {name: record.signals[name] for name in ("speed", "steer.tractor.front", YAW, TRAILER)}
    stage = Stage1([replace(record, signals=signals)], truck, quiet)
    bias = stage.posterior().bias
    result = run_stage(stage.problem, stage.logs, active=stage.names, start=stage.values, passes=20)
    errors = [np.log(result.values[u.name] / u.centre) / u.scale for u in stage.unknowns]
    assert max(np.abs(errors)) > 0.02
    np.testing.assert_allclose(bias, errors, atol=0.15 * max(np.abs(errors)))


def test_sigma_and_excitation() -> None:
    """The larger of both covariances and the bias; below the limit an unknown is excited. The next step keeps what is
    fixed."""
    posterior = TwoStagePosterior(
        names=("a", "b"),
        covariance=np.diag([0.09, 0.04]),
        sandwich=np.diag([0.04, 0.16]),
        bias=np.array([0.4, -0.3]),
        gradient=np.array([2.0, 6.0]),
        hessian=np.array([[4.0, 1.0], [1.0, 3.0]]),
        unstable=False,
    )
    np.testing.assert_allclose(posterior.next_step(()), [0.0, 2.0], atol=1e-15)
    assert posterior.next_step({"b"}).tolist() == [0.5, 0.0]
    np.testing.assert_allclose(posterior.sigma, [0.5, 0.5])
    assert posterior.excited("a", 0.3 * (1 + 1e-9))
    assert not posterior.excited("a", 0.3 * (1 - 1e-9))
    assert posterior.excited("c", 0.0)
    assert replace(posterior, unstable=True).excited("a", 0.0)
