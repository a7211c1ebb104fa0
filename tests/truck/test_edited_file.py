"""A vehicle file with other numbers keeps its comments, and reads as the other vehicle."""

import re

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fifthwheel.truck import Vehicle, catalogue
from fifthwheel.truck.catalogue import edited
from tests.truck.test_classes import TEXT

FILE = catalogue.text("cheng_cebon_2011")
TRUCK = Vehicle.loads(FILE)


def comments(text: str) -> list[str]:
    return [comment.strip() for comment in re.findall(r"#(.*)", text)]


@settings(max_examples=25, deadline=None)
@given(
    path=st.sampled_from(sorted(TRUCK.parameters())), factor=st.floats(0.98, 1.02), sigma=st.none() | st.floats(0, 10)
)
def test_any_number_is_changed_alone(path: str, factor: float, sigma: float | None) -> None:
    changed = TRUCK.replace({path: factor * TRUCK.parameters()[path]})
    if sigma is not None:
        changed = changed.with_stated({path: sigma})
    text = edited(FILE, changed)
    assert Vehicle.loads(text) == changed
    assert sum(a != b for a, b in zip(text.splitlines(), FILE.splitlines(), strict=True)) <= 1
    assert len(comments(text)) == len(comments(FILE))


def test_the_comment_of_a_new_number_says_what_it_was() -> None:
    text = edited(FILE, TRUCK.replace({"semitrailer.cornering_stiffness": 1.2e6}))
    assert 'cornering_stiffness = "1200000.0 N/rad"' in text
    assert '# was "1273 kN/rad": published, (11)' in text


def test_the_comment_behind_an_inline_table_says_what_it_was() -> None:
    file = catalogue.text("a_double").replace(
        '{ name = "drive_front", position = "-5 m" },', '{ name = "drive_front", position = "-5 m" }, # by tape'
    )
    changed = Vehicle.loads(file).replace(
        {f"tractor.drive_{k}.position": x for k, x in (("front", -5.05), ("rear", -6.3))}
    )
    text = edited(file, changed)
    assert Vehicle.loads(text) == changed
    assert '{ name = "drive_front", position = "-5.05 m" }, # was "-5 m": by tape\n' in text
    assert '{ name = "drive_rear", position = "-6.3 m" },\n' in text


def test_the_same_vehicle_has_the_same_text() -> None:
    assert edited(FILE, TRUCK) == FILE


def test_a_number_of_a_class_becomes_a_line() -> None:
    truck = Vehicle.loads(TEXT)
    paths = ("tractor.drive.cornering_stiffness", "semitrailer.yaw_inertia", "fifth_wheel.height")
    changed = truck.replace({path: 1.1 * truck.parameters()[path] for path in paths})
    text = edited(TEXT, changed)
    assert Vehicle.loads(text) == changed
    assert set(truck.assumed) - set(Vehicle.loads(text).assumed) == set(paths)
    again = edited(text, changed.replace({"semitrailer.yaw_inertia": 5e5}))
    assert Vehicle.loads(again).parameters()["semitrailer.yaw_inertia"] == 5e5


@pytest.mark.parametrize("other", [TRUCK.lumped(), catalogue.get("auburn_6x4")])
def test_another_structure_has_its_own_text(other: Vehicle) -> None:
    assert Vehicle.loads(edited(FILE, other)) == other


def test_a_file_that_lists_its_assumed_numbers() -> None:
    truck = Vehicle.loads(TEXT)
    text = truck.to_toml()
    changed = truck.replace({"semitrailer.yaw_inertia": 4e5})
    assert Vehicle.loads(edited(text, changed)) == changed
    exact = Vehicle.loads("exact = true\n" + FILE)
    other = exact.replace({"semitrailer.yaw_inertia": 4e5})
    assert Vehicle.loads(edited("exact = true\n" + FILE, other)) == other


def test_an_assumed_number_becomes_a_key() -> None:
    """The number behind the # is not left beside it: both as keys would be no TOML."""
    assumed = '# yaw_inertia = "21900 kg m^2 +- 4900 kg m^2"   # radius of gyration'
    text = TEXT.replace('class = "tractor_4x2"\n', f'class = "tractor_4x2"\n{assumed}\n', 1)
    assert assumed in text
    vehicle = Vehicle.loads(text)
    changed = edited(text, vehicle.replace({"tractor.yaw_inertia": 25e3}))
    assert Vehicle.loads(changed).parameters()["tractor.yaw_inertia"] == 25e3
    assert "# yaw_inertia" not in changed
    assert '# was "21900 kg m^2 +- 4900 kg m^2", assumed: radius of gyration' in changed
