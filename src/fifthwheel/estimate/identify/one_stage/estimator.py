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
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fifthwheel.base.errors import VehicleError
from fifthwheel.base.types import Array
from fifthwheel.base.units import STANDARD_GRAVITY
from fifthwheel.data.channels import STEER, is_of, is_sensor_error
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify.dataset import Dataset, prepare_dataset
from fifthwheel.estimate.identify.given import with_sensors
from fifthwheel.estimate.identify.one_stage.gauss_newton import Minimum, minimise
from fifthwheel.estimate.identify.one_stage.posterior import ScaledPosterior
from fifthwheel.estimate.identify.one_stage.prior import Earlier, JointPrior
from fifthwheel.estimate.identify.one_stage.problem import Problem
from fifthwheel.estimate.identify.one_stage.solution import Solution
from fifthwheel.estimate.identify.settings import OneStage, Progress
from fifthwheel.estimate.identify.setup import Setup
from fifthwheel.estimate.identify.verdict import Verdict, uninformed_parameters
from fifthwheel.truck import Vehicle
from fifthwheel.truck.quantities import FRICTION

WHITE, EARLY, FINAL = "fit", "fit with first noise", "fit with estimated noise"
"""Of the progress of the fits, in this order."""
WHITE_TOLERANCE = 1.4
"""Of the first fit, which takes residuals as white: its sigmas are too small, and other fits follow."""
EARLY_TOLERANCE = 0.4
"""Of the fit with the noise model of the residuals of the first one."""
TOLERANCE = 0.07
"""Of the last fit. The estimates are then within 0.02 sigma of those of a tenth of this tolerance."""
LARGEST_EXCESS = 9.0
"""Of the residual variance of a channel over that of the part which the early fits use."""
FIRST_RANGE = 2.0
"""Of uncertain numbers in the first fit, in prior standard deviations."""
NOISE_UPDATES = 5
"""Of the start: one raises the variance at most by the square of the limit for outliers."""
EARLY_ITERATIONS = 25
"""Largest number of steps of every fit but the last."""
EARLY_ROWS = 1_500
"""Of longer logs, every fit but the last uses about this number of rows: of each segment, the most steered part. So
does the first look at what the inputs excite."""
LEAST_DECAY = 0.1
"""Of the slowest mode, 1/s. A free-running model of a vehicle that is closer to instability follows no log."""
GRIP_MARGIN = 2.0
"""Friction at the start of the search over that which the lateral acceleration needs."""
LEAST_GRIP = 0.8
"""Least friction over that which the lateral acceleration needs. The law of the tyres tends to at most 1.2 times the
friction, and a bank adds to the side force."""


def solve_one_stage(
    records: Sequence[Record],
    vehicle: Vehicle,
    settings: OneStage,
    *,
    earlier: Earlier | None = None,
    validate: Sequence[Record] = (),
    progress: Progress = lambda *_: None,
) -> Solution:
    """The maximum of the posterior; arguments and errors as in `identify`, but with settings that are `applied` to the
    vehicle and name a tyre law.

    `earlier` is the information of earlier logs on the unknowns of a setup. A vehicle that is unstable, or nearly,
    in the logs is solved by prediction errors.
    """
    estimator = _estimator(records, vehicle, settings, validate, earlier)
    minimum = estimator.minimise(progress)
    if minimum.objective.output_error and _diverges(minimum):
        innovations = replace(settings, form="prediction_error")
        other = solve_one_stage(records, vehicle, innovations, earlier=earlier, validate=validate, progress=progress)
        if other.minimum.converged or not np.isfinite(minimum.model.hessian).all():
            return other
    return estimator.solution(minimum)


def _estimator(
    records: Sequence[Record], vehicle: Vehicle, settings: OneStage, validate: Sequence[Record], earlier: Earlier | None
) -> "_Estimator":
    dataset = prepare_dataset(records, vehicle, settings, validate)
    settings = with_sensors(dataset.vehicle, settings, dataset.sensors)
    setup = Setup.of(dataset.vehicle, dataset.outputs, settings)
    if not setup.estimated_unknowns:
        raise VehicleError("given: everything is exact, so nothing is left to estimate; leave one number uncertain")
    time_bases = {name: base for record in dataset.records for name, base in record.time_bases.items()}
    setup = setup.with_time_bases(time_bases)
    largest = max(filter(math.isfinite, dataset.lateral_accelerations(settings.min_speed)), default=0.0)
    grip = largest / STANDARD_GRAVITY
    for u in (u for u in setup.unknowns if u.name == FRICTION):
        setup = setup.with_unknown(replace(u, lower=min(max(u.lower, LEAST_GRIP * grip), u.upper / 2)))
    return _Estimator(dataset=dataset, setup=setup, grip=grip, earlier=earlier(setup) if earlier else None)


@dataclass(frozen=True, kw_only=True)
class _Estimator:
    """What stays the same during one identification."""

    dataset: Dataset
    setup: Setup
    grip: float  # largest lateral acceleration of the logs over that of gravity
    earlier: JointPrior | None

    def solution(self, minimum: Minimum[Problem]) -> Solution:
        """The solution at a minimum."""
        return Solution(dataset=self.dataset, minimum=minimum, uninformed=self._uninformed(minimum))

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
            remaining = {name: posterior.sigma_of(name) for name in setup.estimated}
            return uninformed_parameters(posterior, remaining, unseen, setup.settings.excited)

        part = problem.shortened(EARLY_ROWS) if problem.output_error else problem
        uninformed = uninformed_by(part)
        return uninformed if part is problem or uninformed.keys() <= unseen else uninformed_by(problem)

    def _initial(self, problem: Problem) -> Array:
        """The start, usually the prior means; a friction for `GRIP_MARGIN` of the lateral acceleration of the logs, and
        stiffer tyres behind the first group if that vehicle is unstable."""
        start = problem.prior.mean.copy()
        if FRICTION in problem.names and self.grip:
            place, u = problem.names.index(FRICTION), problem.unknowns_by_name[FRICTION]
            needed = np.log(GRIP_MARGIN * self.grip / u.centre) / u.scale
            start[place] = max(start[place], needed)
        return problem.stiffened(np.clip(start, *problem.bounds))

    def minimise(self, progress: Progress) -> Minimum[Problem]:
        """The maximum of the posterior, with adapted noise in several fits.

        The early fits use the most steered parts of long logs. As long as the truck that they find does not follow the
        rest of the logs, such as one that skids there, these parts become longer. The last fit, whose first step is the
        largest, fits the noise model once more after that step.
        """
        problem = Problem(self.setup, self.dataset.logs, self.earlier)
        if not self.setup.settings.adapt_noise:
            return self._fit(problem, self._initial(problem), WHITE, progress)
        rows, early = EARLY_ROWS, self._early_fits(problem.shortened(EARLY_ROWS), progress)
        while len(early.objective) < len(problem):
            z = early.z
            for indices in itertools.chain(*problem.layout.initial_states):  # the parts begin later than the segments
                z[indices] = 0.0
            if problem.excess(z, early.objective) < LARGEST_EXCESS:
                return self._fit(_coloured(problem, z), z, FINAL, progress, reweighted=_coloured)
            rows *= 2
            early = self._early_fit(_coloured(problem.shortened(rows), z), z, progress)
        return self._fit(_coloured(early.objective, early.z), early.z, FINAL, progress, reweighted=_coloured)

    def _early_fits(self, problem: Problem, progress: Progress) -> Minimum[Problem]:
        """A fit that takes residuals as white and updates their variance at every step, and one with the noise model of
        these residuals.

        In the first fit, gains and delays of gyros keep their prior means, and uncertain numbers stay within
        `FIRST_RANGE`, because far from the solution they would absorb the errors of the parameters.
        """
        largest, fit = np.array([_first_range(problem, name) for name in problem.names]), self._fit
        steps, z = EARLY_ITERATIONS, self._initial(problem)
        for _ in range(NOISE_UPDATES):  # with the noise of the sensors, the residuals of the start outweigh all priors
            problem = _white(problem, z)
        first = fit(
            problem, z, WHITE, progress, tolerance=WHITE_TOLERANCE, steps=steps, reweighted=_white, largest=largest
        )
        return self._early_fit(_coloured(first.objective, first.z), first.z, progress)

    def _early_fit(self, problem: Problem, z: Array, progress: Progress) -> Minimum[Problem]:
        return self._fit(problem, z, EARLY, progress, tolerance=EARLY_TOLERANCE, steps=EARLY_ITERATIONS)

    def _fit(
        self,
        problem: Problem,
        z: Array,
        title: str,
        progress: Progress,
        *,
        tolerance: float = TOLERANCE,
        steps: int | None = None,
        reweighted: Callable[[Problem, Array, int], Problem] = lambda problem, *_: problem,
        largest: Array | float = np.inf,
    ) -> Minimum[Problem]:
        """The minimum of the cost from z.

        `steps` is the largest number, by default that of the settings. `largest` (k,) are distances of unknowns from
        their prior means; `title` is that of the progress.
        """
        mean = problem.prior.mean
        lower, upper = (np.clip(bound, mean - largest, mean + largest) for bound in problem.bounds)
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


def _diverges(minimum: Minimum[Problem]) -> bool:
    """Whether the vehicle is unstable, or nearly, in the linear range, or spins in a free run."""
    spins = not np.isfinite(minimum.model.hessian).all()
    return spins or minimum.objective.slowest_decay(minimum.z) < LEAST_DECAY


def _white(problem: Problem, z: Array, *_: int) -> Problem:
    """The problem with white noise of the variances that the residuals at z have; after every step."""
    return problem.with_residual_noise(z, autocorrelated=False)


def _coloured(problem: Problem, z: Array, accepted: int = 0) -> Problem:
    """The problem with the noise models of the residuals at z; not after the second accepted step or later."""
    return problem.with_residual_noise(z, autocorrelated=True) if accepted <= 1 else problem


def _first_range(problem: Problem, name: str) -> float:
    """Largest distance of an unknown from its prior mean in the first fit, in units of its prior.

    Of the sensor errors it estimates the offsets, and gain and delay of the steering.
    """
    if is_sensor_error(name):
        steer = is_of(name, STEER) and not is_sensor_error(name, "play")
        return np.inf if steer or is_sensor_error(name, "offset") else 0.0
    unknown = problem.unknowns_by_name.get(name)
    return FIRST_RANGE if unknown and unknown.is_uncertain else np.inf
