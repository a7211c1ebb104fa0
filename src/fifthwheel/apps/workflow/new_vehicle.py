"""A vehicle file from a brochure, a tape measure and the slips of a weighbridge."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from fifthwheel.base.errors import VehicleError, suggestion
from fifthwheel.truck import Vehicle
from fifthwheel.truck.catalogue import commented_toml
from fifthwheel.truck.classes import CLASSES, TYRES, complete
from fifthwheel.truck.quantities import quantity_of
from fifthwheel.truck.slip import CONTRADICTION, Lengths, Number, Slip, weigh, weigh_solo
from fifthwheel.truck.weighing import COUPLING_RANGE, MAX_SOLO

TRACTOR, TRAILER, COUPLING = "tractor", "semitrailer", "fifth_wheel"
MEASURED, WEIGHED, BROCHURE, GIVEN = "measured", "weighbridge", "brochure", "given"
TARE_SIGMA = 0.03
"""Standard deviation of the mass in a brochure, as a fraction: equipment, driver and fuel differ. A load
without a standard deviation has it too where it is compared with slips."""
HEIGHT_SIGMA = 0.2
"""Standard deviation of a height of the load that is stated without one, as a fraction. A uniform load has its CoG at
half of its height; loads are not uniform, and the standard deviation of the CoG is 10 % of the height."""


@dataclass(frozen=True, kw_only=True)
class Description:
    """What a user knows of a tractor-semitrailer. Numbers are value and standard deviation, SI; None: not known."""

    name: str = "truck"
    tractor: str
    """Class of the tractor."""
    trailer: str
    """Class of the semitrailer."""
    wheelbase: Number
    """From the front axle to the first axle behind it, m."""
    tractor_spread: Number = (1.35, None)
    """Between the rear axles of a three-axle tractor, m."""
    fifth_wheel: Number | None = None
    """From the front axle to the kingpin, m; None: the slips determine it."""
    trailer_wheelbase: Number
    """From the kingpin to the middle of the trailer's axles, m."""
    trailer_spread: Number = (1.31, None)
    """Between neighbouring axles of the trailer, m."""
    slip: Slip = field(default_factory=Slip)
    """Loads by the weighbridge; paths as in the vehicle file."""
    tractor_tare: Number | None = None
    """Mass of the tractor in the brochure, kg."""
    trailer_tare: Number | None = None
    """Mass of the trailer without load, kg."""
    load_mass: Number | None = None
    """Mass of the load, kg; 0: the trailer is unladen; None: it follows from the slips."""
    load_height: Number | None = None
    """From the floor to the top of the load, m."""
    load_width: Number | None = None
    floor_height: Number | None = None
    load_shape: str = "uniform"
    """Or "point"."""
    trailer_tyres: str | None = None
    """One of `TYRES`; None: not known."""


def new_vehicle(description: Description) -> str:
    """The text of a vehicle file, with the uncertainty and the source of each number.

    A VehicleError if a class is not one of a tractor or semitrailer, the slip contradicts itself, or a number is not
    valid.
    """
    _check(description)
    builder = _Builder(description)
    fields = builder.fields()
    vehicle = Vehicle(**complete(fields))
    return commented_toml(vehicle, builder.sources)


class _Builder:
    """Fields of a vehicle from a description, with standard deviations and sources."""

    def __init__(self, description: Description) -> None:
        self.known = description
        self.stated: dict[str, float] = {}
        self.sources: dict[str, str] = {}

    def fields(self) -> dict[str, Any]:
        """Fields of the vehicle, without the numbers that its classes give."""
        known = self.known
        tractor: dict[str, Any] = {"name": TRACTOR, "vehicle_class": known.tractor}
        trailer: dict[str, Any] = {"name": TRAILER, "vehicle_class": known.trailer}
        tractor["axle_groups"] = [
            {"name": "front", "axles": [self._axle(TRACTOR, "front", (0.0, None), "the origin")]},
            {"name": "drive", "axles": list(self._rear_axles())},
        ]
        trailer["axle_groups"] = [self._trailer_group()]
        coupling: dict[str, Any] = {"name": COUPLING}
        self._set(coupling, COUPLING, "trailing_position", (0.0, None), "the origin")
        laden = known.load_mass is None or known.load_mass[0] > 0
        if laden:
            trailer["payload"] = self._payload()
        self._masses(tractor, trailer, coupling)
        fields: dict[str, Any] = {
            "name": known.name,
            "source": f"{known.tractor} and {known.trailer}: measured, weighed and assumed from classes",
            "units": [tractor, trailer],
            "couplings": [coupling],
        }
        return fields | {"stated": self.stated}

    def _set(self, table: dict[str, Any], path: str, key: str, number: Number | None, source: str) -> None:
        if number is None:
            return
        table[key] = number[0]
        self.sources[f"{path}.{key}"] = source
        if number[1] is not None:
            self.stated[f"{path}.{key}"] = number[1]

    def _axle(self, unit: str, name: str, number: Number, source: str) -> dict[str, Any]:
        axle: dict[str, Any] = {"name": name}
        self._set(axle, f"{unit}.{name}", "position", number, source)
        return axle

    def _rear_axles(self) -> Iterator[dict[str, Any]]:
        count = CLASSES[self.known.tractor].axle_counts[1]
        names = ("drive",) if count == 1 else tuple(f"drive_{k + 1}" for k in range(count))
        for k, name in enumerate(names):
            yield self._axle(TRACTOR, name, _position(self.known.wheelbase, self.known.tractor_spread, k), MEASURED)

    def _trailer_group(self) -> dict[str, Any]:
        count = CLASSES[self.known.trailer].axle_counts[0]
        middle, spread = self.known.trailer_wheelbase, self.known.trailer_spread
        names = {1: ("axle",), 2: ("front", "rear"), 3: ("front", "middle", "rear")}[count]
        positions = [_position(middle, spread, k - (count - 1) / 2) for k in range(count)]
        axles = [self._axle(TRAILER, name, x, MEASURED) for name, x in zip(names, positions, strict=True)]
        group: dict[str, Any] = {"name": "axles", "axles": axles}
        if self.known.trailer_tyres:
            figure = TYRES[self.known.trailer_tyres]
            group["tyres"] = count * (4 if self.known.trailer_tyres == "twin" else 2)
            number = (count * figure.value, count * figure.sigma)
            self._set(
                group, TRAILER, "tyre_roll_stiffness", number, f"{self.known.trailer_tyres} tyres: {figure.source}"
            )
        return group

    def _payload(self) -> dict[str, Any]:
        known, path = self.known, f"{TRAILER}.payload"
        payload: dict[str, Any] = {"shape": known.load_shape}
        self._set(payload, path, "mass", known.load_mass, GIVEN)
        if known.load_height is not None:
            height, sigma = known.load_height
            self._set(payload, path, "height", (height, HEIGHT_SIGMA * height if sigma is None else sigma), MEASURED)
        self._set(payload, path, "width", known.load_width, MEASURED)
        self._set(payload, path, "floor_height", known.floor_height, MEASURED)
        return payload

    def _masses(self, tractor: dict[str, Any], trailer: dict[str, Any], coupling: dict[str, Any]) -> None:
        """Masses, CoG positions and the position of the fifth wheel: weighed, or by the brochure."""
        known = self.known
        payload = trailer.get("payload", {})
        position = known.fifth_wheel
        if position is not None:
            self._set(coupling, COUPLING, "leading_position", (-position[0], position[1]), MEASURED)
        rear = [axle["position"] for axle in tractor["axle_groups"][1]["axles"]]
        lengths = Lengths(wheelbase=-sum(rear) / len(rear), coupling=position, trailer=known.trailer_wheelbase)
        groups = (f"{TRACTOR}.front", f"{TRACTOR}.drive", TRAILER)
        if not known.slip.laden:
            if known.slip.solo:
                results = weigh_solo(lengths, known.slip, groups)
                _check_solo(known.slip.solo, *groups[:2])
                self._weighed(tractor, TRACTOR, results["tractor.mass"], results["tractor.cog"])
            self._unweighed(tractor, trailer)
            return
        results = weigh(lengths, known.slip, groups, self._tares(lengths))
        _check_solo(known.slip.solo, *groups[:2])
        if "coupling" in results:
            _check_coupling(results["coupling"][0], lengths.wheelbase, groups)
        _check_load(known, results)
        for key, unit, name in (("tractor", tractor, TRACTOR), ("trailer", trailer, TRAILER)):
            if key == "trailer" or known.slip.solo:
                self._weighed(unit, name, results[f"{key}.mass"], results[f"{key}.cog"])
            else:
                cog, sigma = results["tractor.cog"]
                self._set(unit, name, "mass", known.tractor_tare, BROCHURE)
                self._set(unit, name, "cog", (-cog, sigma), f"{WEIGHED}: moments of the laden tractor")
        if "coupling" in results:
            where, sigma = results["coupling"]
            self._set(coupling, COUPLING, "leading_position", (-where, sigma), f"{WEIGHED}: moments of the tractor")
        if "payload.mass" in results and payload and "mass" not in payload:
            if results["payload.mass"][0] <= 0:
                raise VehicleError(
                    f"payload.mass: expected above 0 kg, got {results['payload.mass'][0]:.0f} kg from the slips; give a"
                    " load of 0 if the trailer is unladen"
                )
            source = f"{WEIGHED}, laden less {'empty' if known.slip.empty else 'the unladen mass by the ' + BROCHURE}"
            self._set(payload, f"{TRAILER}.payload", "mass", results["payload.mass"], source)

    def _weighed(self, unit: dict[str, Any], name: str, mass: Number, cog: Number) -> None:
        """Mass, kg, and CoG behind the origin, m, of a unit."""
        self._set(unit, name, "mass", mass, WEIGHED)
        self._set(unit, name, "cog", (-cog[0], cog[1]), WEIGHED)

    def _unweighed(self, tractor: dict[str, Any], trailer: dict[str, Any]) -> None:
        """Masses by the brochure; there is none of a tractor that was weighed."""
        known = self.known
        if known.fifth_wheel is None:
            raise VehicleError("fifth_wheel: expected its distance from the front axle, got none; measure it")
        self._set(tractor, TRACTOR, "mass", known.tractor_tare, BROCHURE)
        if "payload" in trailer and known.load_mass is None:
            raise VehicleError("load_mass: expected a mass, got none; give it or the laden slip; 0 for no load")
        if known.trailer_tare is not None:
            load = known.load_mass if known.load_mass is not None else (0.0, None)
            sigma = sum((s or 0.0) ** 2 for s in (known.trailer_tare[1], load[1])) ** 0.5
            number = (known.trailer_tare[0] + load[0], sigma or None)
            self._set(trailer, TRAILER, "mass", number, f"{BROCHURE} and load")

    def _tares(self, lengths: Lengths) -> dict[str, Number]:
        kind, known = CLASSES[self.known.tractor], self.known
        return {
            "tractor.mass": known.tractor_tare or (kind.tare.value, kind.tare.sigma),
            "tractor.cog": (kind.cog.value * lengths.wheelbase, kind.cog.sigma * lengths.wheelbase),
            **({"trailer.mass": known.trailer_tare} if known.trailer_tare else {}),
        }


def _position(distance: Number, spread: Number, count: float) -> Number:
    """Position of an axle, m, so many spreads behind a distance from the origin."""
    (x, sigma), (step, sigma_step) = distance, spread
    if sigma_step is not None and sigma is None:
        sigma = quantity_of("axle_positions").sigma
    return -x - count * step, None if sigma is None else math.hypot(sigma, count * (sigma_step or 0.0))


def _check_solo(loads: Mapping[str, float], front: str, drive: str) -> None:
    if {front, drive} <= loads.keys() and loads[drive] > MAX_SOLO * (loads[front] + loads[drive]):
        raise VehicleError(
            f"solo: expected less on {drive} than on {front}, got {loads[drive]:g} and {loads[front]:g} kg; correct"
            " the loads"
        )


def _check_coupling(coupling: float, wheelbase: float, groups: tuple[str, ...]) -> None:
    low, high = (ratio * wheelbase for ratio in COUPLING_RANGE)
    if not low <= coupling <= high:
        raise VehicleError(
            f"laden: expected a kingpin {low:.2f} to {high:.2f} m behind the front axle, got {coupling:.2f} m from the"
            f" laden and solo loads; correct the loads ({', '.join(groups)}), or the wheelbase"
        )


def _check_load(known: Description, results: Mapping[str, Number]) -> None:
    """Whether the slips less the unladen mass give the stated load."""
    if known.load_mass is None or "payload.mass" not in results:
        return
    (weighed, sigma_weighed), (load, sigma) = results["payload.mass"], known.load_mass
    sigma = TARE_SIGMA * load if sigma is None else sigma
    if abs(weighed - load) > CONTRADICTION * math.hypot(sigma_weighed or 0.0, sigma) + 1:  # kg, for exact numbers
        mass = results["trailer.mass"][0]
        raise VehicleError(
            f"load_mass: expected {weighed:.0f} kg, because the trailer has {mass:.0f} kg by the laden slip and"
            f" {mass - weighed:.0f} kg without load by {'the empty slip' if known.slip.empty else 'trailer_tare'}, got"
            f" {load:.0f} kg; correct one of the three"
        )


def _check(description: Description) -> None:
    for key, prefix in (("tractor", TRACTOR), ("trailer", TRAILER)):
        names = [name for name in CLASSES if name.startswith(prefix)]
        name = getattr(description, key)
        if name not in names:
            raise VehicleError(f"{key}: no such class {name!r}; {suggestion(name, names)}")
    if description.trailer_tyres not in (None, *TYRES):
        raise VehicleError(
            f"trailer_tyres: expected {' or '.join(TYRES)}, got {description.trailer_tyres!r}; correct it"
        )
    if description.load_shape not in ("uniform", "point"):
        raise VehicleError(f"load_shape: expected uniform or point, got {description.load_shape!r}; correct it")
