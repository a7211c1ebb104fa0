"""A record as the J1939 frames of a truck in an MF4 file with bus logging."""

import warnings

import numpy as np

RATIO = 20.0
"""Of the steering."""
VDC2, CCVS, ARI = 0x18F00900, 0x18FEF100, 0x0CF02A00
TRACTOR, TRAILER, ENGINE = 0x0B, 0xC8, 0x00
"""Source addresses."""


def j1939_frames(record):
    """Time s, id and payload of each frame, in the order of time."""

    def field(values, scale, offset):
        return np.rint((values - offset) / scale).astype("<u2").view(np.uint8).reshape(-1, 2)

    degrees = {name: np.degrees(values) for name, values in record.signals.items()}
    wheel, speed, tractor, trailer = np.full((4, len(record), 8), 0xFF, np.uint8)
    wheel[:, 0:2] = field(RATIO * record.signals["steer.tractor.front"], 0.0009765625, -31.374)
    wheel[:, 3:5] = field(record.signals["yaw_rate.tractor"], 0.0001220703125, -3.92)
    speed[:, 1:3] = field(3.6 * record.signals["speed"], 0.00390625, 0.0)
    for payload, unit in ((tractor, "tractor"), (trailer, "semitrailer")):
        payload[:, 2:4] = field(degrees[f"roll_rate.{unit}"], 0.0078125, -250.0)
        payload[:, 4:6] = field(degrees[f"yaw_rate.{unit}"], 0.0078125, -250.0)
    messages = ((VDC2 | TRACTOR, wheel), (CCVS | ENGINE, speed), (ARI | TRACTOR, tractor), (ARI | TRAILER, trailer))
    for k, time in enumerate(record.time.tolist()):
        for number, payload in messages:
            yield time, number, payload[k]


def write_can_mf4(record, path):
    """The frames as an MF4 file with bus logging."""
    from asammdf import MDF, Signal, Source

    times, numbers, payloads = (np.array(part) for part in zip(*j1939_frames(record), strict=True))
    count = len(times)
    times = times + 1e-4 * (np.arange(count) % 4)
    fields = [
        np.full(count, 1, "u1"),
        numbers.astype("<u4"),
        np.ones(count, "u1"),
        *np.full((2, count), 8, "u1"),
        payloads,
    ]
    names = [f"CAN_DataFrame.{name}" for name in ("BusChannel", "ID", "IDE", "DLC", "DataLength", "DataBytes")]
    types = [(name, part.dtype, part.shape[1:]) for name, part in zip(names, fields, strict=True)]
    source = Source(source_type=Source.SOURCE_BUS, bus_type=Source.BUS_TYPE_CAN, name="CAN", path="CAN", comment="")
    frames = Signal(np.rec.fromarrays(fields, dtype=types), times, name="CAN_DataFrame", source=source)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        mdf = MDF(version="4.10")
        mdf.append([frames], comment="CAN")
        mdf.save(path, overwrite=True)
        mdf.close()
    return path
