"""The filter of a learner: takes one sample, and updates states and estimates."""

import math
from collections.abc import Sequence

import numpy as np

from fifthwheel import dynamics
from fifthwheel.dynamics import steps
from fifthwheel.filters import Noise, joint, variances
from fifthwheel.filters.initial_state import TYPICAL_STEER_SIGMA
from fifthwheel.filters.relinearised import RelinearisedFilter
from fifthwheel.filters.step_rows import StepRows
from fifthwheel.identify.initial_state import initial_state_with_sensitivity
from fifthwheel.identify.online.excitation import Excitation
from fifthwheel.identify.online.inputs import HeldInputs
from fifthwheel.identify.online.problem import OnlineProblem
from fifthwheel.identify.online.settings import LearnerSettings
from fifthwheel.observe import Status
from fifthwheel.observe.observer_step import reported_signals

MIN_PROCESS_NOISE = 1e-9
"""Smallest factor of the process noise: a covariance that decays to zero would contain denormal numbers, which are
slow."""


class LiveFilter:
    """A joint filter of the yaw-roll model, the road's bank, the unknown parameters and the sensors' errors.

    The constructor compiles the filter's step for the model, or takes it from the cache.

    Args:
        problem: unknowns, signals and model.
        learner: when to learn, and how to treat faults of the signals.
    """

    def __init__(self, problem: OnlineProblem, learner: LearnerSettings) -> None:
        self.problem, self.learner = problem, learner
        self.filter = _relinearised_filter(problem, learner)
        self.view = StateView(problem, self.filter)
        self.learning = False
        """Whether it learned from the last sample."""
        self.innovation_ratio = [1.0] * len(problem.outputs)
        """Mean square of each channel's innovations while learning, relative to the predicted variance."""
        inputs = problem.model.inputs
        self._inputs = HeldInputs(len(inputs), learner, problem.settings.min_speed)
        self._excitation = Excitation(problem.vehicle, len(inputs) - 1, learner)
        self._step_limit = steps.StepLimit(problem.vehicle, roll=True)
        self._running = False  # whether there is a state
        self._time = -math.inf  # of the last sample, s
        self._start_time = -math.inf  # of the state, s
        self._accepted_time = -math.inf  # of the last accepted measurement, s
        self._last_inputs: Sequence[float] = ()  # of the last sample

    def push(self, time: float, inputs: Sequence[float | None], measured: Sequence[float | None]) -> Status:
        """Process a sample that is later than the last one.

        Args:
            time: s.
            inputs: of the model; None or NaN if missing.
            measured: the problem's outputs; None or NaN if missing.
        """
        learner = self.learner
        status, held = self._inputs.update(time, inputs)
        gap, previous, self._time = time - self._time, self._time, time
        if status != Status.OK:
            self._running = self.learning = False
            return status
        row, k, m = self.filter.row, len(inputs), len(measured)
        if not self._running or gap > learner.max_gap:
            gap = 0.0
            self._start(time, held)
        excited = self._excitation.update(gap, held) and time - self._start_time >= learner.settling_time
        self.learning = excited and self._inputs.has_settled(time)
        last, max_step = self._last_inputs, self._step_limit.safe_step_by_speed
        if gap > max_step[int(held[0])] or gap > max_step[int(last[0])]:
            self._divide_step(previous, time, held, excited)
        elif gap:
            row[0] = gap
            for i, value in enumerate(last, 1):
                row[2 * i] = value
        for i, value in enumerate(held, 1 + k):
            row[2 * i] = value
        self._last_inputs = held
        any_measured = False
        for i, reading in enumerate(measured, 1 + 2 * k):
            present = reading is not None and math.isfinite(reading)
            row[2 * i], row[2 * (i + m)] = (reading if present else 0.0), present
            any_measured |= present
        accepted, diverged = self.filter.advance(excited, self.learning)
        if self.learning:
            self._update_innovation_ratio(gap)
        if accepted:
            self._accepted_time = time
        coasting = time - self._accepted_time > learner.coast
        if diverged or (coasting and any_measured):
            self._start(time, held)
            self.filter.advance(False, False)
            return Status.OK
        return Status.COASTING if coasting else Status.OK

    def _update_innovation_ratio(self, gap: float) -> None:
        fraction = gap / (self.learner.innovation_window + gap)
        k, m = 1 + 2 * len(self.problem.model.inputs), len(self.problem.outputs)
        limit = self.problem.settings.gate**2
        for i in range(m):
            if self.filter.row[2 * (k + m + i)]:
                squared = min(self.filter.out[2 * (m + i)], limit)
                self.innovation_ratio[i] += fraction * (squared - self.innovation_ratio[i])

    def _start(self, time: float, inputs: Sequence[float]) -> None:
        """Start the state again at the steady state of these inputs; the estimates stay."""
        problem, empty = self.problem, np.zeros(0)
        rows = StepRows(
            rows=empty,
            time=empty,
            sample_indices=empty.astype(np.int64),
            first=dict(zip(problem.model.inputs, inputs, strict=True)),
            steer_sigma=TYPICAL_STEER_SIGMA,
        )
        self.filter.end_segment()
        z, _ = self.filter.estimate()
        x, P, V = initial_state_with_sensitivity(problem.vehicle, problem.names, problem.scaling, z, rows, roll=True)
        if problem.model.bank:
            x, P, V = np.append(x, 0.0), np.pad(P, (0, 1)), np.pad(V, ((0, 1), (0, 0)))
            P[-1, -1] = problem.settings.bank_prior**2
        self.filter.start(x, P, V, np.array([*inputs, *inputs]))
        self._excitation.restart()
        self._start_time = self._accepted_time = time
        self._last_inputs = inputs
        self._running, self.learning = True, False

    def _divide_step(self, previous: float, time: float, inputs: Sequence[float], excited: bool) -> None:
        """Advance by short steps without measurements; the last one remains in the filter's sample."""
        last = self._last_inputs
        limits = self._step_limit(np.array([last[0], inputs[0]]))
        times, columns, _ = steps.subdivide(np.array([previous, time]), np.array([last, inputs]), limits)
        dt, d = steps.step_inputs(times, columns)
        sample, k, m = self.filter.sample, len(inputs), len(self.problem.outputs)
        sample[1 + 2 * k : 1 + 2 * k + 2 * m, 0] = 0.0
        for i in range(1, len(times)):
            sample[0, 0], sample[1 : 1 + 2 * k, 0] = dt[i], d[i]
            if i < len(times) - 1:
                self.filter.advance(excited, False)


class StateView:
    """The reported states of a filter and their variances, which include the uncertainty of the unknowns.

    Args:
        problem: of the filter; of the unknowns the vehicle's and the steer sensors' have an effect on the states.
        joint_filter: its memory is read.
    """

    def __init__(self, problem: OnlineProblem, joint_filter: RelinearisedFilter) -> None:
        vehicle, scaling = problem.vehicle, problem.scaling
        signals = reported_signals(vehicle, roll=True, bank=problem.model.bank)
        self.names = [(name, f"{name}.sigma") for name in signals]
        """Names of each reported state and of its sigma."""
        effective = {*vehicle.parameters(), *dynamics.steer_parameters(vehicle)}
        places = tuple(i for i, name in enumerate(problem.names) if name in effective)
        free = [problem.names[i] for i in places]
        report = dynamics.model(vehicle, signals, roll=True, bank=problem.model.bank, free=free)
        self._step = joint.state_view(problem.model, report, scaling.logarithmic, places)
        c = report.known_values(dynamics.all_parameters(vehicle, signals))
        constant = np.concatenate([c, scaling.centre, scaling.scale])
        self._constant = np.repeat(constant[:, None], joint.LANES, axis=1)
        self._output = np.zeros((self._step.n_output, joint.LANES))
        self._first_lane = self._output[:, 0]
        self._inputs = joint_filter.sample[1:]
        arrays = (joint_filter.carry, self._inputs, self._constant, self._output)
        self._addresses = tuple(a.ctypes.data for a in arrays)

    def read(self) -> list[float]:
        """Values of the states, then their variances, SI."""
        self._step.vector(1, 1, *self._addresses)
        values: list[float] = self._first_lane.tolist()
        return values


def _relinearised_filter(problem: OnlineProblem, learner: LearnerSettings) -> RelinearisedFilter:
    settings, vehicle, model = problem.settings, problem.vehicle, problem.model
    table = variances.PROCESS_VARIANCE | {"bank": settings.bank_walk**2}
    noise = Noise(
        process=variances.process_covariance(model.states, table, max(settings.process_noise, MIN_PROCESS_NOISE)),
        measurement=np.array([variances.sensor_variance(vehicle, name, settings.noise) for name in problem.outputs]),
        gate=settings.gate,
    )
    return RelinearisedFilter(
        model,
        c=model.known_values(dynamics.all_parameters(vehicle, problem.outputs)),
        noise=noise,
        scaling=problem.scaling,
        free=np.array([float(not u.considered) for u in problem.unknowns]),
        settings=learner.relinearisation,
    )
