"""The conclusion in words: result, reasons, cautions, next steps."""

from dataclasses import replace

import numpy as np
import pytest

from fifthwheel.base import pages
from fifthwheel.data.checks import Fault, Finding
from fifthwheel.estimate.identify import Estimate
from fifthwheel.estimate.identify.doubts import Doubt, DoubtKind
from fifthwheel.estimate.identify.verdict import Verdict
from fifthwheel.results.diagnose import Advice
from fifthwheel.results.report import Conclusion, conclude_identification, conclude_states
from tests.results.report.conftest import NASTY


def with_verdict(identification, verdict, **changes):
    """The identification with its first parameter changed."""
    first, *rest = identification.parameters
    return replace(identification, parameters=(replace(first, verdict=verdict, **changes), *rest))


def test_all_identified(result):
    conclusion = conclude_identification(result.identification, result.records[:1])
    assert conclusion.good
    wide = "Rough, with a sigma above 15 %: the height of the trailer payload."
    assert conclusion.headline == f"All 5 parameters are identified from 1 log. {wide}"
    assert len([line for line in conclusion.results if "vehicle file" in line]) == 5
    assert any("CoG height, derived" in line for line in conclusion.results)
    (line,) = conclusion.not_identified  # the tyres of this truck are linear
    assert line.startswith("Road, friction (not excited): the logs reduce sigma too little")


@pytest.mark.parametrize(
    ("initial", "words"),
    [
        (8.35, " The wheelbase of the trailer is 0.390 m shorter than in the vehicle file (4.9 sigma)."),
        (7.48, " The wheelbase of the trailer is 0.480 m longer than in the vehicle file (6.0 sigma)."),
        (8.19, ""),
    ],
)
def test_a_wheelbase_that_differs_from_the_vehicle_file(result, initial, words):
    """From 3 sigma on."""
    numbers = {"value": 7.96, "sigma": 0.08, "unit": "m", "initial": initial}
    length = Estimate(name="semitrailer.wheelbase", **numbers, verdict=Verdict.CONVERGED, stage=1)
    plain = conclude_identification(result.identification).headline
    changed = replace(result.identification, derived=(*result.identification.derived, length))
    assert conclude_identification(changed).headline == plain + words


def test_a_wide_sigma_and_fixed_parameters(result):
    conclusion = conclude_identification(with_verdict(result.identification, Verdict.CONVERGED, sigma=2e5))
    wide = "15 %: the cornering stiffness of the front tyres and the height of the trailer payload."
    assert wide in conclusion.headline
    assert any("To improve the cornering stiffness of the front tyres" in line for line in conclusion.next_steps)
    fixed = tuple(replace(e, verdict=Verdict.FIXED) for e in result.identification.parameters)
    conclusion = conclude_identification(replace(result.identification, parameters=fixed))
    assert conclusion.headline == "All parameters are fixed: nothing was estimated."


@pytest.mark.parametrize(
    ("verdict", "changes", "reason", "advice"),
    [
        (Verdict.NOT_CONVERGED, {}, "(not converged): ", "Identify parts of the log"),
        (Verdict.AT_BOUND, {}, "limit of the permitted range", "error in the vehicle file"),
        (Verdict.FIXED, {}, "(fixed): ", ""),
        (Verdict.NOT_EXCITED, {"sigma": None}, "because the logs excite it too little", "add a log with a lane change"),
        (
            Verdict.NOT_IDENTIFIABLE,
            {"correlated_with": ("semitrailer.yaw_inertia",)},
            "strongly correlated with the yaw inertia of the trailer",
            "state the yaw inertia of the trailer with its uncertainty",
        ),
    ],
)
def test_each_verdict_has_a_reason_and_advice(result, verdict, changes, reason, advice):
    conclusion = conclude_identification(with_verdict(result.identification, verdict, **changes), result.records)
    assert any(reason in line for line in conclusion.not_identified)
    assert any(advice in line for line in conclusion.next_steps) or not advice
    assert "4 of 5" in conclusion.headline or verdict is Verdict.FIXED


def test_three_steps_are_shown_and_the_options_are_behind_them(result):
    steps = tuple(Advice(f"Step {k}.", f"--option-{k}" if k % 2 else "") for k in range(1, 6))
    conclusion = Conclusion(good=True, headline="Good.", steps=steps)
    items, folded = conclusion.box().columns[-1]
    assert items.lines == ("Step 1.", "Step 2.", "Step 3.")
    assert folded.summary == "Options of these steps, and 2 other steps"
    others, table = folded.blocks
    assert others.lines == ["Step 4: Step 4.", "Step 5: Step 5."]
    assert table.rows == [("1", "--option-1"), ("3", "--option-3"), ("5", "--option-5")]
    terminal = "\n".join(pages.Document("", conclusion.advice()).__str__().splitlines())
    assert "Step 3." in terminal
    assert "Step 4." not in terminal
    assert "--option" not in terminal
    assert "2 more and the options for them: report.html, Next steps." in terminal
    assert conclusion.as_dict()["next_steps"] == [step.message for step in steps]
    assert conclusion.as_dict()["steps"][0]["option"] == "--option-1"
    conclusion = Conclusion(good=True, headline="Good.")
    assert not any(isinstance(block, pages.Paragraph) for block in conclusion.advice())
    assert not any(isinstance(block, pages.Folded) for column in conclusion.box().columns for block in column)


def test_logs_that_nothing_explains_are_the_headline(result):
    """A fault of a signal is the cause before it, and a delay is not proposed."""
    doubt = Doubt(kind=DoubtKind.NOISE, causes=(), parameters=(), statistic=0.2)
    late = Finding(signal="yaw_rate.tractor", fault=Fault.TIME_OFFSET, severity="warning", message="late", log="a")
    unexplained = replace(result.identification, doubts=(doubt,), findings=(late,))
    conclusion = conclude_identification(unexplained)
    assert conclusion.headline == "The vehicle file or the signal map does not fit: the model does not explain 1 log."
    assert conclusion.cautions[0].startswith("The vehicle file or the signal map does not fit the logs: no single")
    assert not [text for text in (*conclusion.cautions, *conclusion.consequences) if "late" in text]
    stuck = replace(late, fault=Fault.STUCK, message="constant")
    conclusion = conclude_identification(replace(unexplained, findings=(stuck,)))
    assert "constant" in conclusion.cautions[0]
    assert "does not fit" not in conclusion.headline


def test_a_poor_prediction_does_not_validate(result):
    identification = result.identification
    assert any("(validation log)" in line for line in conclude_identification(identification).results)
    fits = tuple(f if f.identified_on else replace(f, explained=0.3, rms=10 * f.rms) for f in identification.fits)
    conclusion = conclude_identification(replace(identification, fits=fits))
    assert any("the model explains 30.0 % of the variance" in line for line in conclusion.cautions)
    assert conclusion.next_steps[0].endswith("for the identification too, because it is predicted poorly.")
    assert conclusion.headline.endswith(f" {NASTY} (validation) is predicted poorly.")
    assert not conclusion.good
    assert not any("(validation log)" in line for line in conclusion.results)


def test_conclusion_of_states(result):
    conclusion = conclude_states(result.states, result.records)
    assert not conclusion.good
    assert any("too slow for the model" in line for line in conclusion.results)
    assert any("sideslip.semitrailer" in line and "deg" in line for line in conclusion.results)
    large = replace(result.states[0], innovation={n: 3 * v for n, v in result.states[0].innovation.items()})
    conclusion = conclude_states([large], result.records)
    of_truck = conclude_identification(result.identification, result.records, states=[large])
    for cautions in (conclusion.cautions, of_truck.cautions):
        assert any("sigma of the states may be too small" in line for line in cautions)
    assert conclusion.headline.endswith("do not rely on these states.")
    assert not any("reliable" in line for line in conclusion.results)


def test_states_after_a_wheel_has_lifted(result):
    states = result.states[0]
    lifting = {**states.values, "load_transfer.semitrailer": np.where(states.time < 2, 0.0, 1.1)}
    conclusion = conclude_states([replace(states, values=lifting)], result.records)
    assert not conclusion.good
    assert conclusion.headline == "A wheel lifts: do not rely on the states from there on."
    assert "reliable" in conclude_states([states], result.records).headline
