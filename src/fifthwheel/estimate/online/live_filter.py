"""The filter of a learner: takes one sample, and updates states and estimates."""

import math
import sys
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fifthwheel.base.types import Array
from fifthwheel.data.channels import WHEEL_SPEED_DIFFERENCE, names_of
from fifthwheel.estimate.filters import Noise, joint, variances
from fifthwheel.estimate.filters.model import block_diagonal
from fifthwheel.estimate.filters.relinearised import JointEstimate, RelinearisedFilter
from fifthwheel.estimate.filters.scaling import Scaling
from fifthwheel.estimate.identify.setup import Setup
from fifthwheel.estimate.observe.monitor import Monitor
from fifthwheel.estimate.observe.observer_step import reported_signals
from fifthwheel.estimate.observe.settings import ObserverSettings
from fifthwheel.estimate.online.online_model import Excitation, OnlineModel, PlayContacts, model_of
from fifthwheel.estimate.online.settings import LearnerSettings
from fifthwheel.estimate.online.start import Considered, discrepancy_variances, start_state
from fifthwheel.estimate.stream import VALID, InputRule, Status, Stream, StreamSettings, magnitude
from fifthwheel.model.dynamics.simulation import StepLimit
from fifthwheel.model.dynamics.unit_equations import BANK

MIN_PROCESS_NOISE = 1e-9
"""Smallest factor of the process noise: a covariance that decays to zero would contain denormal numbers, which are
slow."""
AVERAGING_TIME = 1.0
"""Time constant of the average whose variance shows an autocorrelation of the innovations, s."""
WINDOWS = 10.0
"""Innovation windows over which that variance is averaged: it has fewer independent values than the mean square."""


class LiveFilter:
    """A joint filter of the yaw-roll model, the road's bank, the unknown parameters and the sensors' errors.

    The constructor compiles the filter's step for the model, or takes it from the cache. It begins with the estimates z
    (n_p,) and their covariance (n_p, n_p), in units of the priors; the mean and covariance of the considered unknowns
    stay.
    """

    def __init__(self, setup: Setup, learner: LearnerSettings, z: Array, covariance: Array) -> None:
        n = len(setup.estimated_unknowns)
        self.setup, self.learner = setup, learner
        self.considered = Considered.of(z[n:], covariance[n:, n:])
        """What is known of the considered unknowns."""
        self._scaling = self.considered.scaling(setup)
        self.model = model_of(setup, setup.outputs, discrepancies=setup.has_discrepancies)
        self.filter = _relinearised_filter(setup, self.model, learner, self._scaling, self.considered)
        self.filter.set_estimate(self.joint_estimate(z, covariance))
        self.began = self.filter.estimate()
        """The estimates before the first sample."""
        view = StateView(setup, self.model, self.filter, self._scaling, self.considered)
        self.view, self.row = view, self.filter.row
        self.learning = False
        """Whether it learned from the last sample."""
        self.innovations = InnovationStatistics(setup.outputs, learner.innovation_window, setup.settings.gate)
        """Of the samples from which it learned."""
        self.inputs, self.outputs = inputs, outputs = setup.inputs, setup.outputs
        """Names of the signals of a sample; what follows from the vehicle is slow."""
        self.differences = names_of(WHEEL_SPEED_DIFFERENCE, outputs)
        """Those of them that follow from the wheel speeds."""
        self.stream = Stream(stream_settings(setup, learner), StepLimit(setup.vehicle, roll=True))
        self.monitor = Monitor(inputs, len(outputs), setup.settings.gate, ObserverSettings())
        self._steering = PlayContacts(len(inputs) - 1)
        estimated = [u.name for u in setup.estimated_unknowns]
        plays = [estimated.index(name) for n in inputs[1:] if (name := f"{n}.play") in estimated]
        self._plays = [(i, float(setup.scaling.scale[i])) for i in plays]
        self._excitation = Excitation(setup.vehicle, len(inputs) - 1, learner, tyres=setup.settings.tyre_law)
        self._in_segment = False  # whether the last sample belongs to a segment with excitation
        self._start_time = -math.inf  # of the state, s
        self._dropout_time = -math.inf  # of the last long dropout of a steer angle, s

    def __reduce__(self) -> tuple[Any, ...]:
        """Compiled code is not copied: filters of one structure share it."""
        built = ("model", "filter", "view", "row", "monitor")
        state = {name: value for name, value in vars(self).items() if name not in built}
        return LiveFilter, (self.setup, self.learner, *self.joint()), (state, self.filter.memory(), self.monitor.save())

    def __setstate__(self, state: tuple[dict[str, Any], dict[str, Any], Array]) -> None:
        attributes, memory, monitored = state
        vars(self).update(attributes)
        self.filter.restore(memory)
        self.monitor.resume(monitored)

    def estimate(self, *, finished: bool = True) -> JointEstimate:
        """The estimate after all samples, with the information that autocorrelated innovations contain; see
        `RelinearisedFilter.estimate`."""
        estimate = self.filter.estimate(finished=finished)
        return estimate.with_variance_inflation(max(1.0, *self.innovations.autocorrelation))

    def joint(self, estimate: JointEstimate | None = None) -> tuple[Array, Array]:
        """All unknowns after all samples: z (n_p,) and its covariance (n_p, n_p), in units of their priors; or those of
        another estimate of this filter."""
        estimate, known = estimate or self.filter.estimate(), self.considered
        unit = np.append(np.ones(len(estimate.z)), known.sigma)
        return np.append(estimate.z, known.mean), estimate.covariance() * np.outer(unit, unit)

    def joint_estimate(
        self, z: Array, covariance: Array, gradient: Array | None = None, information: Array | None = None
    ) -> JointEstimate:
        """The estimate of this filter with what `joint` gave, and with score tests, which start again if None."""
        n, known = len(self.setup.estimated_unknowns), self.considered
        cross = covariance[:n, n:] / known.sigma
        B = np.asarray(np.linalg.solve(known.correlation, cross.T).T if known.is_correlated else cross)
        gains, none = B @ np.linalg.cholesky(known.correlation), np.zeros(len(known.mean))
        return JointEstimate(
            z=z[:n],
            Pz=covariance[:n, :n] - gains @ gains.T,
            B=B,
            gradient=none if gradient is None else gradient,
            information=none if information is None else information,
            correlation=known.correlation,
        )

    def push(self, time: float | None, inputs: Sequence[float | None], measured: Sequence[float | None]) -> Status:
        """Process a sample of the problem's inputs and outputs, SI; None or NaN if missing."""
        self.learning = False
        status = self.stream.process_sample(self, time, inputs, measured)
        return self.monitor.status(status) if status in VALID else status

    def start(self, stream: Stream) -> None:
        """Start the state at the steady state of the inputs; the estimates stay."""
        self.filter.end_segment()
        first = dict(zip(self.setup.inputs, stream.inputs, strict=False))  # without the derivative of the speed
        x, P, V = start_state(self.setup, self.model, self.learner, self._scaling, self.filter.estimate().z, first)
        before, after = self._steering.update(0.0, stream.inputs, stream.inputs, self._play())
        self.filter.start(x, P, V, np.array([*before, *after]))
        self._excitation.restart()
        self.monitor.start()
        self._start_time, self._dropout_time = stream.time, min(self._dropout_time, stream.time)  # of one clock
        self.learning = False

    def ends(self, stream: Stream) -> tuple[list[float], list[float]]:
        """The held inputs, with contacts and rates of the steer angles."""
        was_excited = self._excitation.on
        excited = self._excitation.update(stream.gap, stream.inputs)
        if was_excited and not excited and self._is_worse_than_a_start():
            stream.start(self)
        self._in_segment = excited and stream.time - self._start_time >= self.learner.settling_time
        self.learning = self._has_settled() and self._in_segment
        return self._steering.update(stream.gap, stream.last, stream.inputs, self._play())

    @property
    def is_beyond_model(self) -> bool:
        """Whether the driver steers more than the model describes, so that nothing is learned."""
        return self._excitation.is_beyond_limit

    def step(self) -> None:
        """Process a row between two samples."""
        self.filter.advance(self._in_segment, False)

    def update(self, stream: Stream) -> bool:
        """Process the row of a sample; start again if it has diverged, or coasts although there are measurements."""
        accepted, diverged = self.filter.advance(self._in_segment, self.learning)
        if self.learning:
            self.innovations.update(stream.gap, self.filter.innovations, self.filter.weights)
        restart = diverged or self._monitor(stream) or (not accepted and stream.coasts and any(self.filter.weights))
        if restart:
            nis = self.monitor.nis
            stream.start(self)
            self.monitor.start(nis)
            self.filter.advance(False, False)
            self._monitor(stream)
        return restart or accepted

    def _monitor(self, stream: Stream) -> bool:
        """Judge the innovations of a sample; whether the state must start again."""
        joint_filter = self.filter
        return self.monitor.update(
            stream.gap,
            stream.last[: len(self.inputs)],
            stream.inputs[: len(self.inputs)],
            joint_filter.innovations,
            joint_filter.weights,
        )

    def _has_settled(self) -> bool:
        """Whether every steer angle is measured now, and the last long dropout is `settling_time` ago."""
        stream, learner = self.stream, self.learner
        age = stream.time - min(stream.times[1:])
        if age > learner.max_steer_dropout:
            self._dropout_time = stream.time
        return not age and stream.time - self._dropout_time >= learner.settling_time

    def _is_worse_than_a_start(self) -> bool:
        """Whether the bank of the road is less certain than at a start: lane changes hardly separate it from the offset
        of the steering, so that without new starts the errors of both grow from one to the next."""
        return self.view.bank_sigma() > self.setup.bank_sigma

    def _play(self) -> list[float]:
        """Estimates of the plays of the steerings, rad."""
        z = self.filter.z
        return [scale * z[i] for i, scale in self._plays]


class InnovationStatistics:
    """Recursive statistics of normalised innovations, which are white with variance 1 if the model is correct.

    The window is the time constant of the mean square, s of learning; innovations above the limit count as the limit.
    """

    def __init__(self, channels: Sequence[str], window: float, limit: float) -> None:
        count, self.channels = len(channels), tuple(channels)
        self.window, self.limit = window, limit
        self.mean_square = [1.0] * count
        """Of each channel; 1 is expected."""
        self.autocorrelation = [1.0] * count
        """Variance inflation factor of each channel: the variance of an average over that of white innovations."""
        self._average = [0.0] * count

    def update(self, dt: float, innovations: Sequence[float], present: Sequence[float]) -> None:
        """Take up the normalised innovations of a sample, dt seconds after the last one; 0 in `present` if missing."""
        if dt <= 0:
            return
        limit, fraction, slow = self.limit, dt / (self.window + dt), dt / (WINDOWS * self.window + dt)
        weight = dt / (AVERAGING_TIME + dt)
        expected = weight / (2 - weight)  # variance of the average of white innovations
        for i, innovation in enumerate(innovations):
            if present[i]:
                innovation = min(max(innovation, -limit), limit)
                self.mean_square[i] += fraction * (innovation * innovation - self.mean_square[i])
                self._average[i] = average = self._average[i] + weight * (innovation - self._average[i])
                self.autocorrelation[i] += slow * (average * average / expected - self.autocorrelation[i])

    @property
    def measured(self) -> tuple[str, ...]:
        """The channels that had a sample while learning."""
        pairs = zip(self.channels, self.mean_square, strict=True)
        return tuple(name for name, mean_square in pairs if mean_square != 1.0)  # the first sample changes it

    def as_dict(self) -> dict[str, dict[str, float]]:
        """Both statistics by channel."""
        return {
            "mean_square": dict(zip(self.channels, self.mean_square, strict=True)),
            "autocorrelation": dict(zip(self.channels, self.autocorrelation, strict=True)),
        }

    def restore(self, mean_square: Mapping[str, float], autocorrelation: Mapping[str, float]) -> None:
        """Continue from those of `as_dict`; a channel that is not among them starts."""
        self.mean_square[:] = [mean_square.get(name, 1.0) for name in self.channels]
        self.autocorrelation[:] = [autocorrelation.get(name, 1.0) for name in self.channels]


class StateView:
    """The reported states of a filter, whose memory it reads, and their sigmas with those of the unknowns."""

    def __init__(
        self,
        setup: Setup,
        model: OnlineModel,
        joint_filter: RelinearisedFilter,
        scaling: Scaling,
        considered: Considered,
    ) -> None:
        vehicle, n_z, correlated = setup.vehicle, len(setup.estimated_unknowns), considered.is_correlated
        bank = model.chain.bank
        signals = reported_signals(vehicle, roll=True, bank=bank)
        self.names = tuple(signals)
        """Names of the reported states."""
        self.keys = tuple(key for name in signals for key in (name, f"{name}.sigma"))
        """Names of each state and of its sigma."""
        self.bank = signals.index(BANK) if bank else None
        """Place of the bank of the road among them; None if it is no state."""
        self.report = model_of(setup, signals, discrepancies=False)
        self._step = joint.state_view(model, self.report, scaling.logarithmic, n_z, *((True,) if correlated else ()))
        self.c = self.report.constant(setup.given_to_model(signals), setup.unknowns, math.inf)
        L = np.linalg.cholesky(considered.correlation)
        factor = [L[k:, k] for k in range(len(L))] if correlated else []
        constant = np.concatenate([self.c, scaling.centre, scaling.scale, *factor, [1.0]])
        self._excess: Any = constant[-1:].data
        output = np.zeros(self._step.n_output)
        self._output: Any = output.data
        arrays = (joint_filter.carry, joint_filter.sample[0, 1:], constant, output)
        self._addresses = tuple(a.ctypes.data for a in arrays)
        self._run = self._step.single

    def bank_sigma(self) -> float:
        """Sigma of the bank of the road, rad; 0 if it is no state."""
        return 0.0 if self.bank is None else self.read()[2 * self.bank + 1]

    def read(self, excess: float = 1.0) -> list[float]:
        """Each state and its sigma, SI; `excess` is a factor of the variances."""
        self._excess[0] = excess
        self._run(1, 1, *self._addresses)
        values: list[float] = self._output.tolist()
        return values


def stream_settings(setup: Setup, learner: LearnerSettings) -> StreamSettings:
    """How a learner treats faults of its signals. A spike of an input moves the state and its sensitivities alike, so
    that the filter would learn from it."""
    steer, rate = min(learner.max_steer, sys.float_info.max), learner.max_steer_rate
    speed = InputRule(name="speed", largest=magnitude("speed"), jump=learner.max_speed_change, rate=0.0)
    steers = (InputRule(name=name, largest=steer, jump=0.0, rate=rate) for name in setup.inputs[1:])
    return StreamSettings(
        inputs=(speed, *steers),
        measured=dict.fromkeys(setup.outputs, sys.float_info.max),
        min_speed=setup.settings.min_speed,
        hold=learner.hold,
        max_gap=learner.max_gap,
        coast=learner.coast,
    )


def _relinearised_filter(
    setup: Setup, model: OnlineModel, learner: LearnerSettings, scaling: Scaling, considered: Considered
) -> RelinearisedFilter:
    settings, vehicle = setup.settings, setup.vehicle
    factor = max(settings.process_noise, MIN_PROCESS_NOISE)
    discrepancies = discrepancy_variances(setup, learner)
    of_states = variances.process_covariance(model.chain.states, variances.PROCESS_VARIANCE, factor)
    process = block_diagonal(of_states, np.diag(2 / learner.discrepancy_time * discrepancies))
    noise = Noise(
        process=process,
        measurement=np.array([variances.sensor_variance(vehicle, name, settings.noise) for name in setup.outputs]),
        gate=settings.gate,
    )
    return RelinearisedFilter(
        model,
        c=model.constant(setup.given_to_model(setup.outputs), setup.unknowns, learner.discrepancy_time),
        noise=noise,
        scaling=scaling,
        correlation=considered.correlation,
        walk=np.array(
            [2 / (learner.offset_time if u.per_log else learner.parameter_time) for u in setup.estimated_unknowns]
        ),
        settings=learner.relinearisation,
    )
