"""The live filter of one truck: a sample goes in, and what is known of states and unknowns changes."""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fifthwheel import dynamics
from fifthwheel.dynamics import steps
from fifthwheel.errors import SignalError
from fifthwheel.filters import Noise, joint
from fifthwheel.filters.twice import Twice
from fifthwheel.identify.excitation import Excitation, LearnerSettings
from fifthwheel.identify.parameters import Unknown, group_paths, one_stage_sought, one_stage_unknowns, scaling, unseen
from fifthwheel.identify.settings import OneStage
from fifthwheel.identify.stage import begin
from fifthwheel.observe import Status
from fifthwheel.observe import noise as variances
from fifthwheel.observe.prepare import Rows, locked_but
from fifthwheel.observe.step import reported
from fifthwheel.observe.stretches import FASTEST
from fifthwheel.vehicle import Vehicle

Array = NDArray[np.float64]


class Live:
    """A joint filter of the yaw-roll model, the road's bank, the unknown parameters and the sensors' errors.

    Arguments and errors are those of `recursive.Learner`.
    """

    def __init__(self, vehicle: Vehicle, signals: Iterable[str], settings: OneStage, learner: LearnerSettings) -> None:
        self.given, self.signals = vehicle, frozenset(signals)
        self.settings, self.learner = settings, learner
        if not settings.relaxation:
            vehicle = vehicle.replace({f"{path}.relaxation_length": 0.0 for path in group_paths(vehicle)})
        if not settings.uniform_payload:
            vehicle = vehicle.lumped()
        if "speed" not in self.signals:
            raise SignalError("speed: not among the signals; the model needs the forward speed in m/s")
        self.vehicle = vehicle = locked_but(vehicle, self.signals, "the signals")
        units = [unit.name for unit in vehicle.units]
        wanted = [f"yaw_rate.{u}" for u in units] + [f"articulation.{u}" for u in units[1:]]
        wanted += [f"roll_rate.{u}" for u in units]
        self.outputs = tuple(name for name in wanted if name in self.signals)
        if not any(name.startswith("yaw_rate") for name in self.outputs):
            raise SignalError(f"yaw_rate.{units[0]}: not among the signals; a learner needs at least one yaw rate")
        self.unknowns = tuple(self._unknowns())
        if all(u.considered for u in self.unknowns):
            raise SignalError("held: nothing is left to be learned; use an Observer")
        self.names = tuple(u.name for u in self.unknowns)
        self.scaling = scaling(self.unknowns)
        # the bank, like the sensors' errors, is what no vehicle file can know
        self.model = dynamics.model(vehicle, self.outputs, roll=True, bank=settings.nuisances, free=self.names)
        self.inputs = self.model.inputs
        self.filter = self._filter()
        self._excitation = Excitation(vehicle, len(self.inputs) - 1, learner)
        self._limit = steps.StepLimit(vehicle, roll=True)
        self._short = self._limit.short
        self._inputs = [math.nan] * len(self.inputs)  # last ones seen
        self._seen = [-math.inf] * len(self.inputs)  # and when
        self._time = self._used = self._started = -math.inf  # of the last sample, measurement that was used, start
        self._stale = -math.inf  # and when a steer angle had last been missing for long
        self._running = False
        self._last: Sequence[float] = self._inputs  # inputs of the sample before
        self.learning = False
        self.misfit = [1.0] * len(self.outputs)  # mean square of innovations over what they may be
        self._make_view()

    def _unknowns(self) -> Iterator[Unknown]:
        """What is sought stays as the vehicle file has it where the signals tell of it at second hand only."""
        given = self.vehicle.parameters()
        self.blind = {name for name in one_stage_sought(self.vehicle, self.settings) if unseen(name, self.outputs)}
        for u in one_stage_unknowns(self.vehicle, self.outputs, self.settings):
            yield replace(u, centre=given[u.name], considered=True) if u.name in self.blind else u

    def _filter(self) -> Twice:
        settings = self.settings
        table = variances.PROCESS | {"bank": settings.bank_walk**2}
        noise = Noise(
            # never quite zero: a covariance that dies away would end in denormal numbers, which are slow
            process=variances.process(self.model.states, table, max(settings.process_noise, 1e-9)),
            measurement=np.array([variances.sensor(self.vehicle, name, settings.noise) for name in self.outputs]),
            gate=settings.gate,
        )
        return Twice(
            self.model,
            c=self.model.known_values(dynamics.all_parameters(self.vehicle, self.outputs)),
            noise=noise,
            scaling=self.scaling,
            free=np.array([float(not u.considered) for u in self.unknowns]),
            looks=self.learner.looks,
        )

    def _make_view(self) -> None:
        """What shows the states: of the unknowns they know the vehicle's and the steer sensors'."""
        self.reported = reported(self.vehicle, roll=True, bank=self.model.bank)
        own = {*self.vehicle.parameters(), *dynamics.steer_parameters(self.vehicle)}
        places = tuple(i for i, name in enumerate(self.names) if name in own)
        free = [self.names[i] for i in places]
        report = dynamics.model(self.vehicle, self.reported, roll=True, bank=self.model.bank, free=free)
        self._view = joint.view(self.model, report, self.scaling.logarithmic, places)
        c = report.known_values(dynamics.all_parameters(self.vehicle, self.reported))
        constant = np.concatenate([c, self.scaling.centre, self.scaling.scale])
        self._view_constant = np.repeat(constant[:, None], joint.LANES, axis=1)
        self._output = np.zeros((self._view.n_output, joint.LANES))
        self._shown = self._output[:, 0]
        d = self.filter.sample[1:]  # it reads them where the filter does
        arrays = (self.filter.carry, d, self._view_constant, self._output)
        self._addresses = tuple(a.ctypes.data for a in arrays)

    def states(self) -> list[float]:
        """What `reported` names, and then their variances, which count what is not known of the parameters."""
        self._view.vector(1, 1, *self._addresses)
        shown: list[float] = self._shown.tolist()
        return shown

    def take(self, time: float, inputs: Sequence[float | None], measured: Sequence[float | None]) -> Status:
        """One sample of `inputs` and `outputs`, later than the one before; None or NaN where nothing was measured."""
        learner = self.learner
        status, held = self._inputs_at(time, inputs)
        gap, previous, self._time = time - self._time, self._time, time
        if status != Status.OK:
            self._running = self.learning = False
            return status
        row, k, m = self.filter.row, len(self.inputs), len(self.outputs)
        if not self._running or gap > learner.max_gap:
            gap = 0.0  # the state begins here
            self._start(time, held)
        stretch = self._excitation(gap, held) and time - self._started >= learner.settle
        self.learning = stretch and self._fresh(time)
        if gap > self._short[int(held[0])] or gap > self._short[int(self._last[0])]:
            self._between(previous, time, held, stretch)
        elif gap:
            row[0] = gap
            for i, value in enumerate(self._last, 1):
                row[2 * i] = value
        for i, value in enumerate(held, 1 + k):
            row[2 * i] = value
        self._last = held
        any_there = False
        for i, reading in enumerate(measured, 1 + 2 * k):
            there = reading is not None and math.isfinite(reading)
            row[2 * i], row[2 * (i + m)] = (reading if there else 0.0), there
            any_there |= there
        used, lost = self.filter.advance(stretch, self.learning)
        if self.learning:
            self._compare(gap)
        if used:
            self._used = time
        silent = time - self._used > learner.coast
        if lost or (silent and any_there):
            self._start(time, held)
            self.filter.advance(False, False)
            return Status.OK
        return Status.COASTING if silent else Status.OK

    def _compare(self, gap: float) -> None:
        """Count how far the measurements are from what the filter thinks they may be."""
        part = gap / (self.learner.window_misfit + gap)
        k, m, limit = 1 + 2 * len(self.inputs), len(self.outputs), self.settings.gate**2
        for i in range(m):
            if self.filter.row[2 * (k + m + i)]:
                self.misfit[i] += part * (min(self.filter.out[2 * (m + i)], limit) - self.misfit[i])

    def _fresh(self, time: float) -> bool:
        """Whether every steer angle was measured now, and has not been missing for long lately."""
        if any(seen < time for seen in self._seen[1:]):
            return False
        return time - self._stale >= self.learner.settle

    def _inputs_at(self, time: float, given: Sequence[float | None]) -> tuple[Status, list[float]]:
        """Inputs at this sample, held where they are missing, and whether they will do."""
        missing = False
        for i, value in enumerate(given):
            since = time - self._seen[i]
            if value is not None and math.isfinite(value) and self._plausible(i, value, time):
                self._inputs[i], self._seen[i] = float(value), time
            elif not since <= self.learner.hold:
                missing = True
            elif i and since > self.learner.stale:
                self._stale = time
        if missing:
            return Status.INPUT_MISSING, self._inputs
        slow = self._inputs[0] < self.settings.min_speed
        return (Status.TOO_SLOW if slow else Status.OK), list(self._inputs)

    def _plausible(self, i: int, value: float, time: float) -> bool:
        """Whether an input may be so. A spike of one would move state and sensitivities alike, and so pass for news."""
        since, change = time - self._seen[i], abs(value - self._inputs[i])
        if i == 0 and not value <= FASTEST:
            return False
        return change <= (self.learner.jump * since if i else self.learner.surge) or since > self.learner.hold

    def _start(self, time: float, inputs: Sequence[float]) -> None:
        """The state anew, at the steady one of these inputs."""
        first, none = dict(zip(self.inputs, inputs, strict=True)), np.zeros(0)
        rows = Rows(rows=none, time=none, places=none.astype(np.int64), first=first, swing=variances.SWING)
        self.filter.conclude()
        z, _ = self.filter.learned()
        x, P, V = begin(self.vehicle, self.names, self.scaling, z, rows, roll=True)
        if self.model.bank:
            x, P, V = np.append(x, 0.0), np.pad(P, (0, 1)), np.pad(V, ((0, 1), (0, 0)))
            P[-1, -1] = self.settings.bank_prior**2
        self.filter.start(x, P, V, np.array([*inputs, *inputs]))
        self._excitation.restart()
        self._started = self._used = time
        self._last = inputs
        self._running, self.learning = True, False

    def _between(self, before: float, time: float, inputs: Sequence[float], stretch: bool) -> None:
        """Steps without measurements up to the last one, which is left in the sample."""
        last = self._last
        limits = self._limit(np.array([last[0], inputs[0]]))
        fine, columns, _ = steps.subdivide(np.array([before, time]), np.array([last, inputs]), limits)
        dt, d = steps.step_inputs(fine, columns)
        sample, k, m = self.filter.sample, len(self.inputs), len(self.outputs)
        sample[1 + 2 * k : 1 + 2 * k + 2 * m, 0] = 0.0
        for i in range(1, len(fine)):
            sample[0, 0], sample[1 : 1 + 2 * k, 0] = dt[i], d[i]
            if i < len(fine) - 1:
                self.filter.advance(stretch, False)
