"""Parameter estimation in one stage: everything that is unknown at once, over whole records.

    logs, vehicle -> the maximum of the posterior by Gauss-Newton steps on exact derivatives (problem.py)
                  -> covariance that survives model error, a verdict for each parameter (posterior.py)
                  -> identified vehicle

What the article needs two stages and more than ten lane changes for is in one: nothing is linearised about a poor
guess, no sample is seen by one half of the model only, and what the vehicle file knows roughly is told as that.
"""

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

import fifthwheel
from fifthwheel import dynamics
from fifthwheel.errors import VehicleError
from fifthwheel.identify import estimates, likelihood, parameters
from fifthwheel.identify.drives import Drives
from fifthwheel.identify.gauss_newton import Minimum, minimise
from fifthwheel.identify.information import Verdict
from fifthwheel.identify.parameters import Unknown
from fifthwheel.identify.posterior import Posterior, posterior, verdicts
from fifthwheel.identify.problem import Problem
from fifthwheel.identify.result import Estimate, Identification
from fifthwheel.identify.settings import OneStage
from fifthwheel.identify.stage import Progress, Trace, long_run
from fifthwheel.logs import Record
from fifthwheel.observe.uncertainty import Uncertainty
from fifthwheel.vehicle import Vehicle, unit_of

Array = NDArray[np.float64]

HISTORY = 200
"""Points at which it is told what the logs had said by then."""


class OneStageFit:
    """One identification in one stage; arguments as in `methods.identify`."""

    def __init__(
        self,
        records: Sequence[Record],
        vehicle: Vehicle,
        settings: OneStage,
        validate: Sequence[Record],
        progress: Progress,
    ) -> None:
        self.drives = Drives(records, vehicle, settings, validate)
        self.settings, self.progress = settings, progress
        self.vehicle, self.logs, self.notes = self.drives.vehicle, self.drives.logs, self.drives.notes
        self.outputs = (*self.drives.yaw, *self.drives.roll)
        free = tuple(dynamics.all_parameters(self.vehicle, self.outputs))
        self.model = dynamics.model(self.vehicle, self.outputs, roll=True, bank=settings.nuisances, free=free)
        self.sought = parameters.one_stage_sought(self.vehicle, settings)
        if not self.sought and not settings.nuisances:
            raise VehicleError("held: every parameter is held, and no sensor's error is sought; leave one free")

    def run(self) -> Identification:
        """Fit; then again, with what turned out not to be told kept at the vehicle file's value."""
        problem = self._problem({})
        idle, attempt = self._idle(problem, self._start(problem)), 0
        while True:
            problem = self._problem(idle)
            found = self._fit(problem)
            now = self._idle(problem, found.z)
            if attempt:  # what the start said may be taken back once; after that the set only grows
                now = idle | now
            if set(now) == set(idle):
                return self._result(problem, found, now)
            idle, attempt = now, attempt + 1

    def _problem(self, idle: Mapping[str, Verdict]) -> Problem:
        """The problem in which what is idle keeps the vehicle file's value, and its prior counts in every sigma."""
        given = self.vehicle.parameters()
        unknowns = [
            replace(u, centre=given[u.name], considered=True) if u.name in idle else u
            for u in parameters.one_stage_unknowns(self.vehicle, self.outputs, self.settings)
        ]
        return Problem(self.model, self.vehicle, self.logs, unknowns, self.settings)

    def _idle(self, problem: Problem, z: Array) -> dict[str, Verdict]:
        """What the logs do not tell, and why; by what the inputs do to the truck.

        Along the initial states that were fitted there would be the sensors' noise, which looks like excitation.
        """
        quiet = z.copy()
        for starts in problem.starts:
            for places in starts:
                quiet[places] = 0.0
        information = problem.expand(quiet, directions="all").hessian - np.eye(len(z))
        kept = [u.name for u in problem.unknowns if u.considered and u.name not in self.sought]
        known = posterior(problem.names, information, considered=kept, nuisances=problem.nuisances)
        told = verdicts(known, [known.names.index(name) for name in self.sought], self.settings.excited)
        idle: dict[str, Verdict] = {
            known.names[i]: verdict for i, verdict in told.items() if verdict is not Verdict.CONVERGED
        }
        moving = len(idle) < len(self.sought) or Verdict.NOT_IDENTIFIABLE in idle.values()
        for name in self.sought:
            if parameters.unseen(name, self.outputs):
                idle[name] = Verdict.NOT_IDENTIFIABLE if moving else Verdict.NOT_EXCITED
        return idle

    def _fit(self, problem: Problem) -> Minimum:
        """The most probable unknowns, first with residuals taken for white, then for what they are."""
        lower, upper = problem.bounds
        z = self._start(problem)
        phases: list[tuple[str, Callable[[Array], None]]] = [("fit", _stay)]
        if self.settings.adapt_noise:
            white = functools.partial(problem.adapt, coloured=False)
            phases = [("fit", white), ("fit, noise as found", _stay)]
        for number, (title, accept) in enumerate(phases):
            if number:
                problem.adapt(z, coloured=True)
            found = minimise(
                problem.expand,
                problem.cost,
                accept,
                z,
                lower=lower,
                upper=upper,
                iterations=self.settings.iterations,
                progress=functools.partial(self.progress, title),
            )
            z = found.z
            self.progress(title, self.settings.iterations, self.settings.iterations)
        return found

    def _start(self, problem: Problem) -> Array:
        """The priors' means; where that truck would run away, its axles behind the first are held stiffer to begin."""
        z = np.zeros(len(problem.names))
        _, *others = [f"{path}.cornering_stiffness" for path in parameters.group_paths(self.vehicle)]
        places = [i for i, name in enumerate(problem.names) if name in others]
        while problem.unstable(z) and places and z[places[0]] < problem.bounds[1][places[0]]:
            z[places] += 0.5
        return z

    def _known(self, problem: Problem, z: Array) -> tuple[Posterior, Trace]:
        """Posterior at z; and how it came about, sample after sample, linearised there."""
        k = len(problem.names)
        information, spread = np.zeros((k, k)), np.zeros((k, k))
        elapsed, moments, total = 0.0, [], sum(len(s.time) for log in self.logs for s in log.sections)
        gradient = np.zeros(k)
        considered = [u.name for u in problem.unknowns if u.considered]
        learned = np.array([name not in considered for name in problem.names])
        rows = [problem.names.index(name) for name in self.sought]
        values, sigmas = [], []
        for i, j in problem.sections():
            scores = []
            for whole in problem.parts(z, i, j):
                for part in whole.split(max(total // HISTORY, 1)):
                    own, gram = likelihood.information(part, self.settings.outlier)
                    information[np.ix_(part.places, part.places)] += gram
                    gradient[part.places] += own
                    P = np.linalg.inv(np.eye(k) + information * np.outer(learned, learned))
                    values.append((z - learned * (P @ (learned * (z + gradient))))[rows])
                    sigmas.append(np.sqrt(np.diag(P))[rows])
                    moments.append(elapsed + part.time[-1] - self.logs[i].sections[j].time[0])
                scores.append(likelihood.scores(whole, self.settings.outlier))
            elapsed = moments[-1]
            lags = max(int(self.settings.correlation_time * self.logs[i].sections[j].rate), 1)
            spread[np.ix_(whole.places, whole.places)] += long_run(np.concatenate(scores), lags)
        sought = [u for u in problem.unknowns if u.name in self.sought]
        scale = parameters.scaling(sought)
        p = scale.to_p(np.array(values))
        trace = Trace(
            names=tuple(self.sought),
            time=np.array(moments),
            values=p,
            sigma=np.array(sigmas) * np.abs(scale.slope(p)),
            starts=(0,),
        )
        return posterior(problem.names, information, spread, considered=considered, nuisances=problem.nuisances), trace

    def _result(self, problem: Problem, found: Minimum, idle: Mapping[str, Verdict]) -> Identification:
        known, trace = self._known(problem, found.z)
        shared, sigma = problem.values(found.z, 0), dict(zip(known.names, known.sigma.tolist(), strict=True))
        for i, log in enumerate(self.logs):
            values = problem.values(found.z, i)
            log.errors |= {u.name: values[u.name] for u in problem.unknowns if u.each_log}
        own = {u.name: shared[u.name] for u in problem.unknowns if not u.nuisance}
        vehicle = self.drives.identified(self.drives.original, own)
        plain = dynamics.model(self.vehicle, self.outputs, roll=True, bank=self.model.bank)
        common = {u.name: shared[u.name] for u in problem.unknowns if u.nuisance and not u.each_log}
        fits, believed = self.drives.fits(plain, self.vehicle.replace(own), problem.unknowns, common)
        settled = found.converged and believed
        told, rough = [], []
        for u in problem.unknowns:
            if u.name in self.sought:
                told.append(self._estimate(u, shared[u.name], known, trace, idle, settled))
            elif not u.nuisance:
                rough.append(self._rough(u, shared[u.name], known))
        given = self.drives.original.parameters()
        for name in parameters.expanded(self.vehicle, self.settings.held):
            told.append(
                Estimate(
                    name=name,
                    value=given[name],
                    sigma=None,
                    unit=unit_of(name),
                    initial=given[name],
                    verdict=Verdict.HELD,
                    stage=1,
                )
            )
        covariance = self._covariance(problem, found, known)
        return Identification(
            method="one-stage",
            vehicle=vehicle,
            initial_vehicle=self.drives.original,
            parameters=tuple(told),
            derived=tuple(estimates.derived_together(self.drives.original, vehicle, told, covariance)),
            sensors=tuple(estimates.of_sensors(problem.unknowns, self.logs, shared, sigma)),
            rough=tuple(rough),
            covariance=covariance,
            traces={"one stage": trace},
            logs=tuple(
                replace(
                    estimates.summary(record, log, self.outputs, accepted), bank=self._bank(problem, found, known, i)
                )
                for i, (record, log, accepted) in enumerate(
                    zip(self.drives.records, self.logs, self._accepted(problem, found), strict=True)
                )
            ),
            fits=tuple(fits),
            settings=self.settings,
            rounds=found.steps,
            notes=tuple(dict.fromkeys(self.notes)),
            version=fifthwheel.__version__,
        )

    def _bank(self, problem: Problem, found: Minimum, known: Posterior, log: int) -> tuple[float, float] | None:
        """The road's lean in a log's first stretch, and its sigma; None where it is no unknown."""
        if not self.model.bank or not problem.free_run:
            return None
        place, prior = problem.starts[log][0][-1], self.settings.bank_prior
        return float(found.z[place] * prior), float(known.sigma[place] * prior)

    def _accepted(self, problem: Problem, found: Minimum) -> list[Array]:
        """Each log's (N, m): 1 where a sample counted in full, 0 where it is missing or an outlier."""
        told = []
        for i, log in enumerate(self.logs):
            parts = [p for j in range(len(log.sections)) for p in problem.parts(found.z, i, j, directions="none")]
            sizes = np.concatenate([np.abs(part.error) / np.sqrt(part.variance) for part in parts])
            told.append((sizes <= self.settings.gate).astype(float))
        return told

    def _estimate(
        self,
        u: Unknown,
        value: float,
        known: Posterior,
        trace: Trace,
        idle: Mapping[str, Verdict],
        settled: bool,
    ) -> Estimate:
        i = known.names.index(u.name)
        slope = float(parameters.scaling([u]).slope(np.array([value]))[0])
        sigma = float(known.sigma[i]) * slope
        verdict = idle.get(u.name, Verdict.CONVERGED if settled else Verdict.NOT_CONVERGED)
        unseen = parameters.unseen(u.name, self.outputs)
        confused = [] if unseen else [self._plain(known.names[j]) for j in known.confused(i)]
        confused = [name for name in confused if name not in self.model.states]
        if verdict == Verdict.NOT_IDENTIFIABLE and not (confused or unseen) and known.alone(i) < self.settings.excited:
            confused = [self._plain(known.names[known.worst_companion(i)])]
        if u.name not in idle and min(value - u.lower, u.upper - value) < 0.1 * sigma:
            verdict = Verdict.AT_BOUND
        since = estimates.settled_since(trace.values[:, trace.names.index(u.name)], self.settings.tolerance)
        late = since > (1 - estimates.SETTLED_PART) * len(trace.time)
        return Estimate(
            name=u.name,
            value=value,
            sigma=sigma,
            unit=unit_of(u.name),
            initial=u.centre,
            verdict=verdict,
            stage=1,
            settled=None if late or u.name in idle else float(trace.time[since]),
            prior=u.scale * (u.centre if u.logarithmic else 1.0),
            confused_with=tuple(confused),
        )

    def _plain(self, name: str) -> str:
        """Without the number of a log, where there is only one; of a first state, without that of its stretch."""
        plain, _, number = name.partition("@")
        return plain if len(self.logs) == 1 or "." in number else name

    def _rough(self, u: Unknown, value: float, known: Posterior) -> Estimate:
        i = known.names.index(u.name)
        learned = not u.considered and known.sigma[i] < self.settings.excited
        verdict = Verdict.HELD if u.considered else Verdict.CONVERGED if learned else Verdict.NOT_EXCITED
        slope = float(parameters.scaling([u]).slope(np.array([value]))[0])
        return Estimate(
            name=u.name,
            value=value,
            sigma=float(known.sigma[i]) * slope,
            unit=unit_of(u.name),
            initial=u.centre,
            verdict=verdict,
            stage=1,
            prior=u.scale * u.centre,
        )

    def _covariance(self, problem: Problem, found: Minimum, known: Posterior) -> Uncertainty:
        """Of everything but the initial states, in SI."""
        names, places, slopes = [], [], []
        for i, log in enumerate(self.logs):
            values = problem.values(found.z, i)
            slope = problem.scaling.slope(np.array([values[u.name] for u in problem.unknowns]))
            for u, place, s in zip(problem.unknowns, problem.places[i], slope, strict=True):
                if i == 0 or u.each_log:
                    names.append(f"{u.name}@{log.name}" if u.each_log else u.name)
                    places.append(int(place))
                    slopes.append(float(s))
        scaled = known.covariance[np.ix_(places, places)] * np.outer(slopes, slopes)
        # any other log has errors of its own sensors, of which nothing is known but the prior
        other = [u for u in problem.unknowns if u.each_log]
        whole = np.diag([*[0.0] * len(names), *[u.scale**2 for u in other]])
        whole[: len(names), : len(names)] = scaled
        return Uncertainty(names=(*names, *[f"{u.name}@" for u in other]), covariance=whole)


def _stay(_: Array) -> None:
    """The noise stays as it is."""
