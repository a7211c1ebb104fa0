"""Dataclasses in files: the forms of their fields in JSON, and their restoration by the types of these fields."""

import math
from functools import cache
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, BeforeValidator, Field, GetPydanticSchema, PlainSerializer, Strict, TypeAdapter
from pydantic import ValidationError as ValidationError

from fifthwheel.base.types import Array
from fifthwheel.estimate.filters.model import pack_array, unpack_array

MAX_NUMBER = 1e40
"""Magnitude of a number; squares and products of such numbers are finite."""
Real = Annotated[float, Strict()]
"""A number; a text with a number is refused."""
Number = Annotated[Real, BeforeValidator(lambda value: math.nan if value is None else value)]
"""A number that may be NaN, which a JSON file states as null."""
Moderate = Annotated[Real, Field(ge=-MAX_NUMBER, le=MAX_NUMBER)]
Positive = Annotated[Real, Field(gt=0, le=MAX_NUMBER)]


def _unpacked(numbers: list[float]) -> Array:
    n = math.isqrt(2 * len(numbers))
    if len(numbers) != n * (n + 1) // 2:
        raise ValueError(f"a symmetric matrix of {len(numbers)} numbers")
    return unpack_array(np.array(numbers, dtype=np.float64), n)


def _as(form: Any) -> GetPydanticSchema:
    """An array in this form."""
    return GetPydanticSchema(lambda _, handler: handler(form))


_LIST = PlainSerializer(np.ndarray.tolist)
_TO_ARRAY = AfterValidator(lambda x: np.array(x, dtype=np.float64))
_VECTOR, _ROWS = (Annotated[form, _TO_ARRAY, _LIST] for form in (list[Moderate], list[list[Moderate]]))
_FLAGS = Annotated[list[Annotated[bool, Strict()]], AfterValidator(lambda x: np.array(x, dtype=np.bool_)), _LIST]
_PACKED = Annotated[list[Moderate], AfterValidator(_unpacked), PlainSerializer(lambda P: pack_array(P).tolist())]
Vector = Annotated[Array, _as(_VECTOR)]
Flags = Annotated[NDArray[np.bool_], _as(_FLAGS)]
Matrix = Annotated[Array, _as(_ROWS)]
Symmetric = Annotated[Array, _as(_PACKED)]
"""A symmetric matrix, of which a file has one half."""


def stored(kind: Any, value: Any) -> Any:
    """A value of a type as data for JSON."""
    return _adapter(kind).dump_python(value, mode="json")


def restored(kind: Any, content: Any) -> Any:
    """The value of a type that `stored` gave; a ValidationError, which is a ValueError, for other content."""
    return _adapter(kind).validate_python(content)


def reason(error: Exception) -> str:
    """Why content was refused, in one line."""
    if not isinstance(error, ValidationError):
        return str(error).partition("\n")[0]
    first = error.errors()[0]
    return ": ".join(filter(None, (".".join(map(str, first["loc"])), first["msg"])))


@cache
def _adapter(kind: Any) -> TypeAdapter[Any]:
    return TypeAdapter(kind)
