"""Numbers in a decoded message, whatever decoded it: ROS 1 and 2, protobuf or JSON."""

import importlib
import io
import json
import re
import warnings
from collections.abc import Callable, Mapping
from contextlib import redirect_stderr, redirect_stdout
from typing import Any

import numpy as np

LONGEST = 16
"""Elements of a list that become columns."""
_DEEPEST = 12
_STAMP = re.compile(r"(?:header\.stamp|stamp|timestamp)\.(?:(secs?|seconds)|(nanosec|nsecs?|nanos|nanoseconds))")
_FACTORIES = {
    "cdr": ("mcap_ros2.decoder", "mcap-ros2-support"),
    "protobuf": ("mcap_protobuf.decoder", "mcap-protobuf-support"),
    "ros1": ("mcap_ros1.decoder", "mcap-ros1-support"),
}

Decode = Callable[[bytes], Any]


class Decoders:
    """Decoders by message encoding, made when first needed."""

    def __init__(self) -> None:
        self._factories: dict[str, Any] = {}

    def make(self, encoding: str, schema: Any) -> Decode | str:
        """The decoder of a channel, or why there is none."""
        if encoding == "json":
            return json.loads
        if encoding not in _FACTORIES:
            return f"message encoding {encoding!r} is not supported"
        module, package = _FACTORIES[encoding]
        try:
            silence = io.StringIO()
            with warnings.catch_warnings(), redirect_stdout(silence), redirect_stderr(silence):
                warnings.simplefilter("ignore")
                if encoding not in self._factories:
                    self._factories[encoding] = importlib.import_module(module).DecoderFactory()
                decode: Decode | None = self._factories[encoding].decoder_for(encoding, schema)
        except ImportError:
            return f"pip install {package}"
        except Exception as error:  # whatever a damaged schema can cause
            return f"its schema is not understood ({error})"
        return decode or f"its schema is in {schema.encoding if schema else 'no language'!r}, which is not supported"


def leaves(message: Any, long: set[str]) -> dict[str, float]:
    """Numbers in a message by their path, such as "pose.position.x" or "covariance[3]".

    Args:
        message: as decoded.
        long: gets the paths of lists of more than 16 elements, which are left out.
    """
    found: dict[str, float] = {}
    _collect(message, "", found, long, 0)
    return found


def stamp(fields: Mapping[str, float]) -> float:
    """s, of the message's own header; NaN where it has none."""
    seconds, fraction = np.nan, 0.0
    for name, value in fields.items():
        match = _STAMP.fullmatch(name)
        if match and match[1]:
            seconds = value
        elif match:
            fraction = value * 1e-9
    return seconds + fraction


def is_stamp(path: str) -> bool:
    """Whether a number is part of such a stamp."""
    return _STAMP.fullmatch(path) is not None


def _collect(value: Any, path: str, found: dict[str, float], long: set[str], depth: int) -> None:
    if isinstance(value, bool | int | float | np.number | np.bool_):
        try:
            found[path] = float(value)
        except OverflowError:
            found[path] = np.nan
        return
    if value is None or isinstance(value, str | bytes | bytearray) or depth > _DEEPEST:
        return
    fields = _fields(value)
    if fields is not None:
        for name, item in fields.items():
            _collect(item, f"{path}.{name}" if path else name, found, long, depth + 1)
        return
    try:
        size = len(value)
    except TypeError:
        return
    if size > LONGEST:
        long.add(path)
        return
    for k, item in enumerate(value):
        _collect(item, f"{path}[{k}]", found, long, depth + 1)


def _fields(value: Any) -> Mapping[str, Any] | None:
    """Fields of a struct by name; None for what is none."""
    if isinstance(value, Mapping):
        return {str(name): item for name, item in value.items()}
    descriptor = getattr(value, "DESCRIPTOR", None)
    if descriptor is not None:
        return {
            field.name: getattr(value, field.name)
            for field in descriptor.fields
            if not field.has_presence or value.HasField(field.name)
        }
    slots = getattr(value, "__slots__", None)
    if slots:
        return {name.lstrip("_"): getattr(value, name, None) for name in slots}
    own = getattr(value, "__dict__", None)
    return {name: item for name, item in own.items() if not name.startswith("_")} if own is not None else None
