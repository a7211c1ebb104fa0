"""Coverage of the 90 % intervals of parameters and states with random errors of vehicle file and sensors.

Each seed draws the errors of the vehicle file from `truck.uncertainty.changes` and from the priors of the uncertain
parameters, and the errors of the sensors, the latency of the gyros and the bank from the priors of `OneStage`. The
linear truck has the speed and the steer angle of a run of the nonlinear truck.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from itertools import product
from typing import Literal

import numpy as np

from fifthwheel.apps.studies.scenarios import initial_guess
from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.names import ParameterPath
from fifthwheel.base.types import Array
from fifthwheel.data.record import Record
from fifthwheel.data.record.derived import article_gyro_variance
from fifthwheel.estimate.filters.initial_state import steady_initial_state
from fifthwheel.estimate.identify import Identification, OneStage, identify
from fifthwheel.estimate.identify.sensor_errors import log_sensors
from fifthwheel.estimate.identify.statement import prior_of
from fifthwheel.estimate.identify.unknowns.parameters import stage_1_names
from fifthwheel.estimate.observe import Observer, ObserverSettings, Uncertainty
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics.simulation import free_response
from fifthwheel.model.plant import PlantRun, Sensor, measure
from fifthwheel.truck import Vehicle
from fifthwheel.truck.quantities import FRICTION, quantity_of
from fifthwheel.truck.uncertainty import changes
from trust_runs import (
    RUNS,
    TRUCK,
    Changes,
    Range,
    driven,
    exact_values,
    peak_friction,
    sensor_sigma,
    table,
    true_ranges,
)

UNITS = ("tractor", "semitrailer")
GYROS = article_gyro_variance(UNITS)
STATES = tuple(f"{quantity}.{unit}" for quantity in ("sideslip", "roll") for unit in UNITS)
SPEED, STEER = "speed", "steer.tractor.front"
IDENTIFIED, UNSEEN, ON_LINE, FILE_ONLY = ", identified log", ", unseen log", ", on-line", ", vehicle file only"
"""Where the knowledge of the observer comes from; the last two observe the unseen log sample by sample."""
UNSEEN_SEEDS = 1_000_000
"""Added to the seed of a log for that of the unseen log, which has its own offsets and bank."""
INTERVAL = 1.645
"""Half width of a 90 % interval, in standard deviations."""


@dataclass(frozen=True, kw_only=True)
class Draw:
    """One seed of one run."""

    run: str
    nonlinear: bool
    seed: int
    duration: float
    """Of everyday driving, s."""
    changes: Changes = ()
    """Of the nonlinear truck and its road."""
    tyres: Literal["linear", "saturating", "auto"] = "linear"
    """Of the identification."""


@dataclass(frozen=True, kw_only=True)
class Sample:
    """Error and sigma of one quantity: a number of an estimate, or one value for each sample of a state."""

    error: Array
    sigma: Array
    converged: bool = True


def drawn_file(truck: Vehicle, rng: np.random.Generator) -> Vehicle:
    """The truck with errors of all numbers of its file that are not estimated."""
    values = truck.parameters()
    for change in changes(truck):
        z = rng.normal()
        for path, slope in change.slopes.items():
            values[path] += z * slope
    estimated = {*stage_1_names(truck), "semitrailer.payload.height", *truck.stated}
    for path, value in values.items():
        row, parsed = quantity_of(path), ParameterPath.of(path)
        is_trailer_body = (parsed.unit, parsed.component) == ("semitrailer", "sprung")
        if row.is_uncertain and value > 0 and not is_trailer_body and path not in estimated:
            values[path] = value * math.exp(row.sigma * rng.normal())
    return truck.replace(values)


def true_signals(draw: Draw, bank: float) -> tuple[Array, Mapping[str, Array]]:
    """Time (N,) and true signals and states (N,) each of a run on a banked road; bank in rad."""
    run = driven(draw.run, draw.seed, draw.duration, (*draw.changes, ("bank", bank)) if draw.nonlinear else ())
    return (run.time, run.truth) if draw.nonlinear else linear_signals(run, bank)


def linear_signals(run: PlantRun, bank: float, truck: Vehicle = TRUCK) -> tuple[Array, Mapping[str, Array]]:
    """The same of a linear truck, each unit of which brakes its own mass, with the inputs of a run of the nonlinear
    one."""
    inputs, outputs = {name: run.truth[name] for name in (SPEED, STEER)}, (*GYROS, *STATES)
    truck = truck.with_logged_steering(inputs, run.name)
    inputs |= {dynamics.SPEED_RATE: np.gradient(inputs[SPEED], run.time)}
    model = dynamics.model(truck, outputs, roll=True, bank=True, braking=True)
    first = {name: float(values[0]) for name, values in inputs.items()}
    start = np.append(steady_initial_state(truck, first, {}, roll=True, bank=bank)[0], bank)
    _, y = free_response(model, dynamics.all_parameters(truck, outputs), run.time, inputs, start)
    return run.time, {SPEED: inputs[SPEED], STEER: inputs[STEER]} | {name: y[:, i] for i, name in enumerate(outputs)}


def drawn_errors(settings: OneStage, rng: np.random.Generator) -> dict[str, float]:
    """Bank of the road and errors of all sensors of one log, SI."""
    return shared_errors(settings, rng) | log_errors(settings, rng)


def shared_errors(settings: OneStage, rng: np.random.Generator) -> dict[str, float]:
    """Errors of the sensors that all logs share, SI."""
    names = [f"{STEER}.{kind}" for kind in ("gain", "delay")]
    names += [f"{gyro}.{kind}" for gyro in GYROS for kind in ("misalignment", "delay", "gain")]
    return {name: name.endswith("gain") + sensor_sigma(name, settings) * rng.normal() for name in names}


def log_errors(settings: OneStage, rng: np.random.Generator) -> dict[str, float]:
    """Bank of the road and offsets of the sensors in one log, SI."""
    offsets = [f"{signal}.offset" for signal in (STEER, *GYROS)]
    bank = prior_of(settings.given, "road.bank")[1] * rng.normal()
    return {"bank": bank} | {name: sensor_sigma(name, settings) * rng.normal() for name in offsets}


def drawn_record(draw: Draw, errors: Mapping[str, float], name: str) -> Record:
    """The log of a draw with errors of all sensors and the true states as reference."""
    return measured_record(*true_signals(draw, errors["bank"]), errors, name, draw.seed)


def measured_record(
    time: Array, truth: Mapping[str, Array], errors: Mapping[str, float], name: str, seed: int
) -> Record:
    """A log of true signals with errors of all sensors, and the true states as reference."""
    measured: dict[str, Array] = {SPEED: truth[SPEED]}
    late = np.interp(time - errors[f"{STEER}.delay"], time, truth[STEER])
    measured[STEER] = late / errors[f"{STEER}.gain"] + errors[f"{STEER}.offset"]
    for gyro in GYROS:
        other = gyro.replace("yaw", "roll") if gyro.startswith("yaw") else gyro.replace("roll", "yaw")
        angle = errors[f"{gyro}.misalignment"] * (1 if gyro.startswith("yaw") else -1)
        values = math.cos(angle) * truth[gyro] + math.sin(angle) * truth[other]
        values = np.interp(time - errors[f"{gyro}.delay"], time, values)
        measured[gyro] = errors[f"{gyro}.gain"] * values + errors[f"{gyro}.offset"]
    sensors = {name: Sensor(variance=GYROS.get(name, 0.0)) for name in measured}
    signals = measure(time, measured, sensors, seed=seed)
    return Record(time=time, signals=signals, reference={name: truth[name] for name in STATES}, name=name)


def samples(draw: Draw) -> dict[str, Sample]:
    """Errors and sigmas of all estimates and states by name, as fractions and in rad; empty if the log is refused."""
    settings, rng = OneStage(tyres=draw.tyres), np.random.default_rng([draw.seed, 17])
    file = drawn_file(TRUCK, rng)
    errors = drawn_errors(settings, rng)
    of_log = {key: x for key, x in drawn_errors(settings, rng).items() if key == "bank" or key.endswith(".offset")}
    record = drawn_record(draw, errors, "log")
    unseen = drawn_record(replace(draw, seed=draw.seed + UNSEEN_SEEDS), {**errors, **of_log}, "unseen log")
    try:
        result = identify([record], initial_guess(file, draw.seed), settings)
    except FifthwheelError:
        return {}
    softening = draw.nonlinear and result.friction is None
    ranges = true_ranges((draw.changes,)) if softening else exact_values()
    ranges |= {FRICTION: peak_friction(draw.changes)}
    return dict(estimate_samples(result, ranges)) | dict(state_samples(result, file, record, unseen))


def estimate_samples(result: Identification, ranges: Mapping[str, Range]) -> Iterator[tuple[str, Sample]]:
    for e in (*result.parameters, *result.derived):
        nearest = float(np.clip(e.value, *ranges[e.name]))
        error, sigma = np.array([e.value / nearest - 1]), np.array([(e.sigma or 0.0) / nearest])
        yield e.name, Sample(error=error, sigma=sigma, converged=e.verdict == "converged")


def state_samples(
    result: Identification, file: Vehicle, record: Record, unseen: Record
) -> Iterator[tuple[str, Sample]]:
    """States as `fifthwheel identify`, `fifthwheel states -i` on another log and `Observer` estimate them."""
    sensors = log_sensors(result, unseen, result.vehicle)
    new = ObserverSettings(**sensors.settings)
    observers = {
        IDENTIFIED: (record, result.observer(log=record.name), result.uncertainty(record.name)),
        UNSEEN: (unseen, Observer(result.vehicle, unseen.signals, new), sensors.uncertainty),
        ON_LINE: (unseen, result.observer(), None),
        FILE_ONLY: (unseen, Observer(file, unseen.signals), None),
    }
    return observed_samples(observers)


def observed_samples(
    observers: Mapping[str, tuple[Record, Observer, Uncertainty | None]],
) -> Iterator[tuple[str, Sample]]:
    """Errors and sigmas of the states of logs with their observers, by the suffix of the names."""
    for suffix, (log, observer, uncertainty) in observers.items():
        states = observer.batch(log, uncertainty)
        for name in STATES:
            error = states.values[name] - log.reference[name]
            present = np.isfinite(error)
            yield name + suffix, Sample(error=error[present], sigma=states.sigma[name][present])


def row(name: str, of_seeds: Sequence[Sample]) -> tuple[str, ...]:
    """Converged, coverage, mean and rms error, mean sigma and its ratio to the rms error; of states in degrees."""
    error, sigma = (np.concatenate([getattr(s, key) for s in of_seeds]) for key in ("error", "sigma"))
    scale = math.degrees(1) if name.endswith((IDENTIFIED, UNSEEN, ON_LINE, FILE_ONLY)) else 100.0
    rms, mean_sigma = float(np.sqrt(np.mean(error**2))), float(np.mean(sigma))
    numbers = [f"{scale * x:.3g}" for x in (np.mean(error), rms, mean_sigma)]
    converged = np.mean([s.converged for s in of_seeds])
    covered = np.mean(np.abs(error) <= INTERVAL * sigma)
    return name, f"{converged:.0%}", f"{covered:.0%}", *numbers, f"{mean_sigma / max(rms, 1e-12):.2f}"


def coverage_tables(runs: Sequence[str], seeds: Sequence[int], jobs: int, duration: float) -> list[str]:
    """Coverage of all estimates and states on the linear and the nonlinear truck, as lines of Markdown."""
    heads = ("", "converged", "coverage", "mean error", "rms error", "mean sigma", "sigma / rms error")
    lines: list[str] = []
    with ProcessPoolExecutor(jobs) as pool:
        for run, nonlinear in product(runs, (False, True)):
            draws = [Draw(run=run, nonlinear=nonlinear, seed=seed, duration=duration) for seed in seeds]
            results = []
            for i, result in enumerate(pool.map(samples, draws), 1):
                results += [result] if result else []
                print(f"[{i}/{len(draws)}] coverage, {run}, {'nonlinear' if nonlinear else 'linear'}", flush=True)
            title = f"{RUNS[run]}, {'nonlinear' if nonlinear else 'linear'} truck"
            lines += [f"## Coverage: {title}", "", f"{len(results)} of {len(draws)} logs; the others are refused."]
            lines += ["Estimates in per cent of the true value, states in degrees. Nominal coverage: 90 %.", ""]
            names = results[0] if results else {}
            lines += [*table(heads, [row(name, [result[name] for result in results]) for name in names]), ""]
    return lines
