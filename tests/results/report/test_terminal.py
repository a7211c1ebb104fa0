"""Tables that fit a terminal of 80 columns."""

import io
from dataclasses import replace

import numpy as np
import pytest
from rich.console import Console

from fifthwheel.base import pages
from fifthwheel.base.formatting import plain_ascii, with_sigma
from fifthwheel.base.pages.terminal import COLOURS, show
from fifthwheel.results.report import identification_document, states_document
from fifthwheel.results.report.conclusion import MARKS, spoken_verdict
from tests.results.report.conftest import NASTY


def printed(document, terminal: bool = False) -> str:
    file = io.TextIOWrapper(io.BytesIO(), encoding="utf-8")
    show(document, Console(file=file, width=80, force_terminal=terminal, color_system="standard" if terminal else None))
    file.flush()
    return file.buffer.getvalue().decode()


@pytest.fixture(scope="module")
def text(every_verdict) -> str:
    return printed(identification_document(every_verdict))


def test_every_verdict_and_parameter_in_80_columns_of_ascii(text, every_verdict):
    assert set(COLOURS) == set(MARKS)
    for name in MARKS:
        assert spoken_verdict(name) in text
    assert max(len(line) for line in text.splitlines()) <= 80
    assert text.replace(NASTY, "").isascii()
    lines = text.splitlines()
    for estimate in (*every_verdict.parameters, *every_verdict.derived):
        value = plain_ascii(with_sigma(estimate.value, estimate.sigma, estimate.unit))
        assert any(line.startswith(estimate.name) and value in line for line in lines)
    assert "(validation log)" in " ".join(text.split())
    assert "yaw_rate.semitrailer" in text
    assert "Next steps" in text
    assert "nan" not in text.lower()


def test_a_real_terminal_gets_colour_and_signs_and_long_names_fold(every_verdict):
    text = printed(identification_document(every_verdict), terminal=True)
    assert "\x1b[" in text
    assert "±" in text
    long = replace(every_verdict.parameters[0], name="second_semitrailer.rear_bogie.cornering_stiffness")
    text = printed(identification_document(replace(every_verdict, parameters=(long,))))
    assert max(len(line) for line in text.splitlines()) <= 80
    assert "converged" in text


def test_states(result):
    states = replace(result.states[0], name="[red]log[/]")  # markup in a name is text
    assert "[red]log[/]" in printed(states_document([states], result.records))
    text = printed(states_document(result.states, result.records))
    assert max(len(line) for line in text.splitlines()) <= 80
    assert "sideslip.semitrailer" in text
    assert "too slow for the model" in " ".join(text.split())
    assert "yaw_rate.tractor" in text


def test_a_wheel_lift_is_announced(result):
    (states, *_) = result.states
    lifting = {**states.values, "predicted_load_transfer.semitrailer": np.where(states.time < 2, 0.0, -0.95)}
    text = printed(states_document([replace(states, values=lifting)], result.records))
    assert f"A wheel of semitrailer is about to lift at {states.time[states.time >= 2][0]:.1f} s." in text
    assert "lift" not in printed(states_document([states], result.records))


def test_a_name_cannot_control_the_terminal() -> None:
    console = Console(file=io.StringIO(), force_terminal=True, width=200)
    hostile = "x\x1b]0;title\x07\x1b[2J\u202e"
    blocks = (
        pages.Headline(hostile),
        pages.Paragraph(hostile),
        pages.Table((f"{hostile}\nsecond line>",), [(hostile,)]),
        pages.Items([hostile], "Title"),
    )
    show(pages.Document(hostile, blocks), console)
    printed = console.file.getvalue()
    assert printed.count(r"x\u001b]0;title\u0007\u001b[2J\u202e") == 5
    assert "\x1b]" not in printed
    assert "\x1b[2J" not in printed
