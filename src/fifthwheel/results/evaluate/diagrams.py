"""The diagrams of an evaluation, from its arrays."""

from collections.abc import Mapping

import numpy as np

from fifthwheel.base.formatting import shown
from fifthwheel.base.names import split_kind
from fifthwheel.base.plots import Axis, Band, Item, Line, Panel, Plot, Points
from fifthwheel.base.types import Array
from fifthwheel.data.channels import CHANNELS, SignalName
from fifthwheel.results.evaluate.motion import gain_unit
from fifthwheel.truck.spoken_names import spoken

AXES = {
    "lateral_acceleration": Axis(label="lateral acceleration", unit="m/s²"),
    "frequency": Axis(label="frequency", unit="Hz"),
    "time": Axis(label="time", unit="s"),
}
"""Of the first column of the arrays."""
TITLES = {"steer": "Steer angle", "steer_less_ackermann": "Steer angle less Ackermann angle"}


def diagram(arrays: Mapping[str, Array]) -> dict[str, Plot]:
    """Plots by their captions: over lateral acceleration, frequency or time, whichever is the first column."""
    first = next(iter(arrays))
    if first == "lateral_acceleration":
        return _characteristics(arrays)
    return _responses(arrays) if first == "frequency" else _histories(arrays)


def _characteristics(arrays: Mapping[str, Array]) -> dict[str, Plot]:
    x, axis = arrays["lateral_acceleration"], AXES["lateral_acceleration"]
    return {
        TITLES.get(name) or spoken(name): Plot(
            panels=[Panel(items=[Points(x, np.degrees(values))], x=axis, y=Axis(unit="deg"))]
        )
        for name, values in arrays.items()
        if name not in ("lateral_acceleration", "speed", "curvature")
    }


def _responses(arrays: Mapping[str, Array]) -> dict[str, Plot]:
    f, axis, plots = arrays["frequency"], AXES["frequency"], dict[str, Plot]()
    for name in [name for kind, name in map(split_kind, arrays) if kind == "gain"]:
        gain, sigma = arrays[f"gain.{name}"], arrays[f"gain_sigma.{name}"]
        gains: list[Item] = [Band(f, gain - sigma, gain + sigma), Line(f, gain)]
        plots[spoken(name)] = Plot(
            panels=[
                Panel(items=gains, x=axis, y=Axis(label="gain", unit=shown(gain_unit(name)).name), height=1.5),
                Panel(items=[Line(f, np.degrees(arrays[f"phase.{name}"]))], x=axis, y=Axis(label="phase", unit="deg")),
                Panel(items=[Line(f, arrays[f"coherence.{name}"])], x=axis, y=Axis(label="coherence", range=(0, 1.02))),
            ]
        )
    return plots


def _histories(arrays: Mapping[str, Array]) -> dict[str, Plot]:
    """Each quantity over time, one plot for all units."""
    quantities: dict[str, list[Item]] = {}
    for name, values in arrays.items():
        if name != "time":
            quantity = SignalName.of(name).quantity
            unit = shown(CHANNELS[quantity].unit)
            quantities.setdefault(quantity, []).append(Line(arrays["time"], unit.factor * values, name=spoken(name)))
    return {
        quantity.replace("_", " ").capitalize(): Plot(
            panels=[Panel(items=items, x=AXES["time"], y=Axis(unit=shown(CHANNELS[quantity].unit).name))]
        )
        for quantity, items in quantities.items()
    }
