"""Identification in one stage: all unknowns together, over complete logs.

    logs, vehicle -> maximum of the posterior by Gauss-Newton steps on exact derivatives (problem.py, gauss_newton.py)
                  -> covariance that allows for model error (posterior.py), a verdict for each parameter (verdict.py)
                  -> identified vehicle

The article needs two stages and more than ten lane changes. One stage needs one lane change: it linearises about the
estimate and not about the initial values, every sample informs all parameters, and parameters that are uncertain in the
vehicle file are treated as uncertain.
"""

import functools
import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fifthwheel._types import Array
from fifthwheel.channels import STEER, is_of, is_sensor_error
from fifthwheel.errors import VehicleError
from fifthwheel.identify.dataset import Dataset, prepare_dataset
from fifthwheel.identify.one_stage.gauss_newton import Minimum, minimise
from fifthwheel.identify.one_stage.identification import build_identification
from fifthwheel.identify.one_stage.posterior import Posterior, without
from fifthwheel.identify.one_stage.problem import Directions, Problem
from fifthwheel.identify.one_stage.solution import Solution
from fifthwheel.identify.one_stage.tyre_choice import choose, softening_seen
from fifthwheel.identify.result import Identification
from fifthwheel.identify.settings import OneStage, Progress
from fifthwheel.identify.setup import Setup
from fifthwheel.identify.verdict import Verdict, uninformed_parameters
from fifthwheel.record import Record
from fifthwheel.units import STANDARD_GRAVITY
from fifthwheel.vehicle import Vehicle
from fifthwheel.vehicle.parameters import FRICTION

TITLE = "fit with estimated noise"
"""Of the progress."""
WHITE_TOLERANCE = 1.0
"""Of the first fit, which takes residuals as white: its sigmas are too small, and other fits follow."""
ROUND_TOLERANCES = (0.3, 0.02)
"""Of the fits with a noise model; each takes the noise from the residuals of the one before. The prediction-error form
has the last one only."""
EARLY_ITERATIONS = 25
"""Largest number of steps of every fit but the last."""
EARLY_SAMPLES = 12_000
"""Of longer logs, every fit but the last uses about this number of samples: of each segment, the most steered part."""
GRIP_MARGIN = 2.0
"""Friction at the start of the search over that which the lateral acceleration needs."""


def identify_one_stage(
    records: Sequence[Record],
    vehicle: Vehicle,
    settings: OneStage,
    *,
    validate: Sequence[Record] = (),
    progress: Progress = lambda *_: None,
) -> Identification:
    """Identify a vehicle in one stage; arguments and errors as in `identify`."""
    if settings.tyres == "auto":
        return _with_chosen_tyres(records, vehicle, settings, validate, progress)
    solution = solve_one_stage(records, vehicle, settings, validate=validate, progress=progress)
    return build_identification(solution)


def _with_chosen_tyres(
    records: Sequence[Record], vehicle: Vehicle, settings: OneStage, validate: Sequence[Record], progress: Progress
) -> Identification:
    """The identification with the law of the tyres that the logs support."""
    linear, saturating = (replace(settings, tyres=tyres) for tyres in ("linear", "saturating"))
    first = solve_one_stage(records, vehicle, linear, validate=validate, progress=progress)
    if not (reason := softening_seen(first)):
        return build_identification(first)
    try:
        second = solve_one_stage(records, vehicle, saturating, validate=validate, progress=progress, start=first)
    except VehicleError as error:  # the loads of the axles are unknown
        return build_identification(first, f"tyres: linear, although {reason}. {error}")
    return build_identification(*choose(first, second, reason))


def solve_one_stage(
    records: Sequence[Record],
    vehicle: Vehicle,
    settings: OneStage,
    *,
    validate: Sequence[Record] = (),
    progress: Progress = lambda *_: None,
    start: Solution | None = None,
) -> Solution:
    """The maximum of the posterior; arguments and errors as in `identify`.

    Args:
        start: solution with linear tyres, at which the search with tyres that saturate begins; it is found if it is not
            given. At the prior mean a steering offset may let such tyres skid.
    """
    if settings.tyre_law == "saturating" and start is None:
        linear = replace(settings, tyres="linear")
        start = solve_one_stage(records, vehicle, linear, progress=progress)
    dataset = prepare_dataset(records, vehicle, settings, validate)
    setup = Setup.of(dataset.vehicle, dataset.outputs, settings)
    if not setup.estimated and not settings.nuisances:
        raise VehicleError(
            "fixed: every parameter is fixed and no sensor error is estimated, so nothing is left to estimate; "
            "leave one parameter free, or estimate the sensor errors (nuisances)"
        )
    time_bases = {name: base for record in dataset.records for name, base in record.time_bases.items()}
    estimator = _Estimator(
        dataset=dataset,
        setup=setup.with_time_bases(time_bases),
        start=_start_of_saturating(start) if start else {},
    )
    return estimator.solve(progress)


def _start_of_saturating(linear: Solution) -> dict[str, float]:
    """Where the search with tyres that saturate begins, in units of the priors.

    At the solution with linear tyres, and at a friction that is large enough for the lateral accelerations of the logs.
    """
    settings = linear.settings
    needed = GRIP_MARGIN * max(linear.lateral_accelerations, default=0.0) / STANDARD_GRAVITY
    friction = float(np.log(max(needed, settings.friction) / settings.friction)) / settings.friction_prior
    return dict(zip(linear.problem.names, linear.minimum.z.tolist(), strict=True)) | {FRICTION: friction}


@dataclass(frozen=True, kw_only=True)
class _Estimator:
    """What stays the same during one identification."""

    dataset: Dataset
    setup: Setup
    start: Mapping[str, float]
    """Where the search begins, in units of the priors; 0 for other unknowns."""

    def solve(self, progress: Progress) -> Solution:
        """Estimate all unknowns, again and again until the set of uninformed parameters no longer changes.

        The first set is that at the initial values, by part of long logs; it is empty if that vehicle is unstable.
        After the first estimation a parameter may leave it; from then on the set only grows.
        """
        problem = Problem(self.setup, self.dataset.logs)
        initial, early = self._initial(problem), problem.shortened(EARLY_SAMPLES)
        uninformed = {} if initial.any() else self._uninformed(early, initial, noise_only=True)
        for attempt in itertools.count():
            minimum = self._minimise(Problem(self.setup.considering(uninformed), problem.logs), progress)
            problem = minimum.objective
            latest = self._uninformed(problem, minimum.z)
            if attempt:
                latest = uninformed | latest
            if set(latest) == set(uninformed):
                break
            uninformed = latest
        return Solution(
            dataset=self.dataset,
            minimum=minimum,
            uninformed=latest,
        )

    def _uninformed(self, problem: Problem, z: Array, *, noise_only: bool = False) -> dict[str, Verdict]:
        """Estimated parameters that the logs do not determine, by the information that the inputs excite.

        The estimated initial states are set to their prior means: along them the noise of the sensors would look like
        excitation.

        Args:
            noise_only: without the effect of the considered unknowns. Far from the solution the vehicle may be close
                to instability, and that effect then says nothing about the logs.
        """
        excited_by_inputs = z.copy()
        for segments in problem.layout.initial_states:
            for indices in segments:
                excited_by_inputs[indices] = 0.0
        directions: Directions = "learned" if noise_only else "all"
        information = problem.expand(excited_by_inputs, directions=directions).hessian - np.eye(len(z))
        considered = [name for name in problem.considered if name not in self.setup.estimated]
        omitted = considered if noise_only else []
        information = without(information, [*problem.suspects, *map(problem.names.index, omitted)])
        posterior = Posterior.from_information(
            problem.names, information, considered=considered, nuisances=problem.nuisances
        )
        setup = self.setup
        return uninformed_parameters(posterior, setup.estimated, setup.without_roll_rate, setup.settings.excited)

    def _initial(self, problem: Problem) -> Array:
        """The start, usually the prior means; stiffer tyres behind the first group if that vehicle is unstable."""
        return problem.stiffened(np.clip([self.start.get(name, 0.0) for name in problem.names], *problem.bounds))

    def _minimise(self, problem: Problem, progress: Progress) -> Minimum[Problem]:
        """The maximum of the posterior.

        With adapted noise in several fits: the first takes residuals as white and updates the noise at every step, and
        gains and delays of gyros keep their prior means, because far from the solution they would absorb the errors of
        the parameters; each of the others fits the noise model to the residuals of the fit before, and keeps it.
        """
        z, tolerances = self._initial(problem), ROUND_TOLERANCES if problem.output_error else ROUND_TOLERANCES[-1:]
        if not self.setup.settings.adapt_noise:
            return self._fit(problem, z, "fit", progress)
        late = np.array([is_sensor_error(name) and not _is_early(name) for name in problem.names])
        first = problem.shortened(EARLY_SAMPLES)
        early = self._fit(first, z, "fit", progress, tolerance=WHITE_TOLERANCE, reweighted=_white, fixed=late)
        for tolerance in tolerances[:-1]:
            corrected = early.objective.with_residual_noise(early.z, autocorrelated=True)
            early = self._fit(corrected, early.z, TITLE, progress, tolerance=tolerance)
        z = early.z
        if first is problem:
            problem = early.objective
        else:  # the parts begin later than the segments
            for indices in itertools.chain(*problem.layout.initial_states):
                z[indices] = 0.0
        return self._fit(problem.with_residual_noise(z, autocorrelated=True), z, TITLE, progress)

    def _fit(
        self,
        problem: Problem,
        z: Array,
        title: str,
        progress: Progress,
        *,
        tolerance: float = ROUND_TOLERANCES[-1],
        reweighted: Callable[[Problem, Array], Problem] = lambda problem, _: problem,
        fixed: NDArray[np.bool_] | None = None,
    ) -> Minimum[Problem]:
        """The minimum of the cost from z.

        A tolerance above that of the last fit limits the number of steps. `fixed` (k,) are unknowns that keep their
        prior mean; `title` is that of the progress.
        """
        lower, upper = (bound if fixed is None else np.where(fixed, 0.0, bound) for bound in problem.bounds)
        iterations = self.setup.settings.iterations
        minimum = minimise(
            problem,
            z,
            lower=lower,
            upper=upper,
            iterations=EARLY_ITERATIONS if tolerance > ROUND_TOLERANCES[-1] else iterations,
            tolerance=tolerance,
            reweighted=reweighted,
            progress=functools.partial(progress, title),
        )
        progress(title, iterations, iterations)
        return minimum


def _white(problem: Problem, z: Array) -> Problem:
    """The problem with white noise of the variances that the residuals at z have."""
    return problem.with_residual_noise(z, autocorrelated=False)


def _is_early(name: str) -> bool:
    """Whether a sensor error is estimated from the first fit on: offsets, and gain and delay of the steering."""
    steer = is_of(name, STEER)
    return is_sensor_error(name, "offset") or (steer and not is_sensor_error(name, "play"))
