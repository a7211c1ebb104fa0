"""The linear model with other numbers of the vehicle: the effect of numbers that its file lacks, and fits of a log."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np

from fifthwheel.base.errors import VehicleError
from fifthwheel.base.types import Array
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify import Fit, Identification, OneStage
from fifthwheel.estimate.identify.dataset import LogData, prepare_dataset
from fifthwheel.estimate.identify.fits import TYRES_AS_THEY_ARE, free_run_fits
from fifthwheel.estimate.identify.given import with_sensors
from fifthwheel.estimate.identify.setup import Setup
from fifthwheel.model import dynamics
from fifthwheel.model.dynamics.simulation import free_response
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import Vehicle, changes
from fifthwheel.truck.quantities import TIME_BASE


@dataclass(frozen=True, kw_only=True)
class AssumedNumber:
    """A number of a vehicle that its file does not have."""

    path: str
    value: float
    """SI."""
    sigma: float | None
    """Standard deviation, SI; None where it follows from other numbers."""
    source: str
    yaw: float | None
    """Largest change of a unit's yaw rate in a lane change by one sigma, as a fraction of its rms value; None where the
    vehicle has no such run, or the number no sigma."""
    roll: float | None
    """The same for the roll rates."""


def assumed_numbers(vehicle: Vehicle, speed: float = 80 / 3.6) -> tuple[AssumedNumber, ...]:
    """The assumed numbers of a vehicle, those with the largest effect on a lane change at `speed`, m/s, first.

    The steer angles are those of the vehicle as it is, so a change shows what a log would show.
    """
    values = vehicle.parameters()
    effects = _effects(vehicle, speed)
    numbers = [
        AssumedNumber(
            path=path,
            value=values[path],
            sigma=vehicle.stated.get(path),
            source=source,
            yaw=effects.get(path, {}).get("yaw_rate"),
            roll=effects.get(path, {}).get("roll_rate"),
        )
        for path, source in vehicle.assumed.items()
    ]
    return tuple(sorted(numbers, key=lambda number: -max(number.yaw or 0.0, number.roll or 0.0)))


def _effects(vehicle: Vehicle, speed: float) -> dict[str, dict[str, float]]:
    """Relative change of each quantity by one sigma of each assumed number."""
    try:
        record = simulate(vehicle, count=1, speed=speed)
    except VehicleError:  # unstable at this speed
        return {}
    base = _response(vehicle, record)
    effects = {}
    for change in changes(vehicle):
        if change.name in vehicle.assumed:
            values = vehicle.parameters()
            changed = {path: values[path] + slope for path, slope in change.slopes.items()}
            try:
                response = _response(vehicle.replace(changed), record)
            except VehicleError:  # such as a CoG behind the axles
                continue
            ratios = {name: _rms(response[name] - y) / _rms(y) for name, y in base.items()}
            effects[change.name] = {
                quantity: max(ratio for name, ratio in ratios.items() if name.startswith(quantity))
                for quantity in ("yaw_rate", "roll_rate")
            }
    return effects


def _response(vehicle: Vehicle, record: Record) -> Mapping[str, Array]:
    outputs = [f"{quantity}.{unit.name}" for unit in vehicle.units for quantity in ("yaw_rate", "roll_rate")]
    steered = vehicle.with_logged_steering(record.signals, record.name)
    model = dynamics.model(steered, outputs, roll=True)
    _, y = free_response(model, dynamics.all_parameters(steered, outputs), record.time, record.signals)
    return dict(zip(outputs, y.T, strict=True))


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


@dataclass(frozen=True, kw_only=True)
class LogPrediction:
    """The free-running model with linear tyres on one log.

    What does not depend on the numbers of the vehicle is prepared once: segments, model, compiled step. 120 s at 100 Hz
    then take about 0.3 s, most of it for the fit of initial states and offsets.

    Example:
        >>> import fifthwheel as fw
        >>> from fifthwheel.results.diagnose import LogPrediction
        >>> truck = fw.vehicle("cheng_cebon_2011")
        >>> prediction = LogPrediction.of(fw.simulate(truck, count=1), truck)
        >>> softer = prediction.fits({"semitrailer.cornering_stiffness": 1.0e6})
        >>> softer[-1].signal
        'roll_rate.semitrailer'
    """

    setup: Setup
    """With the steer angles that the log has."""
    log: LogData
    errors: Mapping[str, float] = field(default_factory=dict)
    """Gains and delays of the sensors, SI."""

    @classmethod
    def of(cls, record: Record, vehicle: Vehicle, identification: Identification | None = None) -> Self:
        """The prediction of a log.

        Args:
            record: with speed, steer angle and at least a yaw rate or articulation angle of each unit.
            vehicle: gives the numbers that `fits` does not change.
            identification: for gains and delays of the sensors; without it they are exact.

        Raises:
            SignalError: the log cannot be used.
        """
        settings = OneStage(check=False, tyres="linear", given=TYRES_AS_THEY_ARE)
        dataset = prepare_dataset([record], vehicle, settings, findings=False)
        settings = with_sensors(dataset.vehicle, settings, dataset.sensors)
        sensors = identification.sensors if identification else ()
        return cls(
            setup=Setup.of(dataset.vehicle, dataset.outputs, settings),
            log=dataset.logs[0],
            errors={
                error.name: error.value
                for error in sensors
                if error.log is None and not error.name.startswith(f"{TIME_BASE}.")
            },
        )

    def fits(self, values: Mapping[str, float] | None = None) -> list[Fit]:
        """Measured and predicted values of each channel, with other numbers of the vehicle.

        Initial states, bank of the road and sensor offsets are fitted anew, as in an identification.

        Args:
            values: SI, by the paths of parameters.

        Raises:
            VehicleError: a path that does not exist, or a number that is not possible.
        """
        vehicle = self.setup.vehicle.replace(values or {})
        return free_run_fits(replace(self.setup, vehicle=vehicle), self.log, self.errors)
