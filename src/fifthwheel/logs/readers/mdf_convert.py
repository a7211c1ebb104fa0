"""From raw to physical values, by the conversions of MDF 3 and 4. What stands for a text keeps its raw number."""

import importlib
import re
import warnings
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fifthwheel.logs.readers.mdf_data import BrokenError
from fifthwheel.logs.readers.mdf_model import Array, Conversion

_FORMULA = re.compile(r"[\w\s.+\-*/^(),<>=&|!%~]{1,1000}")


def linear(offset: float, factor: float) -> Conversion | None:
    """offset + factor * raw; None where that changes nothing."""
    if (offset, factor) == (0.0, 1.0):
        return None
    return lambda raw: offset + factor * raw


def rational(p: Sequence[float]) -> Conversion:
    """(p0 x^2 + p1 x + p2) / (p3 x^2 + p4 x + p5) of the raw x."""

    def convert(x: Array) -> Array:
        with np.errstate(all="ignore"):
            result: Array = (p[0] * x * x + p[1] * x + p[2]) / (p[3] * x * x + p[4] * x + p[5])
        return result

    return convert


def table(pairs: Sequence[float], interpolated: bool) -> Conversion:
    """Raw to physical by a table raw, physical, raw, physical ...; between its rows the nearest, or a straight line."""
    flat = np.array(pairs, dtype=np.float64)
    rows = flat[: flat.size // 2 * 2].reshape(-1, 2)
    if not rows.size or not np.isfinite(rows[:, 0]).all():
        raise BrokenError("a table of raw and physical values without rows")
    raw, physical = rows[rows[:, 0].argsort(kind="stable")].T
    if interpolated:
        return lambda x: np.interp(x, raw, physical)
    return lambda x: physical[np.searchsorted((raw[1:] + raw[:-1]) / 2, x, side="left")]


def ranges(values: Sequence[float]) -> Conversion:
    """Raw to physical by a table from, to, physical, from, to, physical, ..., default."""
    flat = np.array(values, dtype=np.float64)
    rows = flat[: flat.size // 3 * 3].reshape(-1, 3)
    default = flat[-1] if flat.size % 3 else np.nan

    def convert(x: Array) -> Array:
        result = np.full(x.shape, default)
        for low, high, physical in rows[::-1]:
            result[_within(x, low, high)] = physical
        return result

    return convert


def mixed(
    rows: Sequence[tuple[float, float]], scales: Sequence[Conversion | str | None], default: Conversion | str | None
) -> Conversion:
    """A scale for some raw values, a text for others: the texts become NaN, such as "signal not available".

    Args:
        rows: from and to of each entry, raw.
        scales: its conversion, or its text.
        default: the same for all other raw values.
    """

    def scaled(scale: Conversion | str | None, x: Array) -> Array:
        if isinstance(scale, str):
            return np.full(x.shape, np.nan)
        return x if scale is None else scale(x)

    def convert(x: Array) -> Array:
        result = scaled(default, x).astype(np.float64)
        for (low, high), scale in zip(rows[::-1], scales[::-1], strict=True):
            inside = _within(x, low, high)
            if inside.any():
                result[inside] = scaled(scale, x[inside])
        return result

    return convert


def formula(text: str) -> Conversion:
    """A formula of X, by numexpr."""
    text = re.sub(r"\bX1?\b", "X", text.strip().rstrip("\0")).replace("^", "**")
    if not _FORMULA.fullmatch(text) or "__" in text:
        raise BrokenError(f"the formula {text[:40]!r} is not understood")
    try:
        numexpr = importlib.import_module("numexpr")
    except ImportError as error:
        raise BrokenError(f"the formula {text[:40]!r} needs numexpr; pip install numexpr") from error

    def convert(x: Array) -> Array:
        try:
            with warnings.catch_warnings(), np.errstate(all="ignore"):
                warnings.simplefilter("ignore")
                result = numexpr.evaluate(text, local_dict={"X": x}, global_dict={})
        except Exception as error:  # whatever such a text can cause
            raise BrokenError(f"the formula {text[:40]!r} is not understood ({error})") from error
        return np.broadcast_to(np.asarray(result, dtype=np.float64), x.shape)

    convert(np.zeros(1))
    return convert


def _within(x: Array, low: float, high: float) -> NDArray[np.bool_]:
    return (x >= low) & (x <= high)
