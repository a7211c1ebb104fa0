"""Identification in one stage: all unknowns together, over complete logs.

    logs, vehicle -> maximum of the posterior by Gauss-Newton steps on the derivatives (problem.py, gauss_newton.py)
                  -> covariance that allows for model error (posterior.py), a verdict for each parameter (verdict.py)
                  -> identified vehicle

The article needs two stages and more than ten lane changes. One stage needs one lane change: it linearises about the
estimate and not about the initial values, every sample informs all parameters, and parameters that are uncertain in the
vehicle file are treated as uncertain.
"""

import functools
import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fifthwheel._types import Array
from fifthwheel.channels import STEER, is_of, is_sensor_error
from fifthwheel.errors import VehicleError
from fifthwheel.identify.dataset import Dataset, prepare_dataset
from fifthwheel.identify.one_stage.gauss_newton import Minimum, minimise
from fifthwheel.identify.one_stage.posterior import ScaledPosterior
from fifthwheel.identify.one_stage.prior import Earlier, JointPrior
from fifthwheel.identify.one_stage.problem import Problem
from fifthwheel.identify.one_stage.solution import Solution
from fifthwheel.identify.sensor_priors import with_sensors
from fifthwheel.identify.settings import OneStage, Progress
from fifthwheel.identify.setup import Setup, with_tyre_law
from fifthwheel.identify.verdict import Verdict, uninformed_parameters
from fifthwheel.record import Record
from fifthwheel.units import STANDARD_GRAVITY
from fifthwheel.vehicle import Vehicle
from fifthwheel.vehicle.parameters import FRICTION

START, WHITE, EARLY, FINAL = "fit with linear tyres", "fit", "fit with first noise", "fit with estimated noise"
"""Of the progress of the fits, in this order."""
WHITE_TOLERANCE = 1.4
"""Of the first fit, which takes residuals as white: its sigmas are too small, and other fits follow."""
ROUND_TOLERANCES = (0.4, 0.07)
"""Of the fits with a noise model; each takes the noise from the residuals of the one before. The prediction-error form
has the last one only. The estimates are then within 0.02 sigma of those of a tenth of this tolerance."""
EARLY_ITERATIONS = 25
"""Largest number of steps of every fit but the last."""
START_ITERATIONS = 8
"""Largest number of steps of the fit with linear tyres that only gives a start to tyres that saturate."""
EARLY_SAMPLES = 4_000
"""Of longer logs, every fit but the last uses about this number of samples: of each segment, the most steered part. So
does the first look at what the inputs excite."""
LEAST_DECAY = 0.1
"""Of the slowest mode, 1/s. A free-running model of a vehicle that is closer to instability follows no log."""
GRIP_MARGIN = 2.0
"""Friction at the start of the search over that which the lateral acceleration needs."""


def solve_one_stage(
    records: Sequence[Record],
    vehicle: Vehicle,
    settings: OneStage,
    *,
    earlier: Earlier | None = None,
    validate: Sequence[Record] = (),
    progress: Progress = lambda *_: None,
) -> Solution:
    """The maximum of the posterior; arguments and errors as in `identify`.

    `earlier` is the information of earlier logs on the unknowns of a setup. A vehicle that is unstable, or nearly,
    in the logs is solved by prediction errors.
    """
    settings, _ = with_tyre_law(vehicle, settings)
    estimator = _estimator(records, vehicle, settings, validate, earlier)
    if settings.tyre_law != "linear":
        linear = _estimator(records, vehicle, replace(settings, tyres="linear"), validate, earlier, findings=False)
        estimator = replace(estimator, start=linear.start_of_saturating(progress))
    minimum = estimator.minimise(progress)
    if minimum.objective.output_error and minimum.objective.slowest_decay(minimum.z) < LEAST_DECAY:
        innovations = replace(settings, form="prediction_error")
        other = solve_one_stage(records, vehicle, innovations, earlier=earlier, validate=validate, progress=progress)
        if other.minimum.converged:
            return other
    return estimator.solution(minimum)


def _estimator(
    records: Sequence[Record],
    vehicle: Vehicle,
    settings: OneStage,
    validate: Sequence[Record],
    earlier: Earlier | None,
    *,
    findings: bool = True,
) -> "_Estimator":
    """With `findings=False` the signals have been checked."""
    dataset = prepare_dataset(records, vehicle, settings, validate, findings=findings)
    settings = with_sensors(dataset.vehicle, settings, dataset.sensors)
    setup = Setup.of(dataset.vehicle, dataset.outputs, settings)
    if not setup.estimated and not settings.nuisances:
        raise VehicleError(
            "fixed: every parameter is fixed and no sensor error is estimated, so nothing is left to estimate; "
            "leave one parameter free, or estimate the sensor errors (nuisances)"
        )
    time_bases = {name: base for record in dataset.records for name, base in record.time_bases.items()}
    setup = setup.with_time_bases(time_bases)
    return _Estimator(dataset=dataset, setup=setup, earlier=earlier(setup) if earlier else None, start={})


@dataclass(frozen=True, kw_only=True)
class _Estimator:
    """What stays the same during one identification."""

    dataset: Dataset
    setup: Setup
    earlier: JointPrior | None
    start: Mapping[str, float]
    """Where the search begins, in units of the priors; the prior mean for other unknowns."""

    def minimise(self, progress: Progress) -> Minimum[Problem]:
        """Estimate all unknowns together."""
        return self._minimise(Problem(self.setup, self.dataset.logs, self.earlier), progress)

    def solution(self, minimum: Minimum[Problem]) -> Solution:
        """The solution at a minimum."""
        return Solution(dataset=self.dataset, minimum=minimum, uninformed=self._uninformed(minimum))

    def start_of_saturating(self, progress: Progress) -> dict[str, float]:
        """Where the search with tyres that saturate begins, in units of the priors, from that with linear tyres.

        At the prior mean a steering offset may let such tyres skid. The first fit with linear tyres gives the start,
        with a friction that is large enough for the lateral accelerations of the logs.
        """
        problem = Problem(self.setup, self.dataset.logs, self.earlier)
        minimum = self._first_fit(problem, START, progress, START_ITERATIONS)
        solution = Solution(dataset=self.dataset, minimum=minimum, uninformed={})
        settings = self.setup.settings
        largest = max(filter(math.isfinite, solution.lateral_accelerations), default=0.0)
        needed = GRIP_MARGIN * largest / STANDARD_GRAVITY
        friction = float(np.log(max(needed, settings.friction) / settings.friction)) / settings.friction_prior
        return dict(zip(minimum.objective.names, minimum.z.tolist(), strict=True)) | {FRICTION: friction}

    def _uninformed(self, minimum: Minimum[Problem]) -> dict[str, Verdict]:
        """Estimated parameters that the logs do not determine, by the information that the inputs excite.

        The estimated initial states are set to their prior means: along them the noise of the sensors would look like
        excitation. A part of the logs that informs all parameters saves the rest.
        """
        problem, excited_by_inputs, setup = minimum.objective, minimum.z.copy(), self.setup
        for segments in problem.layout.initial_states:
            for indices in segments:
                excited_by_inputs[indices] = 0.0
        own = np.diag(problem.prior.own_precision(excited_by_inputs))  # that of earlier logs counts as information
        unseen = setup.without_roll_rate - frozenset(self.earlier.names if self.earlier else ())

        def uninformed_by(logs: Problem) -> dict[str, Verdict]:
            information = logs.expand(excited_by_inputs).hessian - own
            posterior = ScaledPosterior.from_information(logs.names, information, nuisances=logs.nuisances)
            return uninformed_parameters(posterior, setup.estimated, unseen, setup.settings.excited)

        part = problem.shortened(EARLY_SAMPLES) if problem.output_error else problem
        uninformed = uninformed_by(part)
        return uninformed if part is problem or uninformed.keys() <= unseen else uninformed_by(problem)

    def _initial(self, problem: Problem) -> Array:
        """The start, usually the prior means; stiffer tyres behind the first group if that vehicle is unstable."""
        means = zip(problem.names, problem.prior.mean.tolist(), strict=True)
        return problem.stiffened(np.clip([self.start.get(name, mean) for name, mean in means], *problem.bounds))

    def _first_fit(
        self, problem: Problem, title: str, progress: Progress, steps: int = EARLY_ITERATIONS
    ) -> Minimum[Problem]:
        """The fit that takes residuals as white and updates their variance at every step.

        Gains and delays of gyros keep their prior means, because far from the solution they would absorb the errors of
        the parameters.
        """
        late = np.array([is_sensor_error(name) and not _is_early(name) for name in problem.names])
        first, z = problem.shortened(EARLY_SAMPLES), self._initial(problem)
        fit = functools.partial(self._fit, first, z, title, progress, tolerance=WHITE_TOLERANCE, steps=steps)
        return fit(reweighted=_white, fixed=late) if self.setup.settings.adapt_noise else fit()

    def _minimise(self, problem: Problem, progress: Progress) -> Minimum[Problem]:
        """The maximum of the posterior.

        With adapted noise in several fits: each after the first fits the noise model to the residuals of the fit
        before, and keeps it. The last, whose first step is the largest, fits it once more after that step.
        """
        tolerances = ROUND_TOLERANCES if problem.output_error else ROUND_TOLERANCES[-1:]
        if not self.setup.settings.adapt_noise:
            return self._fit(problem, self._initial(problem), WHITE, progress)
        early = self._first_fit(problem, WHITE, progress)
        first = problem.shortened(EARLY_SAMPLES)
        for tolerance in tolerances[:-1]:
            corrected = early.objective.with_residual_noise(early.z, autocorrelated=True)
            early = self._fit(corrected, early.z, EARLY, progress, tolerance=tolerance, steps=EARLY_ITERATIONS)
        z = early.z
        if first is problem:  # not shortened
            problem = early.objective
        else:  # the parts begin later than the segments
            for indices in itertools.chain(*problem.layout.initial_states):
                z[indices] = 0.0
        return self._fit(_coloured(problem, z), z, FINAL, progress, reweighted=_coloured)

    def _fit(
        self,
        problem: Problem,
        z: Array,
        title: str,
        progress: Progress,
        *,
        tolerance: float = ROUND_TOLERANCES[-1],
        steps: int | None = None,
        reweighted: Callable[[Problem, Array, int], Problem] = lambda problem, *_: problem,
        fixed: NDArray[np.bool_] | None = None,
    ) -> Minimum[Problem]:
        """The minimum of the cost from z.

        `steps` is the largest number, by default that of the settings. `fixed` (k,) are unknowns that keep their prior
        mean; `title` is that of the progress.
        """
        lower, upper = (bound if fixed is None else np.where(fixed, 0.0, bound) for bound in problem.bounds)
        iterations = self.setup.settings.iterations
        minimum = minimise(
            problem,
            z,
            lower=lower,
            upper=upper,
            iterations=steps or iterations,
            tolerance=tolerance,
            reweighted=reweighted,
            progress=functools.partial(progress, title),
        )
        progress(title, iterations, iterations)
        return minimum


def _white(problem: Problem, z: Array, *_: int) -> Problem:
    """The problem with white noise of the variances that the residuals at z have; after every step."""
    return problem.with_residual_noise(z, autocorrelated=False)


def _coloured(problem: Problem, z: Array, accepted: int = 0) -> Problem:
    """The problem with the noise models of the residuals at z; not after the second accepted step or later."""
    return problem.with_residual_noise(z, autocorrelated=True) if accepted <= 1 else problem


def _is_early(name: str) -> bool:
    """Whether a sensor error is estimated from the first fit on: offsets, and gain and delay of the steering."""
    steer = is_of(name, STEER)
    return is_sensor_error(name, "offset") or (steer and not is_sensor_error(name, "play"))
