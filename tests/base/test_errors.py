"""Exceptions, and the suggestion that ends a message about an unknown name."""

import pytest

from fifthwheel.base.errors import MAX_MESSAGE, SignalError, printable, suggestion


@pytest.mark.parametrize(
    ("name", "known", "text"),
    [
        ("masss", ["mass", "cog"], "did you mean 'mass'?"),
        ("fornt", ["front", "frond", "drive"], "did you mean 'front' or 'frond'?"),
        ("x", ["mass", "cog"], "available: mass, cog"),
        ("x", [], "available: none"),
    ],
)
def test_similar_names_are_suggested_and_otherwise_all_are_listed(name: str, known: list[str], text: str) -> None:
    assert suggestion(name, known) == text


CONTROL = "\x1b]0;title\x07 \x9b2J \u202egnp \r \x7f \udcff \u2028"


def test_a_message_has_no_control_characters() -> None:
    shown = str(SignalError(f"a\tb\n{CONTROL}"))
    assert shown.startswith("a\tb\n\\u001b]0;title\\u0007 \\u009b2J \\u202egnp \\u000d \\u007f \\udcff")
    assert all(c.isprintable() for c in shown.replace("\n", "").replace("\t", ""))
    shown.encode()
    assert len(str(SignalError("x" * 10**6))) < MAX_MESSAGE + 50
    assert printable("a\nb") == "a\\u000ab"
    assert printable("γ ± 1 °/s, 車") == "γ ± 1 °/s, 車"
