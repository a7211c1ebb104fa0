"""Messages of the library in the words of the workbench: its questions in place of options of the command line."""

import re
from functools import cache

from fifthwheel.base.options import IdentifyOptions, TruckOptions
from fifthwheel.base.settings import Option, options_of

ONLY_PREDICT, NAME_OF_RESULT = "Only predict", "Name of the result"
"""Questions that are no options."""
_OTHERS = {"--validate": ONLY_PREDICT, "--out": NAME_OF_RESULT, "--force": "Delete", "--vehicle": "Vehicle file"}
COMMANDS = {"`fifthwheel signals`": "“Propose a map”", "`fifthwheel vehicle show`": "The page Truck"}
ELSEWHERE = (
    ", or Occasion(load=...)",
    ", or allow it if you trust that file (--allow-outside, allow_outside=True)",
    ", or answer on a terminal",
)
"""Cures that the workbench does not have."""
_OPTION = re.compile(r"(?<![\w-])(--[a-z][\w-]*)(?:([ =])([a-z][\w-]*))?")
_MARKED = re.compile(r'<span class="option">(--[\w-]+)</span>')
_VERBATIM = re.compile(r"(<(pre|script|style)\b.*?</\2>)", re.DOTALL)


def label(name: str, option: Option) -> str:
    """The question of the workbench for a setting."""
    return option.label or name.replace("_", " ").capitalize()


def in_workbench(text: str) -> str:
    """A message with the questions of the workbench in place of the options of the command line.

    >>> in_workbench("Use tyres that saturate (--tyres saturating).")
    'Use tyres that saturate (“Tyres”: “Saturating at the friction of the road, which is estimated”).'
    >>> in_workbench("state it (--set)")
    'state it (“State a number”)'
    """
    for cure in ELSEWHERE:
        text = text.replace(cure, "")
    for command, words in COMMANDS.items():
        text = text.replace(command, words)
    return _OPTION.sub(_question, text)


def page_in_workbench(page: str) -> str:
    """The same for HTML; what is verbatim, such as the command that reproduces a result, stays."""
    parts = _VERBATIM.split(page)
    return "".join(
        part if k % 3 else in_workbench(_MARKED.sub(r"\1", part)) for k, part in enumerate(parts) if k % 3 != 2
    )


def _question(found: re.Match[str]) -> str:
    flag, between, value = found.groups(default="")
    if flag not in _questions():
        return found[0]
    question, choices = _questions()[flag]
    return f"“{question}”: “{choices[value]}”" if value in choices else f"“{question}”{between}{value}"


@cache
def _questions() -> dict[str, tuple[str, dict[str, str]]]:
    found: dict[str, tuple[str, dict[str, str]]] = {flag: (words, {}) for flag, words in _OTHERS.items()}
    for name, option in options_of(TruckOptions).items():
        question = re.split("[;:,]", option.label or option.help.removesuffix("."))[0]
        found[option.flags_of(name)[0]] = question, {}
    for name, option in options_of(IdentifyOptions).items():
        for flag in option.flags_of(name)[0].split("/"):
            found[flag] = label(name, option), dict(option.choices)
    return found
