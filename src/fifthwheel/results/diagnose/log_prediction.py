"""Measured and predicted signals of a log for any numbers of the vehicle, at once."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Self

from fifthwheel.data.record import Record
from fifthwheel.estimate.identify import Fit, Identification, OneStage
from fifthwheel.estimate.identify.dataset import LogData, prepare_dataset
from fifthwheel.estimate.identify.fits import free_run_fits
from fifthwheel.estimate.identify.given import with_sensors
from fifthwheel.estimate.identify.setup import Setup
from fifthwheel.truck import Vehicle
from fifthwheel.truck.quantities import TIME_BASE


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
        'yaw_rate.semitrailer'
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
        settings = OneStage(check=False, tyres="linear", given={"softening": "exact", "variation": "exact"})
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
