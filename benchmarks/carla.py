"""Three logs of another simulator: identify on one, predict the others.

    python benchmarks/carla.py [FOLDER]

Abhijeet Behera's Collision-Risk-Assessment-of-Tractor-Semitrailer simulates a DAF XF95 with semitrailers of 11, 13 and
15 m in CARLA 0.9.14 (PhysX): one sharp lane change at 10 to 14 m/s, until a car hits the trailer. The logs are not part
of this project; FOLDER is by default $FIFTHWHEEL_DATA/carla, or shared/data/carla beside the checkout.

The geometry follows from the motion in each log by least squares (`measure_geometry`). CARLA logs the position of the
origin of an actor, on the road, and the velocity of its centre of mass. The two velocities differ by lever arms times
yaw rate and roll rate, which gives the position and the height of the CoG. Both units share the kingpin. The lateral
velocity of the trailer axle is proportional to its side force. The position of this axle thus contains information from
each log, also from a predicted one. Masses, tyres and inertias are assumed (`assumed_truck`); half or three times the
mass of the trailer changes the explained variance of predicted logs by up to 6 per cent.

The estimated stiffness is that of an average tyre: the front wheels step to 5 deg in one row and reach a slip angle of
4 deg. The model has no roll: the CoG of the trailer, 2.6 to 2.8 m high, rolls by 5 deg, but the tractor rolls slightly
into the turn, which a yaw-roll model cannot describe. Sideslip is compared at the road below the CoG.
"""

import argparse
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fifthwheel.apps.cheng_cebon_2011 import TwoStage
from fifthwheel.apps.cheng_cebon_2011.estimator import free_run_setup
from fifthwheel.base.types import Array
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify import Identification, identify
from fifthwheel.estimate.identify.dataset import LogData
from fifthwheel.estimate.identify.fits import free_run_fits
from fifthwheel.estimate.observe import Observer, ObserverSettings, Uncertainty
from fifthwheel.truck import Axle, AxleGroup, Coupling, SprungMass, Unit, Vehicle
from fifthwheel.truck.uncertainty import changes

FOLDER = Path(os.environ.get("FIFTHWHEEL_DATA", Path(__file__).resolve().parents[2] / "shared" / "data")) / "carla"
UNITS = ("tractor", "semitrailer")
CHANNELS = ("yaw_rate.tractor", "yaw_rate.semitrailer", "articulation.semitrailer")
SETTINGS = TwoStage(
    given={  # a simulator has no sensor offsets; the gain is uncertain because one front wheel is logged
        "steer.*.gain": "+- 5 %",
        "steer.*.offset": "+- 0.001 rad",
        "yaw_rate.*.offset": "+- 0.0005 rad/s",
        "articulation.*.offset": "+- 0.001 rad",
    }
)
TIME_STEP = 0.05  # s between rows; positions and velocities agree with it to 0.03 %
STEER_STEP = 0.006  # rad between rows: a larger step starts the steering, and follows the hit of the car
INTERVAL = 1.645  # half width of a 90 % interval, in standard deviations
ROAD_SEAM = 192.0  # m east: there the road lifts the front wheels


@dataclass(frozen=True, kw_only=True)
class Geometry:
    """Geometry of a truck from its motion; x from the origin of each actor, m; that of the trailer is the kingpin."""

    cog: Mapping[str, float]
    height: Mapping[str, float]  # of the CoG above the road
    hitch: float  # on the tractor
    trailer_axle: float

    def __str__(self) -> str:
        cogs = ", ".join(f"CoG of {unit} {self.cog[unit]:.2f} (height {self.height[unit]:.2f})" for unit in UNITS)
        return f"hitch {self.hitch:.2f}, trailer axle {self.trailer_axle:.2f}, {cogs} m"


@dataclass(frozen=True, kw_only=True)
class Run:
    """One log, with the geometry and the assumed parameters of its truck."""

    record: Record
    geometry: Geometry
    truck: Vehicle


@dataclass(frozen=True, kw_only=True, eq=False)
class Motion:
    """Motion of one unit, ISO 8855, (N,); an attribute `mean_...` is a mean between two rows, (N - 1,)."""

    yaw: Array
    roll: Array
    pitch: Array
    position: NDArray[np.complex128]  # of the origin of the actor, m
    direction: NDArray[np.complex128]  # of the x axis
    forward: Array  # velocity of the CoG, m/s
    lateral: Array  # velocity of the CoG, m/s
    yaw_rate: Array
    roll_rate: Array
    mean_yaw_rate: Array
    mean_roll_rate: Array
    mean_lateral: Array
    mean_acceleration: Array  # lateral, of the CoG
    mean_origin: NDArray[np.complex128]  # velocity of the origin, forward + i left

    @classmethod
    def of(cls, table: NDArray[np.void], k: int) -> "Motion":
        """Motion of CARLA's actor k: y, yaw and steer angle are right positive there; roll is as in ISO 8855."""
        yaw, roll, pitch = -np.unwrap(table[f"yaw{k}"]), table[f"roll{k}"], table[f"pitch{k}"]
        position = table[f"x{k}"] - 1j * table[f"y{k}"]
        velocity = table[f"vGx{k}"] - 1j * table[f"vGy{k}"]
        direction = np.exp(1j * yaw)
        lateral = (velocity / direction).imag
        step = TIME_STEP * np.exp(0.5j * (yaw[1:] + yaw[:-1]))
        return cls(
            yaw=yaw,
            roll=roll,
            pitch=pitch,
            position=position,
            direction=direction,
            forward=(velocity / direction).real,
            lateral=lateral,
            yaw_rate=np.gradient(yaw, TIME_STEP),
            roll_rate=np.gradient(roll, TIME_STEP),
            mean_yaw_rate=np.diff(yaw) / TIME_STEP,
            mean_roll_rate=np.diff(roll) / TIME_STEP,
            mean_lateral=(lateral[1:] + lateral[:-1]) / 2,
            mean_acceleration=(np.diff(velocity) / step).imag,
            mean_origin=np.diff(position) / step,
        )


def read(path: Path) -> Run:
    """A log from 1 s before the steering starts to 0.2 s before the steering reacts to the hit of the car."""
    table, length = np.genfromtxt(path, delimiter=",", names=True), float(path.stem.split("_")[-2])
    steps = np.flatnonzero(np.abs(np.diff(table["delta"])) > STEER_STEP)
    start, hit = steps[0], steps[steps > steps[0] + 1 / TIME_STEP][0]
    rows = slice(start - round(1 / TIME_STEP), hit - round(0.2 / TIME_STEP))
    before_seam = slice(rows.start, int(np.flatnonzero(table["x1"] > ROAD_SEAM)[0]))
    tractor, trailer = (Motion.of(table, k) for k in (1, 2))
    signals = {
        "speed": tractor.forward,
        "steer.tractor.front": -table["delta"],
        "yaw_rate.tractor": tractor.yaw_rate,
        "yaw_rate.semitrailer": trailer.yaw_rate,
        "articulation.semitrailer": trailer.yaw - tractor.yaw,
    }
    geometry, reference = measure_geometry(tractor, trailer, length, rows, before_seam), dict[str, Array]()
    for unit, m in zip(UNITS, (tractor, trailer), strict=True):
        lateral = m.lateral + geometry.height[unit] * m.roll_rate  # at the road below the CoG
        reference |= {f"lateral_velocity.{unit}": lateral, f"sideslip.{unit}": np.arctan2(lateral, m.forward)}
    record = Record(
        time=TIME_STEP * (np.arange(len(table)) - start)[rows],
        signals={name: values[rows] for name, values in signals.items()},
        reference={name: values[rows] for name, values in reference.items()},
        name=f"{length:g} m",
    )
    return Run(record=record, geometry=geometry, truck=assumed_truck(geometry, length))


def path_errors(run: Run, path: Path) -> dict[str, float]:
    """Largest error across the road of the integral of yaw rate, speed and sideslip, from the logged position, m."""
    table, record = np.genfromtxt(path, delimiter=",", names=True), run.record
    steps = np.flatnonzero(np.abs(np.diff(table["delta"])) > STEER_STEP)
    first = int(steps[0]) + round(record.time[0] / TIME_STEP)
    rows, errors = slice(first, first + len(record)), dict[str, float]()
    for k, unit in enumerate(UNITS, 1):
        motion = Motion.of(table, k)
        truth = (motion.position + run.geometry.cog[unit] * motion.direction)[rows]  # at the road below the CoG
        yaw = motion.yaw[first] + integral(record.signals[f"yaw_rate.{unit}"])
        speed = record.signals["speed"] * (1 + 1j * np.tan(record.reference[f"sideslip.{unit}"]))
        errors[unit] = float(np.abs((truth[0] + integral(speed * np.exp(1j * yaw)) - truth).imag).max())
    return errors


def integral(values: NDArray[Any]) -> NDArray[Any]:
    """Over the rows, from zero, by the trapezoidal rule."""
    return np.append(0, np.cumsum((values[1:] + values[:-1]) / 2 * TIME_STEP))


def measure_geometry(tractor: Motion, trailer: Motion, length: float, rows: slice, before_seam: slice) -> Geometry:
    """Geometry from the motion of the units; the position of the trailer axle from the rows before the road seam."""
    cog, height = dict[str, float](), dict[str, float]()
    for unit, m in zip(UNITS, (tractor, trailer), strict=True):  # v_cog - v_origin = x r - z p
        difference = (m.mean_lateral - m.mean_origin.imag)[rows]
        cog[unit], height[unit] = solve([m.mean_yaw_rate[rows], -m.mean_roll_rate[rows]], difference)
    # the kingpin is one point of both units: origin + x forward + z (backward by pitch, to the right by roll)
    up = [-m.direction * (m.pitch + 1j * m.roll) for m in (tractor, trailer)]
    columns = [plane[rows] for plane in (tractor.direction, -trailer.direction, up[0] - up[1])]
    between = (trailer.position - tractor.position)[rows]
    hitch, kingpin, _ = solve([np.append(c.real, c.imag) for c in columns], np.append(between.real, between.imag))
    # at the axle v = -V F / C; F (pin to axle) = m a_y (pin to CoG) - I r', with I = m length^2 / 12 of a box
    yaw_rate, v = trailer.mean_yaw_rate, trailer.mean_origin
    force = -cog["semitrailer"] * trailer.mean_acceleration - length**2 / 12 * np.gradient(yaw_rate, TIME_STEP)
    axle, _ = solve([-yaw_rate[before_seam], (v.real * force)[before_seam]], v.imag[before_seam])
    return Geometry(cog=cog, height=height, hitch=hitch - kingpin, trailer_axle=axle)


def solve(columns: Sequence[Array], target: Array) -> list[float]:
    """Least-squares factors of the columns."""
    return [float(x) for x in np.linalg.lstsq(np.column_stack(columns), target, rcond=None)[0]]


def assumed_truck(geometry: Geometry, length: float) -> Vehicle:
    """The truck of a log with its assumed parameters.

    The masses are not published, and only their ratio affects a yaw model: the empty trailer has the mass of the
    tractor. The wheelbase of 3.6 m is common for a 4x2; the front axle is 0.95 m ahead of the origin of the actor, so
    the fifth wheel is 0.5 m ahead of the drive axle. The yaw inertia is m (0.4 wheelbase)^2 for the tractor and that of
    a box, m length^2 / 12, for the trailer. The initial cornering stiffness is 15.7 times the static load per radian,
    probably the default of PhysX. Roll parameters affect only the sigmas.
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
                    cornering_stiffness=1e5,  # replaced below, by the static load
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
class Transfer:
    """Estimates that apply to other logs too."""

    factors: Mapping[str, float]  # estimate divided by the assumed value
    steering: Mapping[str, float]  # gain and delay
    noise: Mapping[str, float]  # variances
    sigma: Mapping[str, float]  # of factors, as fractions, and of gain and delay

    @classmethod
    def of(cls, results: Sequence[Identification]) -> "Transfer":
        """The estimates of one result, or their mean weighted by sigma (for factors, the mean of the logarithm)."""
        factors, steering, sigma = {}, {}, {}
        for same in zip(*[result.parameters for result in results], strict=True):
            weights = [(e.value / (e.sigma or np.inf)) ** 2 for e in same]
            factors[same[0].name] = np.exp(np.average([np.log(e.value / e.initial) for e in same], weights=weights))
            sigma[same[0].name] = np.sum(weights) ** -0.5
        for same in zip(*[[e for e in result.sensors if e.log is None] for result in results], strict=True):
            steering[same[0].name] = np.average([e.value for e in same], weights=[e.sigma**-2 for e in same])
            sigma[same[0].name] = np.sum([e.sigma**-2 for e in same]) ** -0.5
        noise = {name: float(np.mean([result.logs[0].noise[name] for result in results])) for name in CHANNELS}
        return cls(factors=factors, steering=steering, noise=noise, sigma=sigma)

    def truck(self, run: Run) -> Vehicle:
        """The truck of a log with the estimates: tyres scale with the static load, yaw inertia with m length^2."""
        assumed = run.truck.parameters()
        return run.truck.replace({name: factor * assumed[name] for name, factor in self.factors.items()})

    def uncertainty(self, truck: Vehicle) -> Uncertainty:
        """Of the estimates, which are taken as independent, and of masses and lengths."""
        values = truck.parameters()
        columns = [{name: sigma * values.get(name, 1.0)} for name, sigma in self.sigma.items()]
        columns += [dict(change.slopes) for change in changes(truck)]
        names = tuple(dict.fromkeys(name for column in columns for name in column))
        root = np.array([[column.get(name, 0.0) for column in columns] for name in names])
        return Uncertainty(names=names, covariance=root @ root.T)

    def explained(self, run: Run) -> dict[str, float]:
        """Explained variance of each channel in a free run, per cent, with the truck of the log."""
        vehicle = self.truck(run)
        log = LogData(name=run.record.name, segments=[run.record], noise=dict(self.noise))
        fits = free_run_fits(free_run_setup(vehicle, CHANNELS, SETTINGS, roll=False), log, self.steering)
        return {fit.signal: 100 * fit.explained for fit in fits}

    def sideslip(self, run: Run) -> dict[str, tuple[float, float, float]]:
        """Rms error of the observed sideslip and standard deviation of the true one from the start of steering, deg,
        and the fraction of the samples that its 90 % intervals contain, per cent."""
        record, settings = run.record, ObserverSettings(sensor_errors=self.steering, noise=self.noise)
        truck, results = self.truck(run), {}
        states = Observer(truck, record.signals, settings).batch(record, self.uncertainty(truck))
        for name in ("sideslip.tractor", "sideslip.semitrailer"):
            truth, observed, sigma = (
                np.degrees(v[name][record.time >= 0]) for v in (record.reference, states.values, states.sigma)
            )
            error = observed - truth
            covered = 100 * float(np.mean(np.abs(error) <= INTERVAL * sigma))
            results[name] = float(np.sqrt(np.mean(error**2))), float(truth.std()), covered
        return results


def main() -> None:
    """Print the estimates of each log, and the table of predictions."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="?", default=FOLDER)
    folder = parser.parse_args().folder
    paths = sorted(folder.glob("vehicle_dataLateral_*.csv"))
    if not (runs := [read(path) for path in paths]):
        parser.error(
            f"{folder}: expected files vehicle_dataLateral_*.csv, got none; give their folder, or set FIFTHWHEEL_DATA"
        )
    results = {run.record.name: identify([run.record], run.truck, SETTINGS) for run in runs}
    for run, path in zip(runs, paths, strict=True):
        print(f"{run.record.name}: {run.record.span[1]:.2f} s from the start of steering; {run.geometry}")
        errors = ", ".join(f"{unit} {error:.3f}" for unit, error in path_errors(run, path).items())
        print(f"  error of the integrated path across the road: {errors} m")
        fits = ", ".join(f"{fit.signal} {100 * fit.explained:.1f}" for fit in results[run.record.name].fits)
        print(f"  explained by the identification: {fits} %")
        for e in results[run.record.name].parameters:
            print(f"  {e.name:35s} {e.value:9.3g} +- {e.sigma or np.nan:7.2g}, assumed {e.initial:8.3g}, {e.verdict}")
    title = "sideslip, deg: rms error (sigma of truth), coverage of 90 % intervals"
    print(f"\n{'':18s}{'explained, %':>20s}   {title}")
    print(f"identified on log  {'tractor':>9s}{'trailer':>9s}{'artic.':>9s}   {'tractor':>17s}{'trailer':>23s}")
    for used in [*[[name] for name in results], [*results]]:
        transfer = Transfer.of([results[name] for name in used])
        for run in runs:
            log = run.record.name + ("*" if run.record.name in used else "")
            explained = "".join(f"{transfer.explained(run)[channel]:9.1f}" for channel in CHANNELS)
            sideslip = "".join(f"{r:10.2f} ({s:.2f}){c:4.0f} %" for r, s, c in transfer.sideslip(run).values())
            print(f"{'mean of all' if len(used) > 1 else used[0]:14s}{log:5s}{explained}{sideslip}")
    print("* identified on this log; all others are predicted")


if __name__ == "__main__":
    main()
