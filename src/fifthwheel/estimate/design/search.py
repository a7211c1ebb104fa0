"""The candidate runs of an experiment design, each with the sigmas that a fit would give."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from fifthwheel.base.errors import SignalError, VehicleError
from fifthwheel.base.settings import Count, NonNegative, Positive, Settings
from fifthwheel.base.spelling import setting
from fifthwheel.base.types import Array
from fifthwheel.estimate.design.impulse_response import ImpulseResponse
from fifthwheel.estimate.design.predict import InformationPredictor
from fifthwheel.estimate.design.road_noise import ROUGHNESS, road_noise
from fifthwheel.estimate.identify.settings import Progress
from fifthwheel.estimate.identify.verdict import Verdict
from fifthwheel.model import dynamics
from fifthwheel.model.manoeuvres.accelerations import lateral_acceleration
from fifthwheel.model.manoeuvres.candidates import CandidateManoeuvre, candidate_manoeuvres
from fifthwheel.truck import Vehicle
from fifthwheel.truck.quantities import size_of

SPEED_RANGE = (5.0, 40.0)
"""m/s, of a run."""
ROAD_SPEEDS = f"expected road speeds of {3.6 * SPEED_RANGE[0]:.0f} to {3.6 * SPEED_RANGE[1]:.0f} km/h"


@dataclass(frozen=True, kw_only=True)
class DesignSettings(Settings):
    """The candidate runs, and how one of them is chosen."""

    speeds: Annotated[tuple[Positive, ...], Field(min_length=1)] = (50 / 3.6, 65 / 3.6, 80 / 3.6, 88 / 3.6)
    """m/s."""
    frequencies: Annotated[tuple[Positive, ...], Field(min_length=1)] = (0.3, 0.4, 0.5, 0.6)
    """Frequencies of lane changes, Hz."""
    accelerations: Annotated[tuple[Positive, ...], Field(min_length=1)] = (0.5, 1.0, 1.5, 2.0)
    """Largest lateral accelerations of any unit's CoG, m/s^2; those above `max_acceleration` are left out."""
    max_acceleration: Positive = 1.5
    """Limit of the lateral acceleration, m/s^2, also a candidate; it keeps tyres linear and wheels on the road."""
    max_steer_rate: Positive = 0.3
    """Limit of the road wheels' steer rate, rad/s: about one turn of the steering wheel in a second."""
    min_offset: float = 0.5
    """Smallest lateral offset of a lane change, m; a driver cannot repeat a smaller one."""
    repetitions: Annotated[tuple[Count, ...], Field(min_length=1)] = (1, 2, 3, 4, 6, 8, 10, 12)
    """Numbers of repetitions of a manoeuvre, to the left and to the right in turn."""
    rate: Positive = 100.0
    """Sampling rate, Hz."""
    roughness: NonNegative = ROUGHNESS
    """Spectral density of the road's height at 0.1 cycles per metre, m^3 (ISO 8608): 16e-6 for class A, four times as
    much for each further class."""
    near: float = 1.05
    """If no run reaches all targets: the shortest run whose largest ratio of sigma to target is within this factor of
    the smallest one is chosen."""
    alternatives: int = 3
    """Maximum number of alternative runs, each with another kind of manoeuvre."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if not SPEED_RANGE[0] <= min(self.speeds) <= max(self.speeds) <= SPEED_RANGE[1]:
            given = ", ".join(f"{3.6 * speed:.0f}" for speed in self.speeds)
            raise SignalError(f"speed: {ROAD_SPEEDS}, got {given} km/h; the linear model needs them")

    def up_to(self, speed: float) -> "DesignSettings":
        """These settings with the candidate speeds up to a highest one, m/s, and with that one if all are higher or
        lower; a SignalError if it is no road speed."""
        if not SPEED_RANGE[0] <= speed <= SPEED_RANGE[1]:
            raise SignalError(
                f"{setting('max_speed')}: {ROAD_SPEEDS}, got {3.6 * speed:.4g} km/h; the linear model needs them"
            )
        slower = tuple(v for v in self.speeds if v < speed + 0.01)
        is_new = not slower or speed > max(self.speeds) + 0.01
        return replace(self, speeds=(*slower, speed) if is_new else slower)

    @property
    def sizes(self) -> tuple[float, ...]:
        """Candidate accelerations, m/s^2: those below the limit, and the limit."""
        return (*[a for a in self.accelerations if a < self.max_acceleration], self.max_acceleration)


@dataclass(frozen=True, kw_only=True, eq=False)
class ProposedRun:
    """A run, and the sigmas that a fit of it would give."""

    manoeuvre: CandidateManoeuvre
    rate: float
    """Sampling rate, Hz."""
    repetitions: int
    """To the left and to the right in turn."""
    leading: float
    """Largest lateral acceleration of the first unit's CoG, m/s^2."""
    acceleration: float
    """Largest lateral acceleration of any unit's CoG, m/s^2."""
    unit_steer: Array = field(repr=False)
    """Steer angle (N,) of one repetition with `leading` = 1, rad."""
    sigma: Mapping[str, float]
    """Sigma of every estimated parameter, relative to its value; the prior's without enough information."""
    verdicts: Mapping[str, Verdict]
    """Verdict on every estimated parameter."""
    worst_ratio: float
    """Largest ratio of sigma to target; all targets are met up to 1."""

    @property
    def kind(self) -> str:
        """lane_change, sweep, random or bend."""
        return self.manoeuvre.kind

    @property
    def frequency(self) -> float | None:
        """Frequency of a lane change, Hz."""
        return self.manoeuvre.frequency

    @property
    def speed(self) -> float:
        """m/s."""
        return self.manoeuvre.speed

    @property
    def duration(self) -> float:
        """s."""
        return self.repetitions * self.manoeuvre.period

    @property
    def offset(self) -> float | None:
        """Lateral offset of a lane change, m; None for other manoeuvres."""
        return self.manoeuvre.offset(self.leading)

    @property
    def steer(self) -> Array:
        """Steer angle (N,) of the first steered axle in all repetitions, rad."""
        repeated = self.manoeuvre.repeated(self.unit_steer, self.repetitions, self.rate)
        return np.asarray(np.round(self.leading * repeated, 7) + 0.0)

    def as_dict(self) -> dict[str, Any]:
        """The content for JSON; of the steer angle only the largest."""
        names = ("kind", "frequency", "offset", "speed", "repetitions", "duration", "acceleration", "leading")
        content = {name: getattr(self, name) for name in (*names, "sigma", "verdicts")}
        return content | {"max_steer": float(np.abs(self.steer).max())}


def stable_speeds(vehicle: Vehicle, settings: DesignSettings) -> list[float]:
    """The candidate speeds at which a vehicle is stable, m/s; a VehicleError if there are none."""
    speeds = [speed for speed in settings.speeds if dynamics.is_stable(vehicle, speed)]
    if not speeds:
        raise VehicleError(
            f"{vehicle.name}: unstable at {3.6 * min(settings.speeds):.0f} km/h with the values of its file; check the "
            "file, or choose a lower speed"
        )
    return speeds


def search_candidates(
    predictor: InformationPredictor,
    speeds: Sequence[float],
    targets: Mapping[str, float],
    noise: Mapping[str, float],
    settings: DesignSettings,
    progress: Progress = lambda *_: None,
) -> Iterator[ProposedRun]:
    """Every candidate run within the limits, for a truck that is stable at all speeds, m/s.

    `targets` are wanted sigmas relative to the values; `noise` is the variance of the sensor of each logged channel, SI
    squared, to which that of the road is added.
    """
    manoeuvres = [(u, m) for u in speeds for m in candidate_manoeuvres(u, settings.frequencies)]
    responses: dict[float, ImpulseResponse] = {}
    for i, (speed, manoeuvre) in enumerate(manoeuvres):
        progress("design", i, len(manoeuvres))
        if speed not in responses:
            models = road_noise(predictor.setup.vehicle, speed, settings.rate, noise, settings.roughness)
            responses = {speed: ImpulseResponse.of(predictor, speed, rate=settings.rate, noise=models)}
        yield from _candidates_of(predictor, responses[speed], manoeuvre, targets, settings)
    progress("design", len(manoeuvres), len(manoeuvres))


def _candidates_of(
    predictor: InformationPredictor,
    response: ImpulseResponse,
    manoeuvre: CandidateManoeuvre,
    targets: Mapping[str, float],
    settings: DesignSettings,
) -> Iterator[ProposedRun]:
    """One manoeuvre at every size and with every number of repetitions."""
    steer, unit_acceleration, sizes = sizes_within_limits(predictor.setup.vehicle, manoeuvre, settings)
    if not sizes:
        return
    information = response.information(manoeuvre, steer, max(settings.repetitions))
    values, estimated = predictor.setup.vehicle.parameters(), predictor.setup.estimated
    priors = {name: predictor.prior_sigma(name) for name in estimated}
    for size in sizes:
        of_repetitions = information.at(size)
        for count in settings.repetitions:
            result = predictor.posterior_of(response.names, of_repetitions[count - 1], response.noise)
            sigma = {n: result.reliable_sigma(n) * priors[n] / size_of(n, values[n], priors[n]) for n in estimated}
            yield ProposedRun(
                manoeuvre=manoeuvre,
                rate=settings.rate,
                repetitions=count,
                leading=size,
                acceleration=size * unit_acceleration,
                unit_steer=steer,
                sigma=sigma,
                verdicts={n: result.verdict(n) for n in estimated},
                worst_ratio=max(sigma[name] / target for name, target in targets.items()),
            )


def sizes_within_limits(
    vehicle: Vehicle, manoeuvre: CandidateManoeuvre, settings: DesignSettings
) -> tuple[Array, float, list[float]]:
    """Steer angle (N,) of one repetition of unit size, rad; its largest lateral acceleration of any unit's CoG, m/s^2;
    and the sizes within the limits of the settings."""
    steer = manoeuvre.steer(vehicle, settings.rate)
    accelerations = lateral_acceleration(vehicle, manoeuvre.speed, steer, settings.rate)
    unit_acceleration = float(np.abs(accelerations).max())
    unit_steer_rate = float(np.abs(np.diff(steer)).max() * settings.rate)
    sizes = sorted({min(a / unit_acceleration, settings.max_steer_rate / unit_steer_rate) for a in settings.sizes})
    sizes = [size for size in sizes if (manoeuvre.offset(size) or np.inf) >= settings.min_offset]
    return steer, unit_acceleration, sizes
