"""An own sensor: the direction of motion that an optical sensor on the tractor measures.

    python examples/optical_sensor.py

The sensor is 1.5 m ahead of the CoG, on the height of the roll axis. It measures the angle between the motion of its
place and the tractor, which is not linear in the state. Observer and identification use it as they use a gyro.
"""

from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np

import fifthwheel as fw
from fifthwheel.data.channels import register
from fifthwheel.data.channels.channel import Channel, ErrorKind, SensorModel, SignalLimits

AHEAD = 1.5
OFFSET = 0.004
SIGNAL = "optical_angle.tractor"


def angle(now: Any, i: int, name: str) -> ca.SX:
    """atan((v + x r) / u) of the place; v, r and u of unit i are in `chain.Motion`."""
    return ca.atan((now.motion.v[i] + AHEAD * now.motion.r[i]) / now.motion.u[i])


register(
    Channel(
        quantity="optical_angle",
        unit="rad",
        limit=SignalLimits(magnitude=0.5, jump=0.1),
        noise=(0.002**2, 0.002**2),
        model=SensorModel(value=angle, rate=lambda now, i, value: now.rate_of(value)),
        errors=(
            ErrorKind(kind="offset", prior=0.01, per_log=True),
            ErrorKind(kind="gain", prior=0.02),
            ErrorKind(kind="delay", prior=0.02),
        ),
    )
)


def simulated(truck: fw.Vehicle) -> fw.Record:
    """Two lane changes with two gyros and the optical sensor, which has an offset."""
    variances = {"yaw_rate.tractor": 1e-6, "yaw_rate.semitrailer": 1e-6, SIGNAL: 0.002**2}
    record = fw.simulate(truck, count=2, sensors=variances)
    return replace(record, signals={**record.signals, SIGNAL: record.signals[SIGNAL] + OFFSET})


def main() -> None:
    """Identify, and compare the sideslip with that without the sensor."""
    truck = fw.vehicle("cheng_cebon_2011")
    record = simulated(truck)
    result = fw.identify([record], truck, fw.OneStage(tyres="linear", check=False))
    (offset,) = [error for error in result.sensors if error.name == f"{SIGNAL}.offset"]
    print(f"offset: {offset.value:.4f} +- {offset.sigma:.4f} rad, true {OFFSET}")
    for signals in (record.signals, [name for name in record.signals if name != SIGNAL]):
        observer = fw.Observer(truck, signals, result.observer_settings(record.name))
        states = observer.batch(record, result.uncertainty(record.name))
        error = states.values["sideslip.tractor"] - record.reference["sideslip.tractor"]
        print(f"{len(observer.outputs)} sensors: sideslip error {1e3 * np.sqrt(np.mean(error**2)):.2f} mrad")


if __name__ == "__main__":
    main()
