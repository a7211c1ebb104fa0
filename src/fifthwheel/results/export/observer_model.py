"""The generated part of an observer in C: names and sizes for its header, step and constants for its source."""

import casadi as ca

from fifthwheel.base.native import c_code
from fifthwheel.estimate.observe import Observer
from fifthwheel.estimate.observe.observer_model import SUSPECT_STEER_SIGMA
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics.chain import equations, state_names
from fifthwheel.results.export import c_text
from fifthwheel.results.export.c_text import definitions, stream_definitions, stream_tables, table, with_constant


def header(observer: Observer) -> str:
    """Names and sizes for the public header."""
    sizes = {
        "MODEL_INPUT_COUNT": (len(observer.model.inputs), "inputs of the model"),
        "CARRY_COUNT": (observer.scan.n_carry, "numbers in the state of the filter"),
    }
    return c_text.header(observer.stream.settings, observer.reported, sizes)


def source(observer: Observer) -> str:
    """The step of the filter, the matrices of the vehicle and all constants, for the private header."""
    settings, vehicle, stream, roll = observer.settings, observer.vehicle, observer.stream.settings, observer.roll
    critical = dynamics.critical_speed(vehicle, roll=roll)
    errors, offsets = settings.sensor_errors, observer.model.offsets
    sizes = {
        "FILTER_STATES": len(observer.model.states),
        "STEER_COUNT": len(vehicle.steer_signals()),
        "UNKNOWN_COUNT": 1 + len(offsets),
        "ESTIMATES_BANK": int(settings.estimate_bank),
    }
    numbers = {
        "MAX_NIS": settings.max_nis,
        "SUSPECT_STEER_SIGMA": SUSPECT_STEER_SIGMA,
        "CRITICAL_SPEED": 1e6 if critical is None else critical,
    }
    step = with_constant(observer.scan.step, ca.DM(observer.constant))
    return "\n".join(
        [
            *definitions(sizes, numbers),
            *stream_definitions(stream, vehicle, roll=roll),
            "",
            *stream_tables(stream, vehicle, roll=roll, static=True),
            table("unknown_mean", [settings.bank_mean, *(errors.get(name, 0.0) for name in offsets)]),
            table("unknown_sigma", [settings.bank, *map(settings.offset_sigma, offsets)]),
            "",
            c_code.function(_matrices(observer), "fw_matrices", ("inputs",), ("a", "b", "bank", "steer", "slope")),
            c_code.function(step, "fw_step", ("carry", "sample"), ("next", "out")),
        ]
    )


def _matrices(observer: Observer) -> ca.Function:
    """Speed and measured steer angles -> with the numbers of the vehicle A (n, n) and B (n, k) by rows, the effect (n,)
    of the bank, the angles (k,) of the wheels and their derivatives (k,) with respect to the measured ones."""
    vehicle, roll = observer.vehicle, observer.roll
    steers, n = vehicle.steer_signals(), len(state_names(vehicle, roll=roll))
    inputs = ca.SX.sym("inputs", 1 + len(steers))
    angles = dynamics.true_angles(steers, inputs[1:], observer.settings.sensor_errors)
    slopes = ca.diag(ca.jacobian(angles, inputs[1:]))
    values = {name: ca.SX(value) for name, value in vehicle.parameters().items()}
    A, B = equations(values, vehicle, roll=roll, bank=True).state_space(inputs[0])
    results = [c_code.by_rows(A[:n, :n]), c_code.by_rows(B[:n, :]), c_code.by_rows(A[:n, n]), angles, slopes]
    return c_code.step("matrices", [inputs], results)
