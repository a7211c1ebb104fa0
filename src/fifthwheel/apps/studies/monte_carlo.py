"""Monte Carlo studies: trucks, manoeuvres, sensors and estimators over seeds, as one table."""

import hashlib
import re
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from types import FunctionType

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from fifthwheel import __version__
from fifthwheel.apps.cluster import results_of
from fifthwheel.apps.studies.estimators import Estimates, Estimator, Settings, as_estimator
from fifthwheel.apps.studies.result_table import ResultTable, Row, RunName, run_rows
from fifthwheel.apps.studies.scenarios import Scenario, SimulatedRun, initial_guess, simulated, true_value
from fifthwheel.base.arguments import expect, expect_number, expect_optional
from fifthwheel.base.atomic import held
from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.formatting import percent
from fifthwheel.base.settings import Settings as ValidatedSettings
from fifthwheel.base.types import Array
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify.settings import Progress
from fifthwheel.model.plant import Sensor
from fifthwheel.truck import Vehicle, get

MOST_MISSING = 0.05
"""Fraction of the samples of a run without an estimate of a state, above which the state has no rms error: a filter
that gives up must not win."""

Guess = Callable[[Vehicle, int], Vehicle]
"""The vehicle that an estimator starts from, by the true one and the seed."""


@dataclass(frozen=True, kw_only=True)
class _Setup:
    """What the runs of a study share; sent to each process."""

    scenarios: Mapping[tuple[str, str, str], Scenario]
    estimators: Mapping[str, Estimator]
    guess: Guess
    settling_time: float
    digests: Mapping[RunName, str]


def study(
    trucks: Mapping[str, Vehicle] | Iterable[str],
    estimators: Mapping[str, Estimator | Settings],
    out: str | Path,
    *,
    manoeuvres: Mapping[str, SimulatedRun] | None = None,
    sensors: Mapping[str, Mapping[str, Sensor] | None] | None = None,
    seeds: Iterable[int] = range(20),
    guess: Guess = initial_guess,
    settling_time: float = 0.0,
    jobs: int | None = None,
    scheduler: str | None = None,
    progress: Progress = lambda *_: None,
) -> pa.Table:
    """Simulate and estimate every combination of truck, manoeuvre, sensors, estimator and seed.

    The result has a row for each run and parameter, all SI: the names of the run, parameter, unit, truth, truth_low
    and truth_high (the range of effective stiffness of nonlinear tyres, else equal), estimate, sigma, verdict,
    error (the message of a run that failed, else empty), seconds (CPU time of the estimator), and `rms.<state>`:
    the rms error of every estimated state that the model has a true value of, and that has a value in 95 % of the
    samples. A run without parameters has one row with an empty parameter. Equal arguments give equal numbers, apart
    from `seconds`.

    A run that `out` already has is not computed again, if truck, manoeuvre, sensors, estimator and version of this
    package are the same. Finished runs are kept when the study is interrupted or killed; call it again to continue.
    Runs in `out` that are not part of this study stay. The code of an own estimator is not compared: give it another
    name when it changes.

    Args:
        trucks: by name, or names of the catalogue.
        estimators: by name: settings of `identify` or of a `Learner`, or any `Estimator`.
        out: Parquet file.
        manoeuvres: by name; by default the lane changes of the linear model.
        sensors: by name; a set is by signal, None for the sensors of Cheng and Cebon (2011), which are the default.
        seeds: each draws the sensor noise and the initial values; the same in all combinations.
        guess: the vehicle that each estimator starts from; by default `initial_guess`. For estimators of states
            only, `exact_guess`.
        settling_time: time at the start of each run that the rms errors of the states leave out, s.
        jobs: processes; by default one per core. More than one needs functions at the top level of a module.
        scheduler: address of a Dask scheduler that runs the estimators instead, as of
            `fifthwheel.apps.cluster.connected`; its workers import the functions from the same modules.
        progress: called while trucks are simulated and runs end; see `fifthwheel.progress_bar`.

    Returns:
        The content of `out`.

    Raises:
        FifthwheelError: `out` is not the table of a study, another process writes to it, a worker was killed, or the
            scheduler does not answer.
        SignalError: a nonlinear manoeuvre cannot be simulated. What fails in a single run is in its row.

    Example:
        >>> import tempfile
        >>> from pathlib import Path
        >>> import fifthwheel as fw
        >>> out = Path(tempfile.mkdtemp()) / "study.parquet"
        >>> kalman = fw.StatesOf(lambda vehicle, record: fw.Observer(vehicle, record.signals))
        >>> runs = {"one lane change": fw.SimulatedRun(count=1)}
        >>> table = fw.study(["cheng_cebon_2011"], {"Kalman": kalman}, out, manoeuvres=runs, seeds=[0, 1], jobs=1)
        >>> table["seed"].to_pylist()
        [0, 1]
    """
    expect("estimators", estimators, Mapping)
    expect_optional("manoeuvres", manoeuvres, Mapping)
    expect_optional("sensors", sensors, Mapping)
    expect("trucks", trucks, Mapping, list, tuple)
    expect("seeds", seeds, Iterable)
    path, seeds = Path(out), list(seeds)
    if not seeds:
        raise FifthwheelError("seeds: expected at least one, got none; give range(20)")
    for seed in seeds:
        expect_number("seeds", seed, ge=0, whole=True)
    vehicles = dict(trucks) if isinstance(trucks, Mapping) else {name: get(name) for name in trucks}
    methods = {name: as_estimator(given) for name, given in estimators.items()}
    runs = manoeuvres or {"lane_changes": SimulatedRun()}
    fitted = sensors or {"article": None}
    for label, fitting in fitted.items():
        for signal, sensor in (fitting or {}).items():
            expect(f"sensors, {label}, {signal}", sensor, Sensor)
    if jobs is not None:
        expect_number("jobs", jobs, ge=1, whole=True)
    rule = (guess, settling_time)
    described = {
        (truck, run, sensor, method): _digest(vehicles[truck], runs[run], fitted[sensor], methods[method], *rule)
        for truck in vehicles
        for run in runs
        for sensor in fitted
        for method in methods
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    with held(path.with_name(path.name + ".lock"), subject=path):
        results = ResultTable(path)
        digests = {RunName(*names, seed): digest for names, digest in described.items() for seed in seeds}
        todo = [name for name, digest in digests.items() if not results.done(name, digest)]
        try:
            if todo:
                scenarios = _simulate(todo, vehicles, runs, fitted, progress)
                setup = _Setup(
                    scenarios=scenarios, estimators=methods, guess=guess, settling_time=settling_time, digests=digests
                )
                for k, (name, rows) in enumerate(
                    results_of(_run, setup, todo, jobs=jobs, scheduler=scheduler), start=1
                ):
                    results.add(name, rows)
                    progress("estimating", k, len(todo))
        finally:
            results.save()
        return results.table()


def _simulate(
    todo: Iterable[RunName],
    vehicles: Mapping[str, Vehicle],
    runs: Mapping[str, SimulatedRun],
    fitted: Mapping[str, Mapping[str, Sensor] | None],
    progress: Progress,
) -> dict[tuple[str, str, str], Scenario]:
    """The scenarios of some runs; each truck is driven once through each manoeuvre."""
    driven: dict[tuple[str, str], Scenario] = {}
    pairs = list(dict.fromkeys((name.truck, name.manoeuvre) for name in todo))
    for k, (truck, run) in enumerate(pairs):
        progress("simulating", k, len(pairs))
        driven[truck, run] = simulated(vehicles[truck], runs[run])
    return {
        (name.truck, name.manoeuvre, name.sensors): replace(
            driven[name.truck, name.manoeuvre], sensors=fitted[name.sensors]
        )
        for name in todo
    }


def _run(setup: _Setup, name: RunName) -> list[Row]:
    """The rows of one run."""
    scenario = setup.scenarios[name.truck, name.manoeuvre, name.sensors]
    base = {**name._asdict(), "digest": setup.digests[name]}
    start = time.process_time()
    try:
        record = scenario.record(name.seed)
        given = setup.guess(scenario.vehicle, name.seed)
        start = time.process_time()
        estimates = setup.estimators[name.estimator](replace(record, reference={}), given)
        expect(f"{name.estimator}, result", estimates, Estimates)
    except Exception as error:  # of an estimator that may be anyone's; the other runs go on
        text = str(error) if isinstance(error, FifthwheelError) else f"{type(error).__name__}: {error}"
        return [base | {"parameter": "", "error": text, "seconds": time.process_time() - start}]
    seconds = time.process_time() - start
    truth = partial(true_value, scenario.vehicle, scenario.stiffness)
    settled = record.time >= record.time[0] + setup.settling_time
    states, faults = _rms_errors(record, estimates.states, settled)
    return run_rows(base | {"error": faults, "seconds": seconds}, estimates.parameters, truth, states)


def _rms_errors(
    record: Record, estimated: Mapping[str, Array], settled: NDArray[np.bool_]
) -> tuple[dict[str, float], str]:
    """The rms error of each state over the settled samples (N,) with a reference, and what is wrong with the others: a
    state that is missing in too many of these samples has no rms."""
    states, errors = {}, []
    for name, values in estimated.items():
        if name not in record.reference:
            continue
        if np.shape(values) != np.shape(record.time):
            errors.append(f"{name}: expected {len(record)} values, one for each sample, got {np.shape(values)}")
            continue
        off = (np.asarray(values) - record.reference[name])[settled & np.isfinite(record.reference[name])]
        missing = 1.0 - float(np.isfinite(off).mean()) if off.size else 1.0
        if missing > MOST_MISSING:
            errors.append(f"{name}: no estimate in {percent(missing)} of the samples")
        else:
            states[name] = float(np.sqrt(np.nanmean(off**2)))
    return states, "; ".join(errors)


def _digest(*parts: object) -> str:
    """Digest of everything that determines a result, by the texts of the objects."""
    text = "\n".join([__version__, *(_text(part) for part in parts)])
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _text(part: object) -> str:
    """A text that differs for objects of different content, without addresses in memory."""
    name = f"{getattr(part, '__module__', '')}.{getattr(part, '__qualname__', type(part).__qualname__)}"
    if isinstance(part, FunctionType | type):
        return name
    if isinstance(part, Vehicle):
        return name + part.model_dump_json()
    settings, default = getattr(part, "settings", None), type(part).__repr__ is object.__repr__
    name += str(settings.as_dict()) if isinstance(settings, ValidatedSettings) else ""
    return name + re.sub(
        r" at 0x[0-9a-f]+", "", repr(vars(part)) if default and hasattr(part, "__dict__") else repr(part)
    )
