"""The results of every run of the reproduction as tables: parameters.parquet and histories.parquet."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import NamedTuple

import pyarrow as pa

from fifthwheel._types import Array
from fifthwheel.cheng_cebon_2011.experiments import Experiment
from fifthwheel.cheng_cebon_2011.outcomes import Outcome
from fifthwheel.studies.result_table import Row, RunName, as_table, run_rows
from fifthwheel.studies.scenarios import true_value


class _Estimate(NamedTuple):
    """A parameter of an outcome."""

    name: str
    value: float
    sigma: float | None
    verdict: str


def parameters(experiments: Mapping[str, Experiment], outcomes: Sequence[Outcome]) -> pa.Table:
    """A row for each experiment, arm, seed and parameter, with the columns of `study`.

    `manoeuvre` is the experiment or variant, `estimator` the arm. truth_low and truth_high are the range of effective
    stiffness.
    """
    rows: list[Row] = []
    for outcome in outcomes:
        experiment = experiments[outcome.experiment]
        estimates = [_Estimate(n, v, outcome.sigmas[n], outcome.verdicts[n]) for n, v in outcome.values.items()]
        truth = partial(true_value, experiment.run.vehicle, experiment.stiffness)
        name = RunName(experiment.run.vehicle.name, outcome.experiment, "article", outcome.arm, outcome.seed)
        rows += run_rows(name._asdict() | {"error": ""}, estimates, truth, outcome.rms)
    return as_table(rows).drop_columns(["seconds", "digest"])


def histories(experiments: Mapping[str, Experiment], outcomes: Sequence[Outcome]) -> pa.Table:
    """Parameters and states over time of the outcomes that have histories: experiment, arm, seed, name, time (s),
    estimate and, for a state, truth (SI)."""
    tables = []
    for outcome in outcomes:
        truth = experiments[outcome.experiment].run.truth
        time = outcome.states.get("time")
        series: dict[str, tuple[Array, Array, Array | None]] = {
            name: (*history, None) for name, history in outcome.histories.items()
        }
        if time is not None:
            states = {name: values for name, values in outcome.states.items() if name != "time"}
            series |= {name: (time, values, truth[name]) for name, values in states.items()}
        for name, (instants, values, true) in series.items():
            n = len(instants)
            tables.append(
                pa.table(
                    {
                        "experiment": pa.array([outcome.experiment] * n).dictionary_encode(),
                        "arm": pa.array([outcome.arm] * n).dictionary_encode(),
                        "seed": pa.array([outcome.seed] * n, pa.int64()),
                        "name": pa.array([name] * n).dictionary_encode(),
                        "time": pa.array(instants, pa.float64()),
                        "estimate": pa.array(values, pa.float64()),
                        "truth": pa.nulls(n, pa.float64()) if true is None else pa.array(true, pa.float64()),
                    }
                )
            )
    return pa.concat_tables(tables).unify_dictionaries() if tables else pa.table({})
