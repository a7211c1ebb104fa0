"""The base of all settings, and the options that front ends make from them."""

import math
import pydoc
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Annotated, Any, Literal

import numpy as np
import pytest
import typer

from fifthwheel.apps import cli
from fifthwheel.base.errors import SignalError
from fifthwheel.base.options import FleetSettings, IdentifyOptions, LiveOptions, ObserverOptions, TruckOptions
from fifthwheel.base.settings import (
    Cure,
    Finite,
    FiniteNonNegative,
    Limits,
    Option,
    Settings,
    arguments,
    limits,
    meanings,
    options_of,
)
from fifthwheel.estimate.identify import OneStage


@dataclass(frozen=True, kw_only=True)
class Example(Settings):
    """One setting of each kind."""

    ratio: Annotated[float, Limits(ge=0, le=1), Cure("give a fraction")] = 0.5
    count: Annotated[int, Limits(ge=2)] = 3
    colour: Literal["red", "blue"] = "red"
    names: Annotated[tuple[str, ...], Option(help="Names", flags=("--name", "-n"))] = ()
    weights: Mapping[str, FiniteNonNegative] = field(default_factory=dict)
    shift: Finite | None = None
    check: Annotated[bool, Option(help="Check.", flags=("--check/--no-check",))] = True
    place: Annotated[str | None, Option(help="Place.")] = None


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"ratio": 1.5}, "ratio: expected between 0 and 1, got 1.5; give a fraction"),
        ({"ratio": True}, "ratio: expected between 0 and 1, got True; give a fraction"),
        ({"count": 1}, "count: expected a number of 2 or more, got 1; correct it"),
        ({"count": 2.5}, "count: expected a whole number of 2 or more, got 2.5; correct it"),
        ({"colour": "green"}, "colour: expected 'red' or 'blue', got 'green'; correct it"),
        ({"names": "one"}, "names: expected a valid tuple, got 'one'; correct it"),
        ({"weights": {"a": -1.0}}, "weights, a: expected a finite number of 0 or more, got -1.0; correct it"),
        ({"shift": math.inf}, "shift: expected a finite number, got inf; correct it"),
        ({"count": 1, "check": 1}, "count: .*; correct it\ncheck: expected a valid boolean, got 1; correct it"),
    ],
)
def test_a_wrong_value_is_named_with_its_cure(wrong: dict[str, Any], message: str) -> None:
    with pytest.raises(SignalError, match=f"^{message}$"):
        Example(**wrong)
    with pytest.raises(SignalError, match=f"^{message}$"):
        replace(Example(), **wrong)


def test_a_number_of_numpy_is_one() -> None:
    assert OneStage(iterations=np.int64(5), check=np.True_) == OneStage(iterations=5, check=True)  # type: ignore[arg-type]


def test_help_has_every_field_with_its_default_and_its_sentences() -> None:
    shown = " ".join(pydoc.render_doc(OneStage, renderer=pydoc.plaintext).replace("|", " ").split())
    sentences = meanings(OneStage)
    assert list(sentences) == [f.name for f in fields(OneStage)]
    assert all(sentence.endswith(".") and f"): {sentence}" in shown for sentence in sentences.values())
    assert "gate (default 6): Measurements with" in shown
    assert "Annotated" not in shown.partition("Data and other attributes")[0]
    assert ObserverOptions.__doc__ is not None
    assert "Tyres saturate at this peak friction" in ObserverOptions.__doc__, "the help of an option"


def test_arguments_state_what_differs_from_the_default() -> None:
    assert arguments(Example(ratio=0.1)) == []
    made = Example(ratio=1, names=["a", "b"])
    assert (made, made.as_dict()["names"]) == (Example(ratio=1.0, names=("a", "b")), ("a", "b"))
    assert (limits(Example, "ratio"), limits(Example, "shift")) == ((0, 1), (None, None))
    stated = arguments(Example(names=("a", "b"), check=False, place="here"))
    assert stated == ["--name=a", "--name=b", "--no-check", "--place=here"]


def test_a_command_has_every_option() -> None:
    """With its help; the defaults are valid."""
    commands: Any = typer.main.get_command(cli.app)
    groups = [commands, *(command for command in commands.commands.values() if hasattr(command, "commands"))]
    shown = [
        (flag, parameter.help or "")
        for group in groups
        for command in group.commands.values()
        for parameter in getattr(command, "params", ())
        for flag in parameter.opts
    ]
    for kind in (TruckOptions, ObserverOptions, IdentifyOptions, FleetSettings, LiveOptions):
        kind()
        for name, option in options_of(kind).items():
            flag = option.flags_of(name)[0].partition("/")[0]
            assert any(known == flag and text.startswith(option.help) for known, text in shown), flag
