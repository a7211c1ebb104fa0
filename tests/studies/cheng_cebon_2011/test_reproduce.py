"""The reproduction before it simulates: missing packages."""

import sys
from pathlib import Path

import pytest

from fifthwheel.errors import FifthwheelError
from fifthwheel.studies.cheng_cebon_2011 import reproduce


@pytest.mark.parametrize("module", ["mujoco", "matplotlib"])
def test_missing_packages_are_named(module: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(FifthwheelError, match=rf"needs {module}, .*pip install 'fifthwheel\[studies\]'"):
        reproduce(tmp_path)
    assert not list(tmp_path.iterdir())
