"""Signals, numbers and tables as text of C."""

from collections.abc import Iterable, Mapping, Sequence

from fifthwheel.errors import FifthwheelError
from fifthwheel.native import c_code


def identifier(prefix: str, signal: str) -> str:
    """Name of a signal as an enumerator of C: FW_INPUT_STEER_TRACTOR_FRONT for steer.tractor.front."""
    return f"FW_{prefix}_" + "".join(c if c.isascii() and c.isalnum() else "_" for c in signal).upper()


def enumerations(groups: Mapping[str, Mapping[str, str]]) -> list[str]:
    """Lines of enumerations: of each group its prefix, with its names and the text behind each.

    Raises:
        FifthwheelError: two names of a group have the same identifier.
    """
    lines: list[str] = []
    for prefix, names in groups.items():
        identifiers = [identifier(prefix, name) for name in names]
        if len(set(identifiers)) < len(names):
            raise FifthwheelError(f"{', '.join(names)}: two names are equal in C; rename a unit in the vehicle file")
        lines += [f"#define FW_{prefix}_COUNT {len(names)}", f"enum fw_{prefix.lower()} {{"]
        lines += [
            f"    {key} = {i}, /* {name}, {text} */"
            for i, (key, (name, text)) in enumerate(zip(identifiers, names.items(), strict=True))
        ]
        lines += ["};", ""]
    return lines


def table(name: str, values: Iterable[float], *, static: bool = True) -> str:
    """A constant array of real numbers."""
    numbers = [c_code.literal(float(value)) for value in values]
    return f"{'static ' if static else ''}const fw_real fw_{name}[{len(numbers)}] = {{{', '.join(numbers)}}};"


def integers(name: str, values: Sequence[int]) -> str:
    """A constant array of integers of 16 bits."""
    return f"const int16_t fw_{name}[{len(values)}] = {{{', '.join(map(str, values))}}};"


def texts(name: str, values: Iterable[str]) -> str:
    """A constant array of texts."""
    quoted = [f'"{value}"' for value in values]
    return f"const char *const fw_{name}[{len(quoted)}] = {{{', '.join(quoted)}}};"
