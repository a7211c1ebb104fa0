"""Results are those that are stored: a change of the structure changes no bit, and any other change says which."""

import pytest

from tests.frozen.cases import CASES
from tests.frozen.stored import available, differences


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[] if case.fast else [pytest.mark.slow]) for name, case in CASES.items()]
)
def test_nothing_has_changed(name: str) -> None:
    if not available(name):
        pytest.skip("the logs are not present")
    found = differences(name)
    assert not found, "\n".join(found[:20])
