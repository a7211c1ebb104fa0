"""Messages of the library as the workbench shows them."""

import re
from pathlib import Path

import pytest

import fifthwheel
from fifthwheel.apps.app import words
from fifthwheel.apps.workflow import starts_of
from fifthwheel.apps.workflow.vehicle_questions import describe
from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.options import IdentifyOptions
from fifthwheel.base.pages import Items, Table, Verbatim, html
from fifthwheel.estimate.identify import Verdict
from fifthwheel.results.diagnose import advice
from fifthwheel.truck import get

TRUCK = get("cheng_cebon_2011")
OPTION = re.compile(r"--[a-z]")


@pytest.mark.parametrize(
    "wrong",
    [
        {"statements": ("softening=exact",), "tyres": "saturating"},
        {"statements": ("road.friction=wet",), "tyres": "linear"},
        {"passes": 3},
        {"tyres": "linear", "method": "two-stage"},
        {"load": ("a", "b")},
    ],
)
def test_a_refused_setting_names_questions_of_the_page(wrong):
    with pytest.raises(FifthwheelError) as refused:
        starts_of(TRUCK, IdentifyOptions(**wrong))
    assert OPTION.search(str(refused.value))
    shown = words.in_workbench(str(refused.value))
    assert "“" in shown
    assert not OPTION.search(shown)


def test_an_answer_that_is_missing_names_the_question():
    answers = {"tractor": "tractor_4x2", "trailer": "semitrailer_3", "trailer_wheelbase": "7.7 m"}
    with pytest.raises(FifthwheelError) as refused:
        describe(answers)
    assert words.in_workbench(str(refused.value)) == (
        "wheelbase: expected a value, got none; give “Front axle to the first axle behind it”"
    )


def test_the_choice_of_an_option_is_in_words():
    assert words.in_workbench("with linear tyres: there use --tyres linear (6 times)") == (
        "with linear tyres: there use “Tyres”: “Linear, with an unknown softening” (6 times)"
    )
    assert words.in_workbench("prediction errors (--form=prediction-error).") == (
        "prediction errors (“Compare the logs with”: “One-step predictions: robust to side wind”)."
    )
    message = "another load? Name it (--load half, or Occasion(load=...)); what depends on it"
    assert words.in_workbench(message) == "another load? Name it (“Load” half); what depends on it"


def test_a_report_names_questions_but_keeps_the_command_that_reproduces_it():
    option = advice.VERDICTS[Verdict.NOT_CONVERGED][1]
    blocks = [
        Items(["Use tyres that saturate (--tyres saturating)."]),
        Table(("Option",), [(option,)]),
        Verbatim("fifthwheel identify a.csv --tyres saturating"),
    ]
    shown = words.page_in_workbench(html.blocks(blocks))
    assert OPTION.findall(shown) == ["--t"]
    assert "fifthwheel identify a.csv --tyres saturating</pre>" in shown
    assert "“State a number” NAME=" in shown
    assert "(“Tyres”: “Saturating at the friction" in shown


def test_what_has_no_option_stays():
    text = '<figure style="--panels: 3">--rate 1 kg -- <b>a--set</b>'
    assert words.page_in_workbench(text) == text


def test_each_phrase_that_is_replaced_exists():
    source = "".join(
        path.read_text() for path in Path(fifthwheel.__file__).parent.rglob("*.py") if "app" not in path.parts
    )
    joined = re.sub(r'"\n\s*f?"', "", source)
    for phrase in (*words.ELSEWHERE, *words.COMMANDS):
        assert phrase in joined, phrase
