"""A vehicle file with what was measured: axle loads of a log, weighbridge slips, a roll test, ordinary driving."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from statistics import fmean
from typing import Any

from fifthwheel.base.errors import SignalError, VehicleError
from fifthwheel.base.formatting import enumerated, with_sigma
from fifthwheel.base.units import STANDARD_GRAVITY
from fifthwheel.data.channels import WEIGHTS, is_of
from fifthwheel.data.checks.axle_loads import PREFIX, StaticLoad, static_loads
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify.knowledge.load import laden_unit, with_payload
from fifthwheel.estimate.identify.mass import GrossMass, contradiction, gross_mass, mass_of_file
from fifthwheel.estimate.identify.verdict import Verdict
from fifthwheel.truck import RollTest, Vehicle, changes, with_axle_loads, with_roll_test
from fifthwheel.truck.catalogue import edited, with_numbers
from fifthwheel.truck.quantities import quantity_of
from fifthwheel.truck.slip import Lengths, Number, Slip, contradict, joined, weigh

TRACTOR, TRAILER = "tractor", "trailer"
"""First words of the results of `slip.weigh`."""
ON_BOARD_ACCURACY = 0.05
"""Of the axle loads of on-board weighing, as a fraction."""


@dataclass(frozen=True, kw_only=True)
class WeighedVehicle:
    """A vehicle with masses and CoG positions from the axle loads of a log or a slip."""

    vehicle: Vehicle
    loads: Mapping[str, StaticLoad]
    """By the path of the axle group."""
    text: str
    """The vehicle file with the new numbers, and its comments."""
    unused: tuple[str, ...] = ()
    """Weights in the log that are not the load of an axle group; `mass` uses them."""

    def as_dict(self) -> dict[str, Any]:
        """Loads, masses and CoG positions, for JSON."""
        return {
            "loads": {group: asdict(load) for group, load in self.loads.items()},
            "units": {unit.name: {"mass": unit.mass, "cog": unit.cog} for unit in self.vehicle.units},
            "unused": list(self.unused),
        }


def axle_load_differences(vehicle: Vehicle, records: Sequence[Record]) -> list[str]:
    """Axle loads in the logs that differ from the vehicle file by more than the accuracy of on-board weighing.

    A SignalError for an axle load with too few samples at rest or on a straight.
    """
    weighed = [record for record in records if any(name.startswith(PREFIX) for name in record.signals)]
    expected = vehicle.axle_loads() if weighed else {}
    return [
        f"{record.name}: {PREFIX}{group} is {load.value / 1e3:.1f} kN, the vehicle file gives "
        f"{expected[group] / 1e3:.1f} kN; `fifthwheel weigh` takes masses and CoG from the log"
        for record in weighed
        for group, load in static_loads(record).items()
        if group in expected and abs(load.value / expected[group] - 1) > ON_BOARD_ACCURACY
    ]


def weigh_by_slip(slip: Slip, text: str, *, name: str = "slip") -> WeighedVehicle:
    """Masses and CoG positions from weighbridge slips, with their standard deviations, in the text of a vehicle file.

    A number that the file states with its standard deviation is joined with that of the slip; one of the trailer that
    contradicts the slip is of another load, and replaced. Without an empty slip, the trailer without its load has the
    mass of the vehicle file. Inertias stay, unless the classes of the units give them. A VehicleError unless the
    vehicle is a tractor with two axle groups and a trailer with one, or if the loads are not complete, contradict each
    other, or contradict the stated tractor.
    """
    vehicle = Vehicle.loads(text)
    if [len(unit.axle_groups) for unit in vehicle.units] != [2, 1]:
        raise VehicleError(
            f"{vehicle.name}: expected a tractor with two axle groups and a trailer with one; set the masses and CoG"
            " positions of other vehicles by hand"
        )
    tractor, trailer = vehicle.units
    wheel, first = vehicle.couplings[0], tractor.axle_groups[0].position
    axles = [f"{trailer.name}.{axle.name}.position" for axle in trailer.axle_groups[0].axles]
    stated = [vehicle.stated[path] for path in axles if path in vehicle.stated]
    lengths = Lengths(
        wheelbase=first - tractor.axle_groups[1].position,
        coupling=(first - wheel.leading_position, vehicle.stated.get(f"{wheel.name}.leading_position")),
        trailer=(
            wheel.trailing_position - trailer.axle_groups[0].position,
            fmean(stated) if len(stated) == len(axles) else None,
        ),
    )
    sigmas = {change.name: abs(change.slopes.get(change.name, 0.0)) for change in changes(vehicle)}
    tare = trailer.mass - (trailer.payload.mass if trailer.payload else 0.0)
    tares: dict[str, Number] = {
        f"{TRACTOR}.mass": (tractor.mass, sigmas.get(f"{tractor.name}.mass")),
        f"{TRACTOR}.cog": (first - tractor.cog, sigmas.get(f"{tractor.name}.cog")),
        f"{TRAILER}.mass": (tare, quantity_of("mass").sigma * tare),
    }
    front, drive, bogie = vehicle.axle_loads()
    results = weigh(lengths, slip, (front, drive, bogie), tares)
    values: dict[str, Number] = {}
    now = vehicle.parameters()
    own = vehicle.stated.keys() - vehicle.assumed.keys()
    if f"weighed by {name}" in vehicle.source:  # they are of this slip
        own = set()

    def with_stated(path: str, weighed: Number) -> Number:
        if path not in own:
            return weighed
        stated = now[path], vehicle.stated[path]
        if not contradict(stated, weighed):
            return joined(stated, weighed)
        if path.startswith(f"{trailer.name}."):
            return weighed
        raise VehicleError(
            f"{path}: the file states {stated[0]:.5g} +- {stated[1]:.2g}, {name} gives {weighed[0]:.5g} +- "
            f"{weighed[1] or 0.0:.2g}; correct one of them"
        )

    for key, unit, origin in ((TRACTOR, tractor, first), (TRAILER, trailer, wheel.trailing_position)):
        cog, sigma_cog = results[f"{key}.cog"]
        is_weighed = key == TRAILER or bool(slip.solo)
        cog_path, mass_path = f"{unit.name}.cog", f"{unit.name}.mass"
        values[cog_path] = origin - cog, sigma_cog
        if is_weighed:  # else the CoG of the file is in the result already
            values[cog_path] = with_stated(cog_path, values[cog_path])
            values[mass_path] = with_stated(mass_path, results[f"{key}.mass"])
            if unit.payload is None:
                values[f"{unit.name}.sprung.mass"] = (unit.sprung.mass + values[mass_path][0] - unit.mass, None)
    if trailer.payload:
        payload = with_stated(f"{trailer.name}.payload.mass", results["payload.mass"])
        values[f"{trailer.name}.payload.mass"] = payload
        body = trailer.sprung.mass + values[f"{trailer.name}.mass"][0] - payload[0] - tare
        values[f"{trailer.name}.sprung.mass"] = (body, None)
    for path, (value, _) in values.items():
        if quantity_of(path).unit == "kg" and value <= 0:
            raise VehicleError(f"{path}: expected above 0 kg, got {value:.0f} kg from {name}; check it, and {path}")
    weighed = vehicle.replace(
        {path: round(value, 0 if quantity_of(path).unit == "kg" else 3) for path, (value, _) in values.items()}
    )
    weighed = weighed.with_stated({path: float(f"{sigma:.2g}") for path, (_, sigma) in values.items() if sigma})
    before, after = vehicle.parameters(), weighed.parameters()
    written = [
        path
        for path, (_, sigma) in values.items()
        if sigma or (after[path] != before[path] and path not in vehicle.assumed)
    ]
    assumed = {path: reason for path, reason in weighed.assumed.items() if path not in written}
    described = _with_source(weighed, f"weighed by {name}").model_copy(update={"assumed": assumed})
    new_text = with_numbers(text, described, written)
    newtons = {path: STANDARD_GRAVITY * load for path, load in slip.laden.items()}
    loads = {path: StaticLoad(value=load, scatter=slip.sigma(load), samples=1) for path, load in newtons.items()}
    return WeighedVehicle(vehicle=Vehicle.loads(new_text), loads=loads, text=new_text)


@dataclass(frozen=True, kw_only=True)
class DrivenVehicle:
    """A vehicle with the payload that follows from its gross mass, by ordinary driving, axle loads and weights."""

    vehicle: Vehicle
    result: GrossMass
    before: tuple[float, float]
    """Gross mass and its standard deviation by the vehicle file, kg."""
    text: str
    """The vehicle file with the new numbers, and its comments."""
    changed: Mapping[str, Mapping[str, float | None]]
    """The numbers of the vehicle file that follow the load; see `changed_numbers`."""

    @property
    def deviation(self) -> float:
        """Of the gross mass from that of the vehicle file, in joint standard deviations."""
        return self.result.deviation(*self.before)

    def as_dict(self) -> dict[str, Any]:
        """Masses and standard deviations, for JSON."""
        file = {"mass": self.before[0], "sigma": self.before[1], "deviation": self.deviation}
        return {"gross_mass": asdict(self.result), "vehicle_file": file, "changed": self.changed}


def drive_vehicle(records: Sequence[Record], text: str) -> DrivenVehicle:
    """The vehicle of a file with the payload, and with axle loads the CoG, of its laden unit in logs; see
    `estimate.identify.mass`.

    The other masses stay, and so do their standard deviations. The mass of the laden unit has the joint standard
    deviation of the measurements and the other units; its body keeps its own. A SignalError if the logs do not
    determine the mass, or driving and weights contradict each other; a VehicleError unless one unit has a payload, or
    if the gross mass leaves nothing for it.
    """
    vehicle = Vehicle.loads(text)
    result, before = gross_mass(records, vehicle), mass_of_file(vehicle)
    if result.verdict is Verdict.DOUBTFUL:
        raise SignalError(f"{enumerated([record.name for record in records])}: {contradiction(result)}")
    if result.verdict is not Verdict.CONVERGED:
        raise SignalError(
            f"{records[0].name}: the gross mass is {with_sigma(result.mass / 1e3, result.sigma / 1e3, 't')}, which is"
            " not better than a guess; log a drive with gear changes and accelerations"
        )
    unit, load = laden_unit(vehicle)
    (mass, of_mass), (cog, of_cog) = (result.units[f"{unit.name}.{key}"] for key in ("mass", "cog"))
    payload, stated = load + mass - unit.mass, {f"{unit.name}.mass": of_mass}
    if payload <= 0:
        raise VehicleError(
            f"{vehicle.name}: the gross mass is {result.mass:.0f} kg, less than the {before[0] - load:.0f} kg"
            " without payload in the vehicle file; correct its unladen masses, or remove the payload"
        )
    loaded = with_payload(vehicle, payload, cog=cog if "weights" in result.sources else None)
    if "weights" in result.sources:
        stated[f"{unit.name}.cog"] = of_cog
    body = f"{unit.name}.sprung.mass"
    if body not in loaded.stated:
        stated[body] = quantity_of("mass").sigma * unit.sprung.mass
    assumed = {path: reason for path, reason in loaded.assumed.items() if path not in stated or path == body}
    loaded = _with_source(loaded.with_stated(stated), f"mass by {', '.join(record.name for record in records)}")
    loaded = _rounded(loaded.model_copy(update={"assumed": assumed}), vehicle)
    return DrivenVehicle(
        vehicle=loaded,
        result=result,
        before=before,
        changed=changed_numbers(vehicle, loaded),
        text=edited(text, loaded),
    )


def _with_source(vehicle: Vehicle, added: str) -> Vehicle:
    return vehicle.model_copy(update={"source": f"{vehicle.source}; {added}".removeprefix("; ")})


def _rounded(vehicle: Vehicle, before: Vehicle) -> Vehicle:
    """The changed numbers with 6 digits, where that is within 0.01 sigma, and their standard deviations with 3."""
    values, old = vehicle.parameters(), before.parameters()
    short = {p: float(f"{v:.6g}") for p, v in values.items() if v != old.get(p)}
    exact = {p for p, v in short.items() if abs(v - values[p]) > 0.01 * vehicle.stated.get(p, math.inf)}
    fields = vehicle.fields_with({p: v for p, v in short.items() if p not in exact})
    fields["stated"] = {p: s if s == before.stated.get(p) else float(f"{s:.3g}") for p, s in vehicle.stated.items()}
    return Vehicle(**fields)


def weigh_vehicle(record: Record, text: str, *, tolerance: float = 0.02) -> WeighedVehicle:
    """Masses and CoG positions from the axle loads of a log, in the text of a vehicle file; inertias stay.

    `tolerance` is the allowed difference of the front axle's load from the expected one, as a fraction of the tractor's
    load. A SignalError for a log without axle loads or with one of an unknown group, a VehicleError if they contradict
    each other.
    """
    vehicle = Vehicle.loads(text)
    groups = vehicle.axle_loads()
    of_units = {unit.name for unit in vehicle.units} - set(groups)  # a trailer with one axle group has its name
    loads = {group: load for group, load in static_loads(record).items() if group not in of_units}
    weights = [name for name in record.signals if is_of(name, *WEIGHTS)]
    weighed_groups = {f"{PREFIX}{group}" for group in loads}
    unused = tuple(name for name in weights if name not in weighed_groups)
    for group in loads:
        if group not in groups:
            raise SignalError(
                f"{PREFIX}{group}: {vehicle.name} has no axle group {group}; it has {', '.join(groups)}; correct the "
                "name in signals.toml"
            )
    weighed = with_axle_loads(vehicle, {group: load.value for group, load in loads.items()}, tolerance=tolerance)
    weighed = _rounded(_with_source(weighed, f"weighed by {record.name}"), vehicle)
    return WeighedVehicle(vehicle=weighed, loads=loads, text=edited(text, weighed), unused=unused)


def roll_tested_vehicle(vehicle: Vehicle, test: RollTest) -> Vehicle:
    """The vehicle with the result of a roll test; see `truck.roll_test`.

    Other numbers have the standard deviations that the vehicle file states, or else the default ones. A VehicleError if
    the test is not plausible, or does not suit the vehicle.
    """
    rows = {path: (quantity_of(path), value) for path, value in vehicle.parameters().items()}
    sigmas = {path: row.sigma_of(value) for path, (row, value) in rows.items() if row.is_uncertain and value}
    slopes = {path: slope for change in changes(vehicle) for path, slope in change.slopes.items()}
    masses = {path: abs(slope) for path, slope in slopes.items() if quantity_of(path).unit == "kg"}
    tested = with_roll_test(vehicle, test, {**sigmas, **masses, **vehicle.stated})
    return _rounded(_with_source(tested, f"roll test of the {test.unit}"), vehicle)


def changed_numbers(before: Vehicle, after: Vehicle) -> dict[str, dict[str, float | None]]:
    """Value and sigma, SI, of every number by its path that a measurement has changed, and its value before."""
    old, new = before.parameters(), after.parameters()
    changed = [path for path in new if (new[path], after.stated.get(path)) != (old.get(path), before.stated.get(path))]
    return {p: {"value": new[p], "sigma": after.stated.get(p), "before": old.get(p)} for p in changed}
