"""A truck whose signals are messages on a bus."""

from collections.abc import Iterator

import numpy as np

from fifthwheel.apps.live.node import Node
from fifthwheel.apps.live.setup import completed_map, make_node, make_observer
from fifthwheel.data.logs import SignalMap
from fifthwheel.data.logs.can.database import Frame
from fifthwheel.data.record import Record
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import get

TRUCK = get("cheng_cebon_2011")
DBC = """VERSION ""
NS_ :
BS_:
BU_: ECU
BO_ 256 Steering: 8 ECU
 SG_ wheel : 0|32@1- (1E-07,0) [0|0] "rad" ECU
 SG_ v : 32|24@1+ (0.0001,0) [0|0] "km/h" ECU
BO_ 257 Tractor: 8 ECU
 SG_ yaw : 7|32@0- (1E-07,0) [0|0] "rad/s" ECU
 SG_ roll : 39|32@0- (1E-07,0) [0|0] "rad/s" ECU
BO_ 258 Trailer: 8 ECU
 SG_ yaw : 0|32@1- (1E-05,0) [0|0] "deg/s" ECU
 SG_ roll : 32|32@1- (1E-07,0) [0|0] "rad/s" ECU
BO_ 259 TrailerName: 4 ECU
 SG_ number : 0|32@1+ (1,0) [0|0] "" ECU
"""
MAP = """
databases = ["truck.dbc"]
[signals]
speed = "Steering.v"
"yaw_rate.tractor" = "Tractor.yaw"
"roll_rate.tractor" = "Tractor.roll"
"yaw_rate.semitrailer" = { column = "Trailer.yaw", sign = -1 }
"roll_rate.semitrailer" = "Trailer.roll"
[signals."steer.tractor.front"]
column = "Steering.wheel"
gain = 0.05
"""
SIGNALS = (
    "speed",
    "steer.tractor.front",
    "yaw_rate.tractor",
    "roll_rate.tractor",
    "yaw_rate.semitrailer",
    "roll_rate.semitrailer",
)
IDS = (256, 257, 258)


def write_files(folder) -> SignalMap:
    (folder / "truck.dbc").write_text(DBC)
    (folder / "signals.toml").write_text(MAP)
    return SignalMap.load(folder / "signals.toml")


def observer_node(signal_map: SignalMap) -> Node:
    complete = completed_map(signal_map)
    return make_node(complete, make_observer(TRUCK, complete, None, 5.0))


def driven(seconds: float = 8.0, seed: int = 1) -> Record:
    return simulate(TRUCK, count=max(1, round(seconds / 8)), seed=seed)


def payloads(sample: dict[str, float]) -> dict[int, bytes]:
    """The messages of one sample by id."""

    def raw(value: float, size: int = 4, order: str = "little", signed: bool = True) -> bytes:
        return round(value).to_bytes(size, order, signed=signed)  # type: ignore[arg-type]

    return {
        256: raw(sample["steer.tractor.front"] * 20e7) + raw(sample["speed"] * 3.6e4, 3, signed=False) + b"\0",
        257: raw(sample["yaw_rate.tractor"] * 1e7, order="big") + raw(sample["roll_rate.tractor"] * 1e7, order="big"),
        258: raw(-np.degrees(sample["yaw_rate.semitrailer"]) * 1e5) + raw(sample["roll_rate.semitrailer"] * 1e7),
    }


def frames(record: Record, *, start: float = 0.0, spread: float = 0.0) -> Iterator[Frame]:
    """The frames of a record; those of one sample follow each other by `spread`, s."""
    for k, time in enumerate(record.time.tolist()):
        sample = {name: float(record.signals[name][k]) for name in SIGNALS}
        for i, (number, data) in enumerate(payloads(sample).items()):
            yield Frame(start + time + i * spread, number, data)


def write_candump(path, frames) -> None:
    path.write_text("".join(f"({f.time:.6f}) can0 {f.id:03X}#{f.data.hex().upper()}\n" for f in frames))
