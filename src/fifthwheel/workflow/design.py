"""The design of a test run from the choices that a user makes."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from fifthwheel.identify import OneStage
from fifthwheel.vehicle import Vehicle
from fifthwheel.workflow.inputs import Progress

if TYPE_CHECKING:
    from fifthwheel.identify.design import ExperimentDesign


def design_run(
    vehicle: Vehicle,
    targets: Mapping[str, float] | None = None,
    settings: OneStage | None = None,
    *,
    channels: Sequence[str] = (),
    speed: float | None = None,
    max_speed: float = 88 / 3.6,
    max_acceleration: float = 1.5,
    progress: Progress = lambda *_: None,
) -> "ExperimentDesign":
    """The shortest test run that reaches all targets; see `identify.design.design_experiment`.

    Args:
        speed: of the run, m/s; by default the best of the usual speeds up to `max_speed`, or `max_speed` if all are
            higher.
        max_speed: m/s.
        max_acceleration: largest lateral acceleration of any unit, m/s^2.
    """
    from fifthwheel.identify.design import DesignSettings, design_experiment  # slow to import

    settings, usual = settings or OneStage(), DesignSettings()
    allowed = tuple(v for v in usual.speeds if v < max_speed + 0.01) or (max_speed,)
    return design_experiment(
        vehicle if settings.uniform_payload else vehicle.lumped(),
        targets,
        settings,
        channels=channels,
        planning=replace(usual, speeds=(speed,) if speed else allowed, max_acceleration=max_acceleration),
        progress=progress,
    )
