"""The filter of a learner: takes one sample, and updates states and estimates."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fifthwheel import dynamics
from fifthwheel._types import Array
from fifthwheel.channels import SignalName
from fifthwheel.dynamics import steps
from fifthwheel.dynamics.chain import BANK
from fifthwheel.filters import Noise, joint, variances
from fifthwheel.filters.initial_state import TYPICAL_STEER_SIGMA, equilibrium, initial_state, steady_initial_state
from fifthwheel.filters.relinearised import Estimate, RelinearisedFilter
from fifthwheel.identify.online.excitation import Excitation
from fifthwheel.identify.online.innovations import InnovationStatistics
from fifthwheel.identify.online.inputs import HeldInputs
from fifthwheel.identify.online.problem import OnlineProblem, model_of
from fifthwheel.identify.online.settings import LearnerSettings
from fifthwheel.identify.online.start import steady_slopes
from fifthwheel.identify.online.steering import Steering
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
        self.innovations = InnovationStatistics(problem.outputs, learner.innovation_window, problem.settings.gate)
        """Of the samples from which it learned."""
        inputs = problem.inputs
        self._inputs = HeldInputs(len(inputs), learner, problem.settings.min_speed)
        self._steering = Steering(len(inputs) - 1)
        estimated = [u.name for u in problem.estimated]
        self._plays = [estimated.index(name) for n in inputs[1:] if (name := f"{n}.play") in estimated]
        self._excitation = Excitation(problem.vehicle, len(inputs) - 1, learner, tyres=problem.settings.tyre_law)
        self._step_limit = steps.StepLimit(problem.vehicle, roll=True)
        self._running = False  # whether there is a state
        self._time = -math.inf  # of the last sample, s
        self._start_time = -math.inf  # of the state, s
        self._accepted_time = -math.inf  # of the last accepted measurement, s
        self._last_inputs: Sequence[float] = ()  # of the last sample

    def __reduce__(self) -> tuple[Any, ...]:
        """Compiled code is not copied: filters of one structure share it."""
        state = {name: value for name, value in vars(self).items() if name not in ("filter", "view")}
        return LiveFilter, (self.problem, self.learner), (state, self.filter.memory())

    def __setstate__(self, state: tuple[dict[str, Any], dict[str, Any]]) -> None:
        attributes, memory = state
        vars(self).update(attributes)
        self.filter.restore(memory)

    def estimate(self) -> Estimate:
        """The estimate after all samples, with the information that autocorrelated innovations contain."""
        return self.filter.estimate().with_variance_inflation(max(1.0, *self.innovations.autocorrelation))

    def discrepancy_variances(self) -> Array:
        """Of each discrepancy among the states, SI squared."""
        return _discrepancy_variances(self.problem, self.learner)

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
        if not self._running or gap > learner.max_gap:
            gap = 0.0
            self._start(time, held)
        was_excited = self._excitation.on
        excited = self._excitation.update(gap, held) and time - self._start_time >= learner.settling_time
        if was_excited and not self._excitation.on and self._is_worse_than_a_start():
            gap = 0.0
            self._start(time, held)
        self.learning = excited and self._inputs.has_settled(time)
        last, max_step = self._last_inputs, self._step_limit.safe_step_by_speed
        before, after = self._steering.update(gap, last, held, self._play())
        if gap > max_step[int(held[0])] or gap > max_step[int(last[0])]:
            before = self._divide_step(previous, time, before, after, excited)
        elif gap:
            self.filter.row[0] = gap
        row, k, m = self.filter.row, 2 * len(after), len(measured)
        for i, value in enumerate((*before, *after), 1):
            row[2 * i] = value
        self._last_inputs = held
        any_measured = False
        for i, reading in enumerate(measured, 1 + k):
            present = reading is not None and math.isfinite(reading)
            row[2 * i], row[2 * (i + m)] = (reading if present else 0.0), present
            any_measured |= present
        accepted, diverged = self.filter.advance(excited, self.learning)
        if self.learning:
            first = 2 * (1 + k + m)  # of the weights
            self.innovations.update(gap, self.filter.out[2 * m : 4 * m : 2], row[first : first + 2 * m : 2])
        if accepted:
            self._accepted_time = time
        coasting = time - self._accepted_time > learner.coast
        if diverged or (coasting and any_measured):
            self._start(time, held)
            self.filter.advance(False, False)
            return Status.OK
        return Status.COASTING if coasting else Status.OK

    def _is_worse_than_a_start(self) -> bool:
        """Whether the bank of the road is less certain than at a start.

        A lane change hardly separates the bank from the offset of the steering, and the gains do not allow for
        considered parameters: without a new start, the errors of both would grow from one lane change to the next.
        """
        return self.view.bank_variance() > self.problem.settings.bank_prior**2

    def _start(self, time: float, inputs: Sequence[float]) -> None:
        """Start the state again at the steady state of these inputs; the estimates stay."""
        self.filter.end_segment()
        estimate = self.filter.estimate()
        first = dict(zip(self.problem.inputs, inputs, strict=True))
        x, P, V = start_state(self.problem, self.learner, estimate.z, first)
        before, after = self._steering.update(0.0, inputs, inputs, self._play())
        self.filter.start(x, P, V, np.array([*before, *after]))
        self._excitation.restart()
        self._start_time = self._accepted_time = time
        self._last_inputs = inputs
        self._running, self.learning = True, False

    def _play(self) -> list[float]:
        """Estimates of the plays of the steerings, rad."""
        scaling, row = self.problem.scaling, self.filter.carry
        first = self.filter.layout.z.start
        return [scaling.scale[i] * row[first + i, 0] for i in self._plays]

    def _divide_step(
        self, previous: float, time: float, before: Sequence[float], after: Sequence[float], excited: bool
    ) -> list[float]:
        """Advance by short steps without measurements; the last one remains for the sample, with these first inputs."""
        limits = self._step_limit(np.array([before[0], after[0]]))
        times, columns, _ = steps.subdivide(np.array([previous, time]), np.array([before, after]), limits)
        dt, d = steps.step_inputs(times, columns)
        sample, k, m = self.filter.sample, 2 * len(after), len(self.problem.outputs)
        sample[1 + k : 1 + k + 2 * m, 0] = 0.0
        for i in range(1, len(times)):
            sample[0, 0], sample[1 : 1 + k, 0] = dt[i], d[i]
            if i < len(times) - 1:
                self.filter.advance(excited, False)
        first: list[float] = d[-1][: len(after)].tolist()
        return first


class StateView:
    """The reported states of a filter and their variances, which include the uncertainty of the unknowns.

    Args:
        problem: of the filter; of the unknowns the vehicle's and the steer sensors' have an effect on the states.
        joint_filter: its memory is read.
    """

    def __init__(self, problem: OnlineProblem, joint_filter: RelinearisedFilter) -> None:
        vehicle, scaling = problem.vehicle, problem.scaling
        bank = problem.model.chain.bank
        signals = reported_signals(vehicle, roll=True, bank=bank)
        self.names = [(name, f"{name}.sigma") for name in signals]
        """Names of each reported state and of its sigma."""
        self.bank = signals.index(BANK) if bank else None
        """Place of the bank of the road among them; None if it is no state."""
        self.report = model_of(
            vehicle, signals, problem.unknowns, bank=bank, discrepancies=False, tyres=problem.settings.tyre_law
        )
        self._step = joint.state_view(problem.model, self.report, scaling.logarithmic, len(problem.estimated))
        values = problem.given(signals)
        self.c = self.report.constant(values, problem.unknowns, math.inf)
        constant = np.concatenate([self.c, scaling.centre, scaling.scale])
        self._constant = np.repeat(constant[:, None], joint.LANES, axis=1)
        self._output = np.zeros((self._step.n_output, joint.LANES))
        self._first_lane = self._output[:, 0]
        self._inputs = joint_filter.sample[1:]
        arrays = (joint_filter.carry, self._inputs, self._constant, self._output)
        self._addresses = tuple(a.ctypes.data for a in arrays)

    def bank_variance(self) -> float:
        """Variance of the bank of the road, rad^2; 0 if it is no state."""
        return 0.0 if self.bank is None else self.read()[len(self.names) + self.bank]

    def read(self) -> list[float]:
        """Values of the states, then their variances, SI."""
        self._step.vector(1, 1, *self._addresses)
        values: list[float] = self._first_lane.tolist()
        return values


def _relinearised_filter(problem: OnlineProblem, learner: LearnerSettings) -> RelinearisedFilter:
    settings, vehicle, model = problem.settings, problem.vehicle, problem.model
    table = variances.PROCESS_VARIANCE | {"bank": settings.bank_walk**2}
    factor = max(settings.process_noise, MIN_PROCESS_NOISE)
    discrepancies = _discrepancy_variances(problem, learner)
    of_states = variances.process_covariance(model.chain.states, table, factor)
    process = _block_diagonal(of_states, np.diag(2 / learner.discrepancy_time * discrepancies))
    noise = Noise(
        process=process,
        measurement=np.array([variances.sensor_variance(vehicle, name, settings.noise) for name in problem.outputs]),
        gate=settings.gate,
    )
    values = problem.given(problem.outputs)
    return RelinearisedFilter(
        model,
        c=model.constant(values, problem.unknowns, learner.discrepancy_time),
        noise=noise,
        scaling=problem.scaling,
        walk=np.array([2 / (learner.offset_time if u.per_log else learner.parameter_time) for u in problem.estimated]),
        settings=learner.relinearisation,
    )


def _discrepancy_variances(problem: OnlineProblem, learner: LearnerSettings) -> Array:
    """Of each discrepancy among the states, SI squared."""
    names = problem.outputs if problem.model.discrepancies else ()
    return np.array([learner.discrepancy.get(SignalName.of(name).quantity, 0.0) ** 2 for name in names])


def start_state(
    problem: OnlineProblem, learner: LearnerSettings, z: Array, first: Mapping[str, float]
) -> tuple[Array, Array, Array]:
    """Steady state (n_x,) of the first inputs, its covariance (n_x, n_x) and derivative dx/dz (n_x, n_p)."""
    vehicle, chain, unknowns = problem.vehicle, problem.model.chain, problem.unknowns
    p = problem.scaling.to_p(np.append(z, np.zeros(len(unknowns) - len(z))))
    values = problem.given(problem.outputs)
    values |= {u.name: float(value) for u, value in zip(unknowns, p, strict=True) if not u.moves}
    bank = problem.settings.bank_prior if chain.bank else None
    x, P = initial_state(vehicle, first, values, roll=True, steer_sigma=TYPICAL_STEER_SIGMA, bank=bank)
    _, m = steady_initial_state(vehicle, first, values, roll=True)
    c = problem.model.constant(values, unknowns, learner.discrepancy_time)
    slopes = _steady_slopes(problem, m, np.array([first[name] for name in problem.inputs]), x, np.append(p, c))
    V = np.zeros((len(x) + problem.model.discrepancies, len(p)))
    V[: len(slopes)] = slopes * problem.scaling.slope(p)
    discrepancies = _discrepancy_variances(problem, learner)
    return np.pad(x, (0, len(discrepancies))), _block_diagonal(P, np.diag(discrepancies)), V


def _steady_slopes(problem: OnlineProblem, m: dynamics.Matrices, inputs: Array, x: Array, constant: Array) -> Array:
    """Derivative (n, n_p) of the steady state with respect to the values of all unknowns.

    Args:
        problem: of the learner.
        m: at the speed and the values.
        inputs: speed and steer angles (k,).
        x: steady state, then other states.
        constant: [p, c] of the model.
    """
    n = len(m.A) - 1
    _, output = steady_slopes(problem.model)(np.zeros(0), np.append(inputs, x[:n])[None], constant)
    return equilibrium(m, np.linalg.solve(m.E[:n, :n], output[0].reshape(n, -1, order="F")))


def _block_diagonal(first: Array, second: Array) -> Array:
    n, m = len(first), len(second)
    return np.block([[first, np.zeros((n, m))], [np.zeros((m, n)), second]])
