"""The words for settings of each front end."""

import re
import shlex
from concurrent.futures import ThreadPoolExecutor
from contextvars import copy_context
from pathlib import Path

import pytest

import fifthwheel
from fifthwheel.apps.cluster import process_pool
from fifthwheel.base.spelling import command, front_end, setting, spelled_for

PLACES = ("base", "truck", "data", "model", "estimate", "results")
SPELLED = [
    (("load", "half"), 'Occasion(load="half")', "--load half", "“Load”: half"),
    (("load",), "Occasion(load=...)", "--load", "“Load”"),
    (("form", "prediction-error"), 'form="prediction_error"', "--form prediction-error",
     "“Compare the logs with”: “One-step predictions: robust to side wind”"),
    (("statements", "a.b=+- 5 cm", "c=exact"), 'given={"a.b": "+- 5 cm", "c": "exact"}',
     "--set a.b='+- 5 cm' --set c=exact",
     "“State a number”: a.b=+- 5 cm, c=exact"),
    (("wheelbase",), "wheelbase", "--wheelbase", "“Front axle to the first axle behind it”"),
    (("fifth_wheel",), "fifth_wheel", "--fifth-wheel", "“Front axle to the kingpin”"),
    (("check",), "check", "--check", "“Refuse implausible signals”"),
    (("force",), "force=True", "--force", "“Delete”"),
    (("model", "nonlinear"), "", "--model nonlinear", ""),
    (("allow_outside",), "allow_outside=True", "--allow-outside", ""),
]  # fmt: skip


@pytest.mark.parametrize(("words", "python", "option", "question"), SPELLED)
def test_each_front_end_has_its_words(words, python, option, question):
    assert setting(*words) == python
    with spelled_for("command line"):
        assert setting(*words) == option
    with spelled_for("workbench"):
        assert setting(*words) == question
    assert front_end() == "python"


def test_a_statement_survives_a_shell():
    with spelled_for("command line"):
        assert shlex.split(setting("statements", "steer.*.delay=+- 5 ms")) == ["--set", "steer.*.delay=+- 5 ms"]
    assert command("signals") == "`fifthwheel signals`"
    with spelled_for("workbench"):
        assert command("signals") == "“Propose a map”"


def test_threads_and_processes_of_a_front_end_have_its_words():
    with spelled_for("workbench"), ThreadPoolExecutor(1) as threads, process_pool(1) as processes:
        assert threads.submit(copy_context().run, front_end).result() == "workbench"
        assert processes.submit(front_end).result() == "workbench"


def test_no_sentence_of_the_library_names_an_option_of_the_command_line():
    root = Path(fifthwheel.__file__).parent
    for path in (path for place in PLACES for path in (root / place).rglob("*.py")):
        if path.name not in ("options.py", "spelling.py"):
            found = re.findall(r"(?<=[\s(\"'])--[a-z][a-z-]*+(?!:)", path.read_text())
            assert not [flag for flag in found if flag not in ("--src", "--dst", "--dst-storage", "--plot")], path
