"""The compiled step of an observer: a Kalman filter with reported outputs and a monitor of its consistency."""

import casadi as ca

from fifthwheel.dynamics import ChainModel
from fifthwheel.dynamics.chain import BANK
from fifthwheel.filters import kalman
from fifthwheel.filters.model import pack, packed_size, sizes, split, unpack
from fifthwheel.native import Scan, compiled
from fifthwheel.observe import monitor
from fifthwheel.vehicle import Vehicle


def reported_signals(vehicle: Vehicle, *, roll: bool, bank: bool = False) -> tuple[str, ...]:
    """Signals that an observer reports.

    Args:
        vehicle: gives the units.
        roll: whether the model has roll; then roll angles and roll rates are reported.
        bank: whether the bank of the road is a state; then it is reported.
    """
    units = [unit.name for unit in vehicle.units]
    names = [f"{quantity}.{u}" for quantity in ("sideslip", "yaw_rate") for u in units]
    names += [f"articulation.{u}" for u in units[1:]]
    names += [f"{quantity}.{u}" for quantity in ("roll", "roll_rate") for u in units if roll]
    return (*names, BANK) if bank else tuple(names)


@compiled(Scan)
def observer_step(model: ChainModel, report: ChainModel) -> ca.Function:
    """The compiled step: a Kalman filter of `model` with the outputs of `report` and their variances.

    carry = [x, P, monitor]; sample = [dt, d, y, weight]; constant = [c, Q, R, gate^2, c of the report, settings of
    the monitor]; output = [reported, their variances, innovation, variance, accepted, NIS, restart].
    """
    n_x, n_d, _, n_c, n_y = sizes(model)
    n_P, n_report = packed_size(n_x), len(report.known)
    carry, sample, constant = (
        ca.SX.sym(name, size)
        for name, size in (
            ("carry", n_x + n_P + len(monitor.START)),
            ("sample", 1 + n_d + 2 * n_y),
            ("constant", n_c + n_P + n_y + 1 + n_report + 2),
        )
    )
    x, P, monitored = split(carry, [n_x, n_P, len(monitor.START)])
    dt, d, y, weight = split(sample, [1, n_d, n_y, n_y])
    c, q, r, limit, c_report, monitor_settings = split(constant, [n_c, n_P, n_y, 1, n_report, 2])
    no_p = ca.SX(0, 1)
    before, P_before, _ = kalman.predict(model, x, unpack(P, n_x), dt, d, no_p, c, unpack(q, n_x))
    predicted, H = kalman.observe(model, before, d, no_p, c)
    after, P_after, channels, _ = kalman.correct(before, P_before, predicted, H, y, weight, r, limit)
    reported, variances = kalman.report_outputs(report, after, P_after, d, no_p, c_report)
    monitored, findings = monitor.monitor(monitored, channels, weight, dt, limit, monitor_settings)
    carried = ca.vertcat(after, pack(P_after), monitored)
    output = ca.vertcat(reported, variances, kalman.channel_columns(channels), findings)
    return ca.Function("observer", [carry, sample, constant], [carried, output], {"cse": True})
