"""A node from the files of a user: vehicle, signal map, identification, learner."""

from typing import Any

from fifthwheel.errors import SignalError
from fifthwheel.identify import Identification
from fifthwheel.live.node import LiveEstimator, Node
from fifthwheel.logs import LiveMap, SignalMap
from fifthwheel.logs.can.database import load
from fifthwheel.logs.can.decoder import FrameDecoder, signal_columns
from fifthwheel.logs.signal_map import TimeColumn
from fifthwheel.observe import Observer
from fifthwheel.vehicle import Vehicle
from fifthwheel.workflow import exported_observer

RATE = 100.0
"""Of the outputs, Hz."""


def make_node(
    signal_map: SignalMap, estimator: LiveEstimator, *, extra: tuple[str, ...] = (), rate: float = RATE
) -> Node:
    """The node of a vehicle.

    Args:
        signal_map: as `completed_map` gives it.
        estimator: for its signals.
        extra: columns of the databases whose values the node keeps in `Node.extra`.
        rate: of the outputs, Hz.

    Raises:
        SignalError: a column is in no database, or has timestamps of its own.
    """
    columns = list(dict.fromkeys(text for channel in signal_map.signals.values() for text in channel.columns))
    decoder = FrameDecoder(load(signal_map.databases), [*columns, *extra])
    mapped = LiveMap(signal_map, ["time", *decoder.columns])
    return Node(estimator, decoder, mapped, rate=rate, extra=decoder.columns[len(columns) :])


def completed_map(signal_map: SignalMap) -> SignalMap:
    """The map with the signals of the databases that have names of signals; its time is that of the frames.

    Raises:
        SignalError: no column is mapped, or a database cannot be read.
    """
    complete = signal_map.completed(signal_columns(load(signal_map.databases)))
    if not complete.signals:
        raise SignalError(
            "signals.toml: no column is mapped to a signal; map columns such as VDC2.yaw_rate, which `fifthwheel "
            "signals` proposes from a recorded trace"
        )
    return complete.model_copy(update={"time": TimeColumn(rate=complete.rate)})


def make_observer(
    vehicle: Vehicle, signal_map: SignalMap, identification: Identification | None, min_speed: float, **settings: Any
) -> Observer:
    """The observer of a vehicle with the signals of a map.

    Args:
        vehicle: with its numbers.
        signal_map: as `completed_map` gives it.
        identification: for the sensor errors and the noise.
        min_speed, settings: of `exported_observer`.

    Raises:
        SignalError: the signals are not sufficient.
        VehicleError: no axle of the vehicle is steerable, or the identification is of another vehicle.
    """
    every = Observer(vehicle, signal_map.signals)
    used = [name for name in signal_map.signals if name in (*every.inputs, *every.outputs)]
    observer = exported_observer(vehicle, used, identification, min_speed=min_speed, **settings)
    straight = dict.fromkeys(used, 0.0) | {"speed": 2 * min_speed}
    for time in (0.0, 0.01):  # compiles it now, and not while driving
        observer.push({"time": time, **straight})
    observer.reset()
    return observer
