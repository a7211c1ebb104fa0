"""Three logs of a third party's simulator: identify on one, predict the others.

    python benchmarks/carla.py [FOLDER]

Abhijeet Behera's Collision-Risk-Assessment-of-Tractor-Semitrailer drove a DAF XF95 with semitrailers of 11, 13 and 15 m
in CARLA 0.9.14 (PhysX): one sharp change of lane at 10 to 14 m/s, until a car hits the trailer. The logs are no part of
this project; FOLDER is by default $FIFTHWHEEL_DATA/carla, or shared/data/carla beside the checkout.

Geometry comes from each log's own motion, by least squares (`measure`). CARLA tells the position of an actor's origin,
on the road, and the velocity of its centre of mass; they differ by lever times yaw rate and roll rate, which gives the
centre's place and height. Both origins hang on one pin. A trailer's axle slides in proportion to its side force; so one
number of each log's lateral velocity, that axle's place, is in its truck, predicted or not. Masses, tyres, inertias are
assumed (`truck`); half or three times the trailer's mass moves the per cent explained of predicted logs by up to 6.

Expect no more than a mean tyre: the front wheels jump to 5 deg in one row and slip by 4. Roll is there but not used:
the trailer's centre, 2.6 to 2.8 m high, rolls by 5 deg, while the tractor leans a little into the turn, which none does
in the yaw-roll model. Sideslip is compared on the road under the centre, where a yaw model has it.
"""

import argparse
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fifthwheel import dynamics
from fifthwheel.identify import Identification, TwoStage, identify
from fifthwheel.identify.fit import fits
from fifthwheel.identify.parameters import nuisances
from fifthwheel.identify.stage import Log
from fifthwheel.logs import Record
from fifthwheel.observe import Observer, ObserverSettings
from fifthwheel.vehicle import Axle, AxleGroup, Coupling, SprungMass, Unit, Vehicle

Array = NDArray[np.float64]
FOLDER = Path(os.environ.get("FIFTHWHEEL_DATA", Path(__file__).resolve().parents[2] / "shared" / "data")) / "carla"
UNITS = ("tractor", "semitrailer")
CHANNELS = ("yaw_rate.tractor", "yaw_rate.semitrailer", "articulation.semitrailer")
SETTINGS = TwoStage(  # a simulator's sensors have no zeros; what is left is which of the front wheels was logged
    steer_gain_prior=0.05, steer_offset_prior=0.001, rate_offset_prior=0.0005, articulation_offset_prior=0.001
)
STEP = 0.05  # s between rows; positions and velocities agree with it to 0.03 %
JUMP = 0.006  # rad from row to row: the steering begins so, and goes so fast again only when the car has hit
SEAM = 192.0  # m east, where the road lifts the front wheels


@dataclass(frozen=True, kw_only=True)
class Geometry:
    """What a log's motion tells of its truck: x from each actor's origin, m; the trailer's origin is the kingpin."""

    cog: Mapping[str, float]
    height: Mapping[str, float]  # of the centre of mass above the road
    hitch: float  # on the tractor
    trailer_axle: float

    def __str__(self) -> str:
        centres = ", ".join(f"{unit}'s centre {self.cog[unit]:.2f} ({self.height[unit]:.2f} high)" for unit in UNITS)
        return f"hitch {self.hitch:.2f}, trailer's axle {self.trailer_axle:.2f}, {centres} m"


@dataclass(frozen=True, kw_only=True)
class Drive:
    """One log, and its truck as far as it is known before."""

    record: Record
    geometry: Geometry
    truck: Vehicle


class Motion:
    """One unit as it moves, ISO 8855, (N,); what begins with "mean" is a mean from row to row, (N - 1,).

    CARLA's y, yaw and steer angle count right positive; its roll, right side down, is that of ISO 8855.
    """

    def __init__(self, table: NDArray[np.void], k: int) -> None:
        self.yaw, self.roll, self.pitch = -np.unwrap(table[f"yaw{k}"]), table[f"roll{k}"], table[f"pitch{k}"]
        self.position = table[f"x{k}"] - 1j * table[f"y{k}"]  # of the origin
        velocity = table[f"vGx{k}"] - 1j * table[f"vGy{k}"]  # of the centre of mass, m/s
        self.ahead = np.exp(1j * self.yaw)
        self.forward, self.lateral = (velocity / self.ahead).real, (velocity / self.ahead).imag
        self.yaw_rate, self.roll_rate = np.gradient(self.yaw, STEP), np.gradient(self.roll, STEP)
        self.mean_yaw_rate, self.mean_roll_rate = np.diff(self.yaw) / STEP, np.diff(self.roll) / STEP
        self.mean_lateral = (self.lateral[1:] + self.lateral[:-1]) / 2
        step = STEP * np.exp(0.5j * (self.yaw[1:] + self.yaw[:-1]))
        self.mean_acceleration = (np.diff(velocity) / step).imag
        self.mean_origin = np.diff(self.position) / step  # forward + i left


def read(path: Path) -> Drive:
    """A log from 1 s before the steering begins to 0.2 s before it answers the car's hit."""
    table, length = np.genfromtxt(path, delimiter=",", names=True), float(path.stem.split("_")[-2])
    jumps = np.flatnonzero(np.abs(np.diff(table["delta"])) > JUMP)
    begin, hit = jumps[0], jumps[jumps > jumps[0] + 1 / STEP][0]
    rows = slice(begin - round(1 / STEP), hit - round(0.2 / STEP))
    smooth = slice(rows.start, int(np.flatnonzero(table["x1"] > SEAM)[0]))
    tractor, trailer = (Motion(table, k) for k in (1, 2))
    signals = {
        "speed": tractor.forward,
        "steer.tractor.front": -table["delta"],
        "yaw_rate.tractor": tractor.yaw_rate,
        "yaw_rate.semitrailer": trailer.yaw_rate,
        "articulation.semitrailer": trailer.yaw - tractor.yaw,
    }
    geometry, reference = measure(tractor, trailer, length, rows, smooth), dict[str, Array]()
    for unit, m in zip(UNITS, (tractor, trailer), strict=True):
        lateral = m.lateral + geometry.height[unit] * m.roll_rate  # of the point on the road under the centre of mass
        reference |= {f"lateral_velocity.{unit}": lateral, f"sideslip.{unit}": np.arctan2(lateral, m.forward)}
    record = Record(
        time=STEP * (np.arange(len(table)) - begin)[rows],
        signals={name: values[rows] for name, values in signals.items()},
        reference={name: values[rows] for name, values in reference.items()},
        name=f"{length:g} m",
    )
    return Drive(record=record, geometry=geometry, truck=truck(geometry, length))


def measure(tractor: Motion, trailer: Motion, length: float, rows: slice, smooth: slice) -> Geometry:
    """Geometry from how the units move; the axle's from the rows before the road's seam."""
    cog, height = dict[str, float](), dict[str, float]()
    for unit, m in zip(UNITS, (tractor, trailer), strict=True):  # v_centre - v_origin = x r - z p
        apart = (m.mean_lateral - m.mean_origin.imag)[rows]
        cog[unit], height[unit] = solve([m.mean_yaw_rate[rows], -m.mean_roll_rate[rows]], apart)
    # the pin, origin + x ahead + z (back by pitch, right by roll), is one point of both units
    up = [-m.ahead * (m.pitch + 1j * m.roll) for m in (tractor, trailer)]
    columns = [plane[rows] for plane in (tractor.ahead, -trailer.ahead, up[0] - up[1])]
    between = (trailer.position - tractor.position)[rows]
    hitch, kingpin, _ = solve([np.append(c.real, c.imag) for c in columns], np.append(between.real, between.imag))
    # at the axle v = -V F / C, and F (pin to axle) = m a_y (pin to centre) - I r', with a box's I = m length^2 / 12
    turn, v = trailer.mean_yaw_rate, trailer.mean_origin
    force = -cog["semitrailer"] * trailer.mean_acceleration - length**2 / 12 * np.gradient(turn, STEP)
    axle, _ = solve([-turn[smooth], (v.real * force)[smooth]], v.imag[smooth])
    return Geometry(cog=cog, height=height, hitch=hitch - kingpin, trailer_axle=axle)


def solve(columns: Sequence[Array], target: Array) -> list[float]:
    """Factors of the columns that come closest to the target."""
    return [float(x) for x in np.linalg.lstsq(np.column_stack(columns), target, rcond=None)[0]]


def truck(geometry: Geometry, length: float) -> Vehicle:
    """The truck of a log, with what is assumed of it.

    Masses are not published, and only their ratio matters to a yaw model: an empty trailer as heavy as the tractor. The
    wheelbase is 3.6 m, common for a 4x2, from 0.95 m ahead of the actor's origin; the fifth wheel is then 0.5 m ahead
    of the drive axle. Yaw inertia is m (0.4 wheelbase)^2, and a box's m length^2 / 12. Tyres begin at 15.7 times the
    static load a radian, which PhysX is believed to have by default. Roll only goes into the sigmas.
    """
    mass, wheelbase, roll_stiffness = 7500.0, 3.6, (1e6, 6e5)
    axles = ({"front": 0.95, "drive": 0.95 - wheelbase}, {"axles": geometry.trailer_axle})
    square_radius = ((0.4 * wheelbase) ** 2, length**2 / 12)
    units = [
        Unit(
            name=name,
            mass=mass,
            cog=geometry.cog[name],
            yaw_inertia=mass * square_radius[i],
            roll_axis_height=0.8,
            sprung=SprungMass(mass=0.85 * mass, cog_height=geometry.height[name], roll_inertia=mass),
            axle_groups=tuple(
                AxleGroup(
                    name=group,
                    axles=(Axle(name=group, position=x, steerable=group == "front"),),
                    cornering_stiffness=1e5,  # until the loads are known
                    roll_stiffness=roll_stiffness[i] / len(axles[i]),
                    tyre_roll_stiffness=10 * roll_stiffness[i],
                    roll_damping=roll_stiffness[i] / 20,
                )
                for group, x in axles[i].items()
            ),
        )
        for i, name in enumerate(UNITS)
    ]
    pin = Coupling(leading_position=geometry.hitch, trailing_position=0.0, height=1.0, roll_stiffness=0.0)
    guess = Vehicle(name=f"DAF XF95 in CARLA, {length:g} m", units=tuple(units), couplings=(pin,))
    return guess.replace({f"{group}.cornering_stiffness": 15.7 * load for group, load in guess.axle_loads().items()})


@dataclass(frozen=True, kw_only=True)
class Found:
    """What is carried from the logs identified on to another: nothing that belongs to one log alone."""

    factors: Mapping[str, float]  # on the value that `truck` assumes
    steering: Mapping[str, float]  # gain and delay
    noise: Mapping[str, float]  # variances

    @classmethod
    def of(cls, results: Sequence[Identification]) -> "Found":
        """One identification's, or the mean of several weighted by their sigmas (factors by their logarithm)."""
        factors, steering = {}, {}
        for alike in zip(*[result.parameters for result in results], strict=True):
            weights = [(e.value / (e.sigma or np.inf)) ** 2 for e in alike]
            factors[alike[0].name] = np.exp(np.average([np.log(e.value / e.initial) for e in alike], weights=weights))
        for alike in zip(*[[e for e in result.sensors if e.log is None] for result in results], strict=True):
            steering[alike[0].name] = np.average([e.value for e in alike], weights=[e.sigma**-2 for e in alike])
        noise = {name: float(np.mean([result.logs[0].noise[name] for result in results])) for name in CHANNELS}
        return cls(factors=factors, steering=steering, noise=noise)

    def truck(self, drive: Drive) -> Vehicle:
        """A log's truck with what was found: tyres go with the static load, the trailer's inertia with m length^2."""
        assumed = drive.truck.parameters()
        return drive.truck.replace({name: factor * assumed[name] for name, factor in self.factors.items()})

    def explained(self, drive: Drive) -> dict[str, float]:
        """Per cent of each channel's variance, running free: `identify(validate=...)`, but on the log's own truck."""
        vehicle = self.truck(drive)
        log = Log(name=drive.record.name, sections=[drive.record], noise=dict(self.noise))
        model, zeros = dynamics.model(vehicle, CHANNELS, roll=False), nuisances(vehicle, CHANNELS, SETTINGS)
        told = fits(model, vehicle, log, zeros, values=self.steering, identified_on=False)
        return {fit.signal: 100 * fit.explained for fit in told}

    def sideslip(self, drive: Drive) -> dict[str, tuple[float, float]]:
        """Of both units, deg, from where steering begins: the observer's rms error, the truth's standard deviation."""
        record, settings, told = drive.record, ObserverSettings(zeros=self.steering, noise=self.noise), {}
        states = Observer(self.truck(drive), record.signals, settings).batch(record)
        for name in ("sideslip.tractor", "sideslip.semitrailer"):
            truth, seen = (np.degrees(values[name][record.time >= 0]) for values in (record.reference, states.values))
            told[name] = float(np.sqrt(np.mean((seen - truth) ** 2))), float(truth.std())
        return told


def main() -> None:
    """Print what was identified on each log, and the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="?", default=FOLDER)
    folder = parser.parse_args().folder
    if not (drives := [read(path) for path in sorted(folder.glob("vehicle_dataLateral_*.csv"))]):
        parser.error(f"{folder}: no vehicle_dataLateral_*.csv; name the folder they are in, or set FIFTHWHEEL_DATA")
    results = {drive.record.name: identify([drive.record], drive.truck, SETTINGS) for drive in drives}
    for drive in drives:
        print(f"{drive.record.name}: {drive.record.span[1]:.2f} s from where steering begins; {drive.geometry}")
        for e in results[drive.record.name].parameters:
            print(f"  {e.name:35s} {e.value:9.3g} +- {e.sigma or np.nan:7.2g}, assumed {e.initial:8.3g}, {e.verdict}")
    print(f"\n{'':18s}{'explained, %':>20s}{'sideslip, deg: rms error (deviation)':>46s}")
    print(f"identified on log  {'tractor':>9s}{'trailer':>9s}{'artic.':>9s}   {'tractor':>12s}{'trailer':>17s}")
    for used in [*[[name] for name in results], [*results]]:
        found = Found.of([results[name] for name in used])
        for drive in drives:
            log = drive.record.name + ("*" if drive.record.name in used else "")
            explained = "".join(f"{found.explained(drive)[channel]:9.1f}" for channel in CHANNELS)
            sideslip = "".join(f"{rms:10.2f} ({deviation:.2f})" for rms, deviation in found.sideslip(drive).values())
            print(f"{'mean of all' if len(used) > 1 else used[0]:14s}{log:5s}{explained}{sideslip}")
    print("* identified on it, else predicted")


if __name__ == "__main__":
    main()
