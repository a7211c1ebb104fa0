"""What every part of a vehicle shares: frozen, keyword-only, finite, and errors that name the path and the cure."""

from collections.abc import Iterable
from difflib import get_close_matches
from reprlib import repr as shorten
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from fifthwheel.errors import VehicleError

Number = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$")]


class Part(BaseModel):
    """A piece of a vehicle. What does not fit raises VehicleError, with the path from the outermost named part."""

    model_config = ConfigDict(frozen=True, extra="forbid", validate_default=True)

    def __init__(self, **data: Any) -> None:
        try:
            super().__init__(**data)
        except ValidationError as error:
            raise VehicleError(_explain(error, self._prefix(data), type(self).model_fields)) from None

    @classmethod
    def _prefix(cls, data: dict[str, Any]) -> str:
        """How the paths of this part begin: its name and a dot."""
        name = data.get("name")
        return f"{name}." if isinstance(name, str) else ""


def suggestion(wrong: str, known: Iterable[str]) -> str:
    """'; did you mean mass?' where something known looks like what came, else what is known."""
    known = list(known)
    close = get_close_matches(wrong, known, n=3)
    return f"did you mean {' or '.join(close)}?" if close else f"known are {', '.join(known)}"


def _explain(error: ValidationError, prefix: str, known: Iterable[str]) -> str:
    lines = []
    broken = {e["loc"][:1] for e in error.errors() if e["type"] == "value_error"}
    for e in error.errors():
        path, context, came = _path(e["loc"]), e.get("ctx", {}), e["input"]
        match e["type"]:
            case "value_error" if isinstance(context.get("error"), VehicleError):
                nameless = e["loc"] and isinstance(e["loc"][-1], str)  # such as sprung
                own = "" if e["loc"][:1] == ("axles",) else prefix  # an axle's path leaves out its group
                lines.append(f"{own}{path}.{context['error']}" if nameless else f"{own}{context['error']}")
                continue
            case "too_short" if e["loc"] in broken:
                continue  # it is short of the part that the other line is about
            case "greater_than":
                expected = f"a number > {context['gt']:g}"
            case "greater_than_equal":
                expected = f"a number >= {context['ge']:g}"
            case "less_than_equal":
                expected = f"a number <= {context['le']:g}"
            case "finite_number":
                expected = "a finite number"
            case "float_type" | "float_parsing":
                expected = "a number"
            case "string_pattern_mismatch":
                expected = "a name of lower-case letters, digits and _, a letter first"
            case "missing":
                lines.append(f"{prefix}{path}: expected a value, got none; give it")
                continue
            case "extra_forbidden":
                lines.append(f"{prefix}{path}: no such key; {suggestion(str(e['loc'][-1]), known)}")
                continue
            case _:
                expected = e["msg"]
        cure = "is its unit right?" if e["type"] == "less_than_equal" or context.get("ge") else "correct it"
        lines.append(f"{prefix}{path}: expected {expected}, got {shorten(came)}; {cure}")
    return "\n".join(lines)


def _path(loc: tuple[str | int, ...]) -> str:
    return "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in loc).removeprefix(".")
