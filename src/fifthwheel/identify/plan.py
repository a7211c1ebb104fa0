"""The shortest drive that tells what is wanted as well as it is wanted; where none does, what stands in the way."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from fifthwheel.errors import SignalError, VehicleError
from fifthwheel.identify import parameters
from fifthwheel.identify.drives import Drives
from fifthwheel.identify.forecast import Forecast, possible_channels, stable
from fifthwheel.identify.information import Verdict
from fifthwheel.identify.manoeuvres import to_record
from fifthwheel.identify.proposal import Plan, Proposal, Shortfall
from fifthwheel.identify.remedies import Remedies, lane_change
from fifthwheel.identify.search import Planning, Tried, search
from fifthwheel.identify.settings import OneStage
from fifthwheel.identify.stage import Log, Progress
from fifthwheel.observe import noise as variances
from fifthwheel.observe.prepare import locked_but
from fifthwheel.vehicle import Vehicle

USUAL = 0.05
"""What is wanted of every cornering stiffness and of the yaw inertia of every unit behind the first, if nothing is
said: sigma as a part of the value."""


def plan(
    vehicle: Vehicle,
    wants: Mapping[str, float] | None = None,
    settings: OneStage | None = None,
    *,
    channels: Sequence[str] = (),
    planning: Planning | None = None,
    progress: Progress = lambda *_: None,
) -> Plan:
    """The shortest drive after which a one-stage fit would know what is wanted; of those as long, the gentlest.

    Reckoned like `outlook`, at the vehicle file's values, so the better the file, the better the plan. The model is
    taken for right, the road for flat, and only the first steered axle steers. Longer or harder is not always better:
    the more a log weighs, the more the estimates lean on what the vehicle file knows only roughly.

    Args:
        wants: sigma by parameter, as a part of its value; `USUAL` by default. What is not sought otherwise is sought
            besides.
        settings: of the fit.
        channels: that will be logged; by default the yaw and the roll rate of every unit.
        planning: which drives are tried.
        progress: called with a title, the number of manoeuvres done and their most.

    Raises:
        SignalError: channels that no fit could use.
        VehicleError: a want that is no parameter, is held or not above zero; a truck unstable at every speed.
    """
    settings, planning = settings or OneStage(), planning or Planning()
    channels = _channels(vehicle, channels)
    wants = dict(wants) if wants else _usual(vehicle, settings)
    settings = _seeking(vehicle, wants, settings)
    truck = _as_fitted(vehicle, channels, settings)
    speeds = [speed for speed in planning.speeds if stable(truck, speed)]
    if not speeds:
        slowest = 3.6 * min(planning.speeds)
        raise VehicleError(f"{truck.name}: unstable at {slowest:.0f} km/h by its file; check it, or drive slower")
    forecast = Forecast(truck, settings, speeds)
    noise = {name: variances.sensor(truck, name, settings.noise) for name in channels}
    tried = list(search(forecast, speeds, wants, noise, planning, progress))
    best, *others = [_proposal(one, planning.rate) for one in _chosen(tried, planning)]
    others = [one for one in others if all(one.verdicts[name] is Verdict.CONVERGED for name in wants)]
    left_out = [f"{3.6 * speed:.0f} km/h" for speed in planning.speeds if speed not in speeds]
    return Plan(
        vehicle=truck,
        wants=wants,
        channels=channels,
        rate=planning.rate,
        best=best,
        alternatives=tuple(others[: planning.alternatives]),
        unmet=_unmet(forecast, best, wants, noise, planning.rate),
        notes=(f"{truck.name}: unstable at {', '.join(left_out)} by its file, not tried there.",) if left_out else (),
    )


def _chosen(tried: Sequence[Tried], planning: Planning) -> list[Tried]:
    """Of each kind of manoeuvre the best drive, the best of all first.

    The shortest that tells enough, of those the gentlest; where none does, the shortest of those that come nearest.
    """
    least = min(one.worst for one in tried)
    met = least <= 1

    def key(one: Tried) -> tuple[float, float]:
        return round(one.duration, 6), one.acceleration if met else one.worst

    kinds: dict[str, Tried] = {}
    for one in sorted((one for one in tried if one.worst <= (1.0 if met else planning.near * least)), key=key):
        kinds.setdefault(one.manoeuvre.kind, one)
    return list(kinds.values())


def _channels(vehicle: Vehicle, channels: Sequence[str]) -> tuple[str, ...]:
    """The channels, or the usual ones, such that a fit can use them."""
    units, possible = [unit.name for unit in vehicle.units], possible_channels(vehicle)
    if not channels:
        return tuple(name for name in possible if not name.startswith("articulation."))
    for name in channels:
        if name not in possible:
            raise SignalError(f"{name}: no channel that a fit uses; those are {', '.join(possible)}")
    for unit in units:
        if not {f"yaw_rate.{unit}", f"articulation.{unit}"} & set(channels):
            raise SignalError(f"yaw_rate.{unit}: not among the channels; a fit needs it to know how the {unit} turns")
    return tuple(name for name in possible if name in channels)


def _usual(vehicle: Vehicle, settings: OneStage) -> dict[str, float]:
    """What is wanted if nothing is said."""
    sought = parameters.one_stage_sought(vehicle, settings)
    names = [name for name in parameters.stage_1_names(vehicle) if name in sought]
    if not names:
        raise VehicleError("wants: every cornering stiffness and yaw inertia is held; say what is wanted")
    return dict.fromkeys(names, USUAL)


def _seeking(vehicle: Vehicle, wants: Mapping[str, float], settings: OneStage) -> OneStage:
    """The settings, such that all is sought that is wanted."""
    for name, part in wants.items():
        if name in settings.held:
            raise VehicleError(f"{name}: held and wanted; hold it or want it")
        if not part > 0:
            raise VehicleError(f"{name}: expected a wanted sigma above 0, got {part:g}; no drive tells it exactly")
    sought = parameters.one_stage_sought(vehicle, settings)
    more = [name for name in wants if name not in sought]
    if not more:
        return settings
    seeking = replace(settings, free=(*sought, *more))
    parameters.one_stage_sought(vehicle, seeking)
    return seeking


def _as_fitted(vehicle: Vehicle, channels: Sequence[str], settings: OneStage) -> Vehicle:
    """The truck as a fit of such a drive takes it: only its first axle steers."""
    truck = locked_but(vehicle, vehicle.steer_signals()[:1], vehicle.name)
    still = to_record(truck, 20.0, np.zeros(200), 100.0, "plan")
    record = still.with_signals({name: np.zeros(200) for name in channels})
    return Drives([record], truck, replace(settings, check=False)).vehicle


def _proposal(one: Tried, rate: float) -> Proposal:
    manoeuvre = one.manoeuvre
    return Proposal(
        kind=manoeuvre.kind,
        frequency=manoeuvre.frequency,
        offset=one.offset,
        speed=manoeuvre.speed,
        repetitions=one.count,
        duration=one.duration,
        acceleration=one.acceleration,
        leading=one.size,
        steer=np.round(one.size * manoeuvre.repeated(one.steer, one.count, rate), 7) + 0.0,
        sigma=one.sigma,
        verdicts=one.verdicts,
    )


def _unmet(
    forecast: Forecast, best: Proposal, wants: Mapping[str, float], noise: Mapping[str, float], rate: float
) -> tuple[Shortfall, ...]:
    """What the best drive tells too little of, and why."""
    short = {name: part for name, part in wants.items() if best.sigma[name] > part}
    if not short:
        return ()
    record = to_record(forecast.vehicle, best.speed, best.steer, rate, best.kind)
    told = forecast.drive(Log(name=record.name, sections=[record], noise=dict(noise)), list(noise))
    extra = lane_change(forecast, speed=best.speed, rate=rate, channels=list(noise), noise=noise)
    remedies, found = Remedies(forecast, [told], extra, measurable=True), []
    for name, part in short.items():
        value = abs(forecast.vehicle.parameters()[name])
        changes = remedies.best(name, best.sigma[name] * value, enough=part * value, worth=0.1, most=2)
        found.append(
            Shortfall(
                name=name,
                wanted=part,
                sigma=best.sigma[name],
                verdict=best.verdicts[name],
                remedies=tuple(replace(change, sigma=change.sigma / value) for change in changes),
            )
        )
    return tuple(found)
