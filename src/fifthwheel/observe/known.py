"""What an observer knows of its truck and its sensors, as the numbers that the compiled steps read."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fifthwheel import dynamics
from fifthwheel.dynamics import ChainModel
from fifthwheel.dynamics.sensors import QUANTITIES, sensor_parameters
from fifthwheel.errors import SignalError
from fifthwheel.filters import Noise
from fifthwheel.filters.model import pack_array
from fifthwheel.observe import noise as variances
from fifthwheel.observe.settings import ObserverSettings
from fifthwheel.observe.uncertainty import Pair, Uncertainty
from fifthwheel.vehicle import Vehicle
from fifthwheel.vehicle.part import suggestion

Array = NDArray[np.float64]
UNCHANGED: Mapping[str, float] = {}
SIGNED = frozenset({"cog", "position", "leading_position", "trailing_position", "roll_yaw_product"})
"""Last words of the vehicle's paths whose value may be negative."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Known:
    """A truck, the models of what is measured and of what is reported, and the settings.

    Everywhere `changed` are values of parameters and sensor errors, by name, in place of the known ones. They go to the
    model's constants as they are: no vehicle is made of them and none is checked.
    """

    vehicle: Vehicle
    model: ChainModel
    report: ChainModel
    settings: ObserverSettings

    def values(self) -> dict[str, float]:
        """Every number of the truck and of the sensors that are read, by name."""
        return dynamics.all_parameters(self.vehicle, self.model.outputs) | dict(self.settings.zeros)

    def pairs(self, uncertainty: Uncertainty) -> list[Pair]:
        """Trucks on either side of this one. Errors of sensors that are not read do not matter.

        Raises:
            SignalError: something is uncertain that no truck of this make-up and no sensor on it has.
        """
        own, read = self.vehicle.parameters(), self.model.known
        for name in uncertainty.names:
            if name not in read and not self._of_a_sensor(name):
                raise SignalError(
                    f"{name}: uncertain, but {self.vehicle.name} has no such number; {suggestion(name, read)}"
                )
        positive = {name for name, value in own.items() if value > 0 and name.rpartition(".")[2] not in SIGNED}
        return uncertainty.among(read).pairs(self.values(), positive)

    def _of_a_sensor(self, name: str) -> bool:
        """Whether a name is an error that a sensor on the truck may have, read or not."""
        signal, _, word = name.rpartition(".")
        quantity, _, place = signal.partition(".")
        axles = {f"{unit.name}.{axle.name}" for unit in self.vehicle.units for axle in unit.axles}
        if quantity == "steer":
            return place in axles and word in ("gain", "offset", "delay")
        known = quantity in QUANTITIES and place in {unit.name for unit in self.vehicle.units}
        return known and f"{signal}.{word}" in sensor_parameters(self.vehicle, signal)

    def constant(self, changed: Mapping[str, float] = UNCHANGED, gate: float | None = None) -> Array:
        """[c, Q, R, gate^2, c of the report]; the settings' gate by default.

        Raises:
            SignalError: the settings place a signal that has no place.
        """
        settings, outputs = self.settings, self.model.outputs
        noise = Noise(
            process=variances.process(self.model.states, variances.OBSERVED, settings.process_noise),
            measurement=np.array([variances.sensor(self.vehicle, name, settings.noise) for name in outputs]),
            gate=settings.gate if gate is None else gate,
        )
        c = self.model.known_values({**self.values(), **changed})
        return np.concatenate([c, noise.vector(), self.report.known_values(self._shown(changed))])

    def _shown(self, changed: Mapping[str, float]) -> dict[str, float]:
        """Values for the report: of a sensor's errors only a steer angle's, since what is told is what is there."""
        own, names = self.vehicle.parameters(), self.report.outputs
        shown = dynamics.all_parameters(self.vehicle, names)
        errors = {**self.settings.zeros, **changed}
        shown |= {name: value for name, value in errors.items() if name.startswith("steer.")}
        shown |= {name: value for name, value in changed.items() if name in own}
        placed = [name for name in names if f"{name}.position" in shown]
        for name in placed:  # where the CoG is, wherever that is
            unit = name.split(".")[1]
            shown |= {f"{name}.position": shown[f"{unit}.cog"], f"{name}.height": shown[f"{unit}.roll_axis_height"]}
        for name, place in self.settings.places.items():
            if name not in placed:
                raise SignalError(f"{name}: has no place to be told at; those that have are {', '.join(placed)}")
            shown[f"{name}.position"] = place
        return shown

    def start(self, inputs: Mapping[str, float]) -> Array:
        """[x, P] before the first sample, whose speed and steer angles are `inputs`."""
        x0, P0 = variances.initial(
            self.vehicle,
            inputs,
            self.settings.zeros,
            roll=self.model.roll,
            swing=variances.SWING,
            bank=self.settings.bank,
        )
        return np.concatenate([x0, pack_array(P0)])
