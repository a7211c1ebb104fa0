"""Public names of earlier versions work where they were, with a warning."""

import importlib

import pytest

import fifthwheel as fw
from fifthwheel.cheng_cebon_2011.reproduce import reproduce

MOVED = {
    ("fifthwheel", "assess_information"): fw.predict_sigmas,
    ("fifthwheel", "check_record"): fw.check_signals,
    ("fifthwheel.identify", "TwoStage"): fw.TwoStage,
    ("fifthwheel.identify", "article"): fw.article,
    ("fifthwheel.studies.cheng_cebon_2011", "reproduce"): reproduce,
}


@pytest.mark.parametrize(("module", "name"), MOVED)
def test_a_moved_name_works_with_a_warning(module: str, name: str) -> None:
    package, today = importlib.import_module(module), MOVED[module, name]
    with pytest.warns(DeprecationWarning, match=f"{module}.{name} has moved; import {today.__name__} from fifthwheel"):
        found = getattr(package, name)
    assert found is today


def test_other_names_do_not_exist() -> None:
    with pytest.raises(AttributeError, match="no attribute 'banana'"):
        importlib.import_module("fifthwheel.identify").banana  # noqa: B018
