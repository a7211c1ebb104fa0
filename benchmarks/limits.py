"""Sideslip near the limits of adhesion: observers with linear and with saturating tyres on the nonlinear truck.

    python benchmarks/limits.py

A single sine of the steer angle at 0.4 Hz, from 0.1 to 0.6 g of the front axle, on a dry road and on snow, with the
sensors of the article. The observer with saturating tyres has the friction 0.85 times the factor of the tyres, which is
the peak of the tyre 315/80 R 22.5 in PAC2002, and for comparison a friction that is 20 % wrong. Vehicle file and
sensors are otherwise exact.
"""

import numpy as np

from fifthwheel.errors import FifthwheelError
from fifthwheel.manoeuvres.open_loops import single_sine
from fifthwheel.observe import Observer, ObserverSettings
from fifthwheel.plant import Plant, PlantRun, Properties, article_sensors, measure
from fifthwheel.record import Record
from trust_runs import TRUCK, table

UNITS = ("tractor", "semitrailer")
SIGNALS = ("speed", "steer.tractor.front", *(f"{q}.{unit}" for q in ("yaw_rate", "roll_rate") for unit in UNITS))
PEAK = 0.85
"""Friction at large slip of the law that is closest to the tyre."""
OBSERVERS = {"linear": None, "saturating": 1.0, "friction 20 % low": 0.8, "friction 20 % high": 1.2}
"""Factor of the friction of each observer; None: linear tyres."""


def errors(run: PlantRun, settings: ObserverSettings) -> str:
    """Rms error of the sideslip of both units, deg; with a mark where the observer is inconsistent."""
    sensors = {name: sensor for name, sensor in article_sensors(TRUCK).items() if name in SIGNALS}
    signals = measure(run.time, {name: run.truth[name] for name in SIGNALS}, sensors, seed=1)
    states = Observer(TRUCK, SIGNALS, settings).batch(Record(time=run.time, signals=signals, name="sine"))
    rms = [np.sqrt(np.mean((states.values[f"sideslip.{u}"] - run.truth[f"sideslip.{u}"]) ** 2)) for u in UNITS]
    mark = " *" if (states.status != 0).any() else ""
    return ", ".join(f"{np.degrees(x):.2f}" for x in rms) + mark


def main() -> None:
    """Print the table."""
    rows = []
    for friction, accelerations in ((1.0, (1.0, 2.0, 3.0, 3.5, 4.0)), (0.35, (0.5, 1.0, 1.5, 2.0))):
        for acceleration in accelerations:
            title = f"{PEAK * friction:.2g}, {acceleration:g}"
            try:
                run = Plant(TRUCK, Properties(friction=friction)).drive(single_sine(TRUCK, acceleration=acceleration))
            except FifthwheelError as error:
                rows.append([title, str(error)])
                continue
            largest = max(np.abs(run.truth["speed"] * run.truth[f"yaw_rate.{u}"]).max() for u in UNITS) / 9.81
            truth = ", ".join(f"{np.degrees(np.abs(run.truth[f'sideslip.{u}']).max()):.1f}" for u in UNITS)
            exact = ObserverSettings(bank=0.0, steer_offset=0.0)
            cells = [
                errors(
                    run,
                    exact
                    if factor is None
                    else ObserverSettings(bank=0.0, steer_offset=0.0, friction=PEAK * friction * factor),
                )
                for factor in OBSERVERS.values()
            ]
            rows.append([title, f"{largest:.2f}", truth, *cells])
            print(rows[-1], flush=True)
    heads = ("friction, m/s²", "largest u r / g", "largest sideslip, deg", *(f"{name}, deg" for name in OBSERVERS))
    print("\n".join(table(heads, rows)))
    print("* INCONSISTENT for a part of the run")


if __name__ == "__main__":
    main()
