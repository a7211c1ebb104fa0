"""Packages that only some functions need."""

import pytest

from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.lazy import require


def test_files_that_pip_left_behind_are_no_package(tmp_path, monkeypatch) -> None:
    (tmp_path / "left_behind" / "plugin").mkdir(parents=True)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(FifthwheelError, match=r"left_behind is needed but not installed; pip install"):
        require("left_behind", "plant")
    assert require("json.decoder", "plant").JSONDecoder
