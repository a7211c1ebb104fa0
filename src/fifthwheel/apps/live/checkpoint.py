"""The file with the learned estimates: read at the start, written every few seconds."""

import time
from collections.abc import Callable, Collection, Mapping
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any

from fifthwheel.apps.live.learning import Learning
from fifthwheel.apps.live.outputs.recorder import BackgroundWriter
from fifthwheel.base.errors import SignalError, VehicleError, suggestion
from fifthwheel.base.options import TyreLaw
from fifthwheel.data.channels import is_sensor_error
from fifthwheel.data.channels.sensors import SensorPrior
from fifthwheel.estimate.identify import OneStage
from fifthwheel.estimate.identify.given import with_sensors
from fifthwheel.estimate.identify.knowledge.knowledge import Knowledge
from fifthwheel.estimate.online import Learner
from fifthwheel.estimate.online.start import LEARNER_FILE
from fifthwheel.truck import Vehicle

PERIOD = 5.0
"""Time between two checkpoints, s, while something is learned; a process that is killed loses less than 10 s."""
KIND = "checkpoint"
"""Kind of the jobs of the writer."""


def make_learning(
    vehicle: Vehicle,
    signals: Collection[str],
    *,
    path: Path | None = None,
    trailer: str | None = None,
    knowledge: Knowledge | None = None,
    locks: Collection[str] = (),
    tyres: TyreLaw = "linear",
    sensors: Mapping[str, SensorPrior] = MappingProxyType({}),
) -> Learning:
    """A learner with the estimates of a file, if it exists.

    `trailer` is the name of the coupled one, by default that of the file, or the vehicle's. `locks` are parameters that
    keep their value, that of the file, or of the vehicle. `knowledge` is that of a truck with which a new file, and a
    trailer that is new to it, begin; by default with the trailer of its last log. `sensors` is what is stated of them
    by signal.

    Raises:
        SignalError: the file is damaged, or of another vehicle, other signals, sensors or another law.
        VehicleError: a locked parameter does not exist, or tyres saturate and the static axle loads are not determined.
    """
    for name in locks:
        if name not in vehicle.parameters():
            raise VehicleError(f"--lock {name}: no such parameter; {suggestion(name, vehicle.parameters())}")
    if path is None or not path.exists():
        settings = OneStage(given=dict.fromkeys(locks, "exact"), tyres=tyres)
        occasion = (knowledge or Knowledge()).occasion(vehicle, trailer)
        learner = Learner(
            vehicle, signals, settings, sensors=sensors, trailer=trailer, knowledge=knowledge, occasion=occasion
        )
        return Learning(learner, vehicle)
    content = LEARNER_FILE.read(path)
    former = Vehicle(**content["vehicle"])
    _require_same(path, content, former, vehicle, signals)
    if content["settings"].get("tyres", "linear") != tyres:
        raise SignalError(f"{path}: was learned with other tyres; give its --tyres, or another --state")
    before, stated = _locked(content), with_sensors(vehicle, OneStage(), sensors)
    learner = _with_locks(Learner.of_content(content, str(path), knowledge=knowledge), former, vehicle, before, locks)
    settings = learner.live.setup.settings
    of_sensors = {name: text for name, text in settings.given.items() if is_sensor_error(name)}
    if (of_sensors, settings.noise) != (stated.given, stated.noise):
        raise SignalError(
            f"{path}: was learned with other sensor classes or uncertainties in signals.toml; give another --state"
        )
    learning = Learning(learner, vehicle, restored=True)
    if trailer is not None:
        learning.couple(trailer)
    return learning


class Checkpoint:
    """Writes the estimates of a learner to a file, which appears complete or not at all."""

    def __init__(
        self, learning: Learning, path: Path, writer: BackgroundWriter, now: Callable[[], float] = time.monotonic
    ) -> None:
        self.learning, self.path, self._writer, self._now = learning, path, writer, now
        self._written_at, self._written = now(), (learning.learned, learning.change)

    def update(self) -> None:
        """Write if it is time and something was learned."""
        if self._now() - self._written_at >= PERIOD:
            self.write()

    def write(self) -> None:
        """Write if something was learned."""
        self._written_at = self._now()
        state = (self.learning.learned, self.learning.change)
        if (state != self._written or KIND in self._writer.errors) and self._writer.submit(
            KIND, partial(LEARNER_FILE.write, self.path, self.learning.learner.content())
        ):
            self._written = state


def _locked(content: Mapping[str, Any]) -> set[str]:
    return {name for name, text in content["settings"]["given"].items() if text == "exact"}


def _require_same(
    path: Path, content: Mapping[str, Any], former: Vehicle, vehicle: Vehicle, signals: Collection[str]
) -> None:
    locked = _locked(content)
    same = {name: value for name, value in vehicle.parameters().items() if name not in locked}
    if {name: value for name, value in former.parameters().items() if name not in locked} != same:
        raise SignalError(f"{path}: has the estimates of another vehicle file; give that one, or another --state")
    unknown = sorted(set(content["signals"]) - set(signals))
    if unknown:
        raise SignalError(
            f"{path}: its estimates need {unknown[0]}, which is not mapped; map it, or give another --state"
        )


def _with_locks(
    learner: Learner, former: Vehicle, vehicle: Vehicle, before: set[str], locks: Collection[str]
) -> Learner:
    """The learner with exactly these parameters locked, each at its former lock or at its estimate."""
    if before == set(locks):
        return learner
    estimates, locked = learner.vehicle().parameters(), former.parameters()
    return learner.with_fixed(vehicle, {name: (locked if name in before else estimates)[name] for name in locks})
