"""The generated part of a learner in C: its symbolic functions, names and sizes for its header, numbers and tables."""

import math
import zlib
from collections.abc import Sequence
from typing import NamedTuple

import casadi as ca
import numpy as np

from fifthwheel.base.errors import SignalError
from fifthwheel.base.native import c_code
from fifthwheel.base.native.c_code import by_rows
from fifthwheel.base.native.c_code import step as symbolic
from fifthwheel.base.types import Array
from fifthwheel.estimate.filters.joint import (
    MAX_STATE,
    bounds,
    linearise,
    reported_values,
)
from fifthwheel.estimate.filters.kalman import transition_matrix
from fifthwheel.estimate.filters.model import pack_array, sizes
from fifthwheel.estimate.filters.scaling import PRECISION
from fifthwheel.estimate.filters.step_rows import SMALLEST_PLAY
from fifthwheel.estimate.identify import doubts
from fifthwheel.estimate.identify.estimates import sensor_error_unit
from fifthwheel.estimate.identify.unknowns.parameters import lacks_roll_rate
from fifthwheel.estimate.identify.unknowns.unknown import (
    GrossError,
    Unknown,
    gross_error,
    largest_possible,
)
from fifthwheel.estimate.observe.monitor import CHANCE, START, normalised_monitor
from fifthwheel.estimate.online import Learner
from fifthwheel.estimate.online.learned import least_change
from fifthwheel.estimate.online.live_filter import AVERAGING_TIME, WINDOWS, LiveFilter
from fifthwheel.estimate.online.online_model import Excitation
from fifthwheel.estimate.online.start import SteadyEquations, discrepancy_variances, steady_equations
from fifthwheel.model.dynamics.chain import state_names
from fifthwheel.results.export import c_text
from fifthwheel.results.export.c_text import definitions, integers, stream_definitions, stream_tables, table, texts
from fifthwheel.truck.quantities import unit_of

LARGEST_GATE = 1e15
"""Limit of a squared gate, so that it fits into single precision."""
NO_CHANNEL, ABSENT_CHANNEL = -1, -2
"""In place of the index of a channel: none is needed; it is not measured."""


class SparseLinearisation(NamedTuple):
    """The functions of a step, whose derivatives are stored without their zeros."""

    function: ca.Function
    places: Array  # of each stored derivative in V by columns (n_x, n_p)
    transform: ca.Function
    """(F, column) -> F times the column."""


def linearisation(live: LiveFilter) -> SparseLinearisation:
    """(state, z, [dt, d]) -> (state after dt, F, slopes at both ends of the step, predictions, H by rows, direct by
    rows); see `linearise`. F and the slopes are stored without zeros."""
    setup, scaling = live.setup, live.setup.scaling
    n_x, n_d, *_ = sizes(live.model)
    x, z, step = ca.SX.sym("x", n_x), ca.SX.sym("z", len(setup.estimated_unknowns)), ca.SX.sym("step", 1 + n_d)
    given = _numbers(live.filter.c, scaling.centre, scaling.scale)
    later, parts, slopes, predicted, H, direct = linearise(
        live.model, scaling.logarithmic, x, z, step[0], step[1:], *given
    )
    F = ca.sparsify(transition_matrix(live.model, parts))
    pattern = (slopes[0].sparsity() + slopes[1].sparsity()).T.T
    first, last = (ca.project(slope, pattern).nz[:] for slope in slopes)
    results = [later, F.nz[:], first, last, predicted, by_rows(H), by_rows(direct)]
    function = symbolic("linearise", [x, z, step], results)
    rows, columns = pattern.get_triplet()
    f, column = ca.SX.sym("f", F.sparsity()), ca.SX.sym("in", n_x)
    transform = symbolic("transform", [f.nz[:], column], [f @ column])
    return SparseLinearisation(function, np.array(rows) + n_x * np.array(columns), transform)


def health(live: LiveFilter) -> ca.Function:
    """(carry, [dt, inputs at the last sample, inputs now, innovations, weights]) -> (carry, [settling, NIS, restart]);
    see `monitor.normalised_monitor`."""
    inputs, channels = live.setup.inputs, len(live.setup.outputs)
    carry, sample = ca.SX.sym("carry", len(START)), ca.SX.sym("sample", 1 + 2 * len(inputs) + 2 * channels)
    (constant,) = _numbers(np.minimum(live.monitor.constant, LARGEST_GATE))
    results = normalised_monitor(inputs, channels).call([carry, sample, constant])
    return symbolic("health", [carry, sample], results)


def report(live: LiveFilter) -> tuple[ca.Function, ca.Sparsity]:
    """(state of the vehicle, z, d) -> (reported states, their derivatives by rows without zeros), and where these are
    in the transposed matrix; see `reported_values`."""
    view, scaling = live.view, live.setup.scaling
    n_x, n_d, *_ = sizes(view.report)
    x, z, d = ca.SX.sym("x", n_x), ca.SX.sym("z", len(live.setup.estimated_unknowns)), ca.SX.sym("d", n_d)
    numbers = _numbers(view.c, scaling.centre, scaling.scale)
    values, slopes = reported_values(view.report, scaling.logarithmic, x, z, d, *numbers)
    by_columns = ca.sparsify(slopes.T)
    return symbolic("report", [x, z, d], [values, by_columns.nz[:]]), by_columns.sparsity()


def start_matrices(live: LiveFilter) -> ca.Function:
    """(inputs, values of the unknowns) -> (A by rows, first column of B, effects of inputs and bank on x')."""
    inputs, p, _, steady = _steady(live)
    results = [by_rows(steady.A), steady.B[:, 0], steady.B @ steady.steer, steady.bank]
    return symbolic("start_matrices", [inputs, p], results)


def start_slopes(live: LiveFilter) -> ca.Function:
    """(inputs, values of the unknowns, x) -> (F by rows, derivatives of F x + G d with respect to them by rows)."""
    inputs, p, x, steady = _steady(live)
    return symbolic("start_slopes", [inputs, p, x], [by_rows(steady.F), by_rows(steady.slopes)])


def _steady(live: LiveFilter) -> tuple[ca.SX, ca.SX, ca.SX, SteadyEquations]:
    """Symbols of inputs, values of the unknowns and state, and the equations of the steady state."""
    setup = live.setup
    inputs, p = ca.SX.sym("inputs", len(setup.inputs)), ca.SX.sym("p", len(setup.unknowns))
    x = ca.SX.sym("x", len(state_names(setup.vehicle, roll=True)))
    return inputs, p, x, steady_equations(live.model, inputs, x, p, *_numbers(live.filter.c))


def _numbers(*values: Array) -> list[ca.SX]:
    return [ca.SX(ca.DM(value)) for value in values]


def reported(learner: Learner) -> list[Unknown]:
    """The unknowns whose estimates C code can read: the estimated ones, then parameters that are not identifiable."""
    setup = learner.live.setup
    estimated = (u for u in setup.estimated_unknowns if u.is_sensor_error or u.is_of_truck)
    return [*estimated, *(u for u in setup.considered_unknowns if u.name in setup.estimated)]


def texts_of(learner: Learner) -> dict[str, str]:
    """Texts that replace the marks in the files of a learner."""
    if not learner.live.considered.is_prior:
        raise SignalError("learner: begins with the information of earlier logs, which C code lacks; make it without")
    linear = linearisation(learner.live)
    of_report, places = report(learner.live)
    sizes = {"SLOPES": len(linear.places), "F_COUNT": linear.transform.numel_in(0), "REPORT_SLOPES": places.nnz()}
    model, source = _sizes_and_limits(learner, sizes), _source(learner, linear, of_report, places)
    return {
        "ENUMERATIONS": _header(learner),
        "MODEL": model,
        "SOURCE": source,
        "IDENTITY": f"0x{zlib.crc32((model + source).encode()):08x}u",  # of what a saved state means
        "BYTES": str(_memory(learner)),
    }


def _header(learner: Learner) -> str:
    """Enumerations of signals, states and estimates, and sizes, for the public header."""
    live = learner.live
    setup, layout, relinearisation = live.setup, live.filter.layout, live.learner.relinearisation
    estimates = {u.name: sensor_error_unit(u.name) if u.is_sensor_error else unit_of(u.name) for u in reported(learner)}
    saved = layout.size - layout.estimate.start + 2 * len(setup.outputs)
    sizes = {
        "STEER_COUNT": (len(setup.inputs) - 1, "steered axles"),
        "Z_COUNT": (layout.n_z, "estimated unknowns"),
        "CARRY_COUNT": (layout.size, "numbers in the state of a filter"),
        "ROW_COUNT": (live.filter.scan.n_sample - layout.n_z, "numbers of a sample of the filter"),
        "MAX_PASSES": (relinearisation.max_passes, "over a segment with excitation"),
        "SEGMENT_COUNT": (relinearisation.samples, "samples of a segment"),
        "SAVED_COUNT": (saved, "numbers in a saved state"),
        "HEALTH_COUNT": (len(START), "numbers that its health remembers"),
    }
    return c_text.header(live.stream.settings, live.view.names, sizes, ESTIMATE=estimates)


def _sizes_and_limits(learner: Learner, slopes: dict[str, int]) -> str:
    """Sizes, settings and the declarations of tables and functions, for the private header."""
    live = learner.live
    setup, layout, limits = live.setup, live.filter.layout, live.learner
    settings, relinearisation, vehicle = setup.settings, limits.relinearisation, setup.vehicle
    chain = live.model.chain
    excitation = Excitation(vehicle, len(vehicle.steer_signals()), limits, tyres=settings.tyre_law)
    sizes = {
        "X_COUNT": layout.n_x,
        "BANKS": int(chain.bank),
        "BANK_STATE": live.view.bank or 0,
        "DISCREPANCIES": live.model.discrepancies,
        "P_COUNT": layout.n_z + layout.n_c,
        "CONSIDERED": layout.n_c,
        "MODEL_INPUT_COUNT": len(chain.inputs),
        "LAG": relinearisation.lag,
    }
    parts = ("P", "V", "z", "Pz", "B", "gradient", "information")
    sizes |= slopes | {f"AT_{name.upper()}": getattr(layout, name).start for name in parts}
    numbers = {
        "SMALLEST_PLAY": SMALLEST_PLAY,
        "MAX_STATE": MAX_STATE,
        "PRECISION": PRECISION,
        "SQUARED_GATE": min(settings.gate**2, LARGEST_GATE),
        "BANK_SIGMA": live.setup.bank_sigma if chain.bank else 0.0,
        "WHEELBASE": excitation.wheelbase,
        "UNDERSTEER": excitation.understeer,
        "START_EXCITATION": limits.start_excitation,
        "STOP_EXCITATION": limits.stop_excitation,
        "EXCITATION_WINDOW": limits.excitation_window,
        "HIGH_PASS_TIME": limits.high_pass_time,
        "MAX_LATERAL_ACCELERATION": excitation.largest,
        "MAX_SPEED_RATE": excitation.largest_rate,
        "FIRST_PASS_LIMIT": relinearisation.first_pass_limit,
        "PASS_LIMIT": relinearisation.pass_limit,
        "INNOVATION_WINDOW": limits.innovation_window,
        "AUTOCORRELATION_WINDOW": WINDOWS * limits.innovation_window,
        "AVERAGING_TIME": AVERAGING_TIME,
        "MAX_INNOVATION": min(settings.gate, math.sqrt(LARGEST_GATE)),
        "MAX_NIS": live.monitor.max_nis,
        "CHANCE": CHANCE,
        "MAX_INNOVATION_RATIO": limits.max_innovation_ratio,
        "MAX_AUTOCORRELATION": limits.max_autocorrelation,
        "EXCITED": settings.excited,
        "STRONG_SCORE": doubts.STRONG_SCORE,
        "UNUSUAL_SENSOR_ERROR": doubts.UNUSUAL_SENSOR_ERROR,
        "UNUSUAL_ESTIMATE": doubts.UNUSUAL_ESTIMATE,
        "ABOUT_AS_LIKELY": doubts.ABOUT_AS_LIKELY,
        "HARMFUL_SHIFT": doubts.HARMFUL_SHIFT,
    }
    times = {"SETTLING_TIME": limits.settling_time, "MAX_STEER_DROPOUT": limits.max_steer_dropout}
    stream = stream_definitions(live.stream.settings, vehicle, roll=True)
    return "\n".join([*definitions(sizes, numbers, times), *stream])


def _source(learner: Learner, linear: SparseLinearisation, of_report: ca.Function, places: ca.Sparsity) -> str:
    """Tables and functions of the vehicle."""
    live = learner.live
    n, n_x = sizes(live.view.report)[0], live.filter.layout.n_x
    step_results = ("later", "f", "first", "last", "predicted", "h", "direct")
    equations = {
        "linearise": (linear.function, ("state", "z", "row"), step_results),
        "transform": (linear.transform, ("f", "in"), ("out",)),
        "health": (health(live), ("carry", "sample"), ("next", "out")),
        "report": (of_report, ("state", "z", "inputs"), ("value", "slope")),
        "start_matrices": (start_matrices(live), ("inputs", "p"), ("a", "b", "steer", "bank")),
        "start_slopes": (start_slopes(live), ("inputs", "p", "state"), ("f", "slope")),
    }
    return "\n".join(
        [
            *_tables(live),
            *_unknown_tables(learner),
            integers("slope_place", linear.places.tolist()),
            integers("report_start", places.colind()),
            integers("report_place", [i if i < n else i + n_x - n for i in places.row()]),
            *(c_code.function(f, f"fw_{name}", *names, static=False) for name, (f, *names) in equations.items()),
        ]
    )


def _memory(learner: Learner) -> int:
    """Bytes of a `fw_learner` in double precision, about."""
    live = learner.live
    relinearisation = live.learner.relinearisation
    inputs, outputs, size = len(live.setup.inputs), len(live.setup.outputs), live.filter.layout.size
    numbers = 8 + 3 * inputs + 4 * (inputs - 1) + 3 * outputs + len(START) + size
    if relinearisation.max_passes:
        row = live.filter.scan.n_sample - live.filter.layout.n_z
        numbers += 3 * size + live.filter.layout.n_z + relinearisation.samples * row
    return 8 * numbers + 32


def _tables(live: LiveFilter) -> list[str]:
    """Numbers of the filter and of its start."""
    joint, discrepancy = live.filter, discrepancy_variances(live.setup, live.learner)
    lowest, highest = bounds(live.setup.scaling, joint.layout.n_z)
    tables = {
        "process": pack_array(joint.noise.process),
        "noise": joint.noise.measurement,
        "walk": joint.walk,
        "lowest": lowest,
        "highest": highest,
        "discrepancy_variance": discrepancy if len(discrepancy) else [0.0],
    }
    return [
        *(table(name, values, static=False) for name, values in tables.items()),
        *stream_tables(live.stream.settings, live.setup.vehicle, roll=True, static=False),
    ]


def _unknown_tables(learner: Learner) -> list[str]:
    """Scaling and properties of the unknowns."""
    live = learner.live
    setup, inputs = live.setup, live.setup.inputs
    names, estimated = [u.name for u in setup.unknowns], [u.name for u in setup.estimated_unknowns]
    plays = [f"{name}.play" for name in inputs[1:]]
    scaling, considered = setup.scaling, setup.considered_unknowns
    errors = [gross_error(u) or GrossError(1.0, 1.0) for u in considered]
    gross = {
        "possible_change": [largest_possible(u) for u in considered],
        "gross_variance": [error.size**2 - 1 for error in errors],
        "gross_odds": [error.prior_odds for error in errors],
        "least_change": [least_change(u) for u in considered],
    }
    return [
        *(table(name, getattr(scaling, name), static=False) for name in ("centre", "scale", "lower", "upper")),
        *(table(name, values or [0.0], static=False) for name, values in gross.items()),
        integers("logarithmic", [int(u.logarithmic) for u in setup.unknowns]),
        integers("sensor_error", [int(u.is_sensor_error) for u in setup.unknowns]),
        integers("roll_channel", [_roll_channel(u, setup.outputs) for u in setup.unknowns]),
        texts("estimate_names", [u.name for u in reported(learner)]),
        integers("reported", [names.index(u.name) for u in reported(learner)]),
        integers("play", [estimated.index(name) if name in estimated else -1 for name in plays]),
    ]


def _roll_channel(unknown: Unknown, channels: Sequence[str]) -> int:
    """The roll rate without which a parameter is not identifiable; NO_CHANNEL if it needs none."""
    if unknown.is_sensor_error or not lacks_roll_rate(unknown.name, ()):
        return NO_CHANNEL
    name = f"roll_rate.{unknown.path.unit}"
    return channels.index(name) if name in channels else ABSENT_CHANNEL
