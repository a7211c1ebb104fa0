"""What every identification begins and ends with: logs that can be used, and how the result explains them."""

import itertools
from collections.abc import Mapping, Sequence

import numpy as np

from fifthwheel.dynamics import ChainModel
from fifthwheel.errors import SignalError
from fifthwheel.identify import estimates, parameters
from fifthwheel.identify.fit import fits
from fifthwheel.identify.parameters import Unknown
from fifthwheel.identify.result import Fit
from fifthwheel.identify.settings import Common, OneStage
from fifthwheel.identify.stage import Log
from fifthwheel.logs import Record, check, raise_errors
from fifthwheel.logs.samples import without_spikes
from fifthwheel.observe.prepare import fast_enough, locked_but
from fifthwheel.vehicle import Vehicle


def channels(records: Sequence[Record], vehicle: Vehicle) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The measured signals that tell of yaw (yaw rates, articulation) and those that tell of roll (roll rates).

    Raises:
        SignalError: there is no yaw rate of the first unit, or nothing that tells how the last unit turns.
    """
    units = [unit.name for unit in vehicle.units]
    logged = {name for record in records for name in record.signals}
    yaw = [f"yaw_rate.{u}" for u in units] + [f"articulation.{u}" for u in units[1:]]
    present = tuple(name for name in yaw if name in logged)
    for u in units:
        if f"yaw_rate.{u}" not in present and f"articulation.{u}" not in present:
            raise SignalError(f"yaw_rate.{u}: in none of the logs; map a yaw rate gyro of the {u} to it")
    return present, tuple(f"roll_rate.{u}" for u in units if f"roll_rate.{u}" in logged)


class Drives:
    """Logs of one truck, checked, and the truck steered as they are.

    Args:
        records: logs to identify on.
        vehicle: what is known of the truck.
        settings: of the identification.
        validate: logs that are only predicted.

    Raises:
        SignalError: a log that cannot be used, with the signal and the cure.
    """

    def __init__(
        self, records: Sequence[Record], vehicle: Vehicle, settings: Common, validate: Sequence[Record] = ()
    ) -> None:
        if not records:
            raise SignalError("logs: none given; identification needs at least one")
        self.records, self.validate, self.settings = records, validate, settings
        self.notes: list[str] = []
        names = [record.name for record in (*records, *validate)]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise SignalError(f"logs: {', '.join(twice)} given more than once; give every log once, under its own name")
        if not settings.relaxation:
            vehicle = vehicle.replace({f"{path}.relaxation_length": 0.0 for path in parameters.group_paths(vehicle)})
        if isinstance(settings, OneStage) and not settings.uniform_payload:
            vehicle = vehicle.lumped()
        self.original = vehicle
        logged = {name for record in records for name in record.signals}
        self.vehicle = locked_but(vehicle, logged, records[0].name if len(records) == 1 else "the logs")
        for record in (*records, *validate):
            for name in self.vehicle.steer_signals():
                if name not in record.signals:
                    raise SignalError(
                        f"{name}: not in {record.name}, but in another log; map it in all of them or in none"
                    )
            self._check(record)
        if locked := sorted(set(vehicle.steer_signals()) - set(self.vehicle.steer_signals())):
            self.notes.append(f"{', '.join(locked)}: not in the logs, taken as zero.")
        if any(a == b for a, b in itertools.combinations((*records, *validate), 2)):
            raise SignalError("logs: two of them hold the same samples; give every drive once")
        for name in settings.held:
            self.notes.append(f"{name} held: what it may be off by is in no other sigma.")
        records = [without_spikes(record) for record in records]
        self.validate = [without_spikes(record) for record in validate]
        self.logs = [Log(name=r.name, sections=fast_enough(r, settings.min_speed)) for r in records]
        self.yaw, self.roll = channels(records, self.vehicle)

    def _check(self, record: Record) -> None:
        original = self.original
        units, steered = [unit.name for unit in original.units], original.steer_signals()
        findings = check(record, wheelbase=self.vehicle.wheelbase, units=units, steered=steered)
        self.notes += [f"{record.name}: {finding.message}" for finding in findings if finding.severity != "error"]
        self.notes += [f"{record.name}: {note}" for note in record.notes]
        if self.settings.check:
            raise_errors(findings)

    def fits(
        self, model: ChainModel, vehicle: Vehicle, unknowns: Sequence[Unknown], values: Mapping[str, float]
    ) -> tuple[list[Fit], bool]:
        """How the identified truck explains every log, and whether it does so well enough to be believed.

        Args:
            model: without free parameters.
            vehicle: as identified.
            values: sensors' gains and delays, shared by all logs.
        """
        found: list[Fit] = []
        for log in self.logs:
            found += fits(model, vehicle, log, unknowns, values=values, identified_on=True)
        believed = True
        for fit in found:
            if estimates.unexplained(fit, self.vehicle, self.settings):
                believed = False
                self.notes.append(
                    f"{fit.signal}: the model explains {max(fit.explained, 0):.0%} of it in {fit.log}; the estimates "
                    "cannot be trusted. Check the signal, the vehicle file and the values to start from."
                )
        for record in self.validate:
            sections = fast_enough(record, self.settings.min_speed)
            log = Log(name=record.name, sections=sections, noise=self.logs[0].noise)
            found += fits(model, vehicle, log, unknowns, values=values, identified_on=False)
            self._compare_speed(log)
        return found, believed

    def _speeds(self, logs: Sequence[Log]) -> tuple[float, float]:
        """Lowest and highest speed of what is used of logs, m/s."""
        speed = np.concatenate([section.input("speed") for log in logs for section in log.sections])
        return float(speed.min()), float(speed.max())

    def _compare_speed(self, log: Log) -> None:
        """Note where a log leaves the speeds that were identified on by more than a tenth."""
        (low, high), (slow, fast) = self._speeds(self.logs), self._speeds([log])
        if slow < 0.9 * low or fast > 1.1 * high:
            self.notes.append(
                f"{log.name} is driven at {3.6 * slow:.0f} to {3.6 * fast:.0f} km/h, identified was on "
                f"{3.6 * low:.0f} to {3.6 * high:.0f} km/h: understeer may differ there."
            )

    def identified(self, vehicle: Vehicle, values: Mapping[str, float]) -> Vehicle:
        """The vehicle for the next command; its source says what it was identified on, and at which speeds."""
        low, high = self._speeds(self.logs)
        names = ", ".join(log.name for log in self.logs)
        source = f"{self.original.source}; identified on {names} at {low:.1f} to {high:.1f} m/s"
        return vehicle.replace(values).model_copy(update={"source": source.removeprefix("; ")})
