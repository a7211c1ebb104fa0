"""Input files from others: whatever they contain, they are read or refused with the reason, within a second."""

import os
import time
from pathlib import Path

import pytest

from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.input_files import MAX_DEPTH, MAX_JSON_SIZE, MAX_TOML_SIZE, parse_toml, read_json, read_toml
from fifthwheel.data.logs import SignalMap
from fifthwheel.estimate.identify import Identification
from fifthwheel.estimate.online import Learner
from fifthwheel.model.plant import read_sensors
from fifthwheel.truck import Vehicle

POSIX = pytest.mark.skipif(os.name != "posix", reason="devices and FIFOs of POSIX")
READERS = (Vehicle.load, SignalMap.load, read_sensors, Identification.load, Learner.load)
HOSTILE_TOML = {
    "nested arrays": "x = " + "[" * 1900 + "]" * 1900,
    "nested tables": "x = " + "{a = " * 700 + "1" + "}" * 700,
    "dotted key": "[signals]\n" + ".".join("a" * 1900) + " = 1",
    "deep but parsed": "[" + ".".join("a" * (MAX_DEPTH + 1)) + "]\nx = 1",
    "digits": "x = " + "9" * 3990,
    "a large integer": "x = 9223372036854775808",
    "a long line": "x = " + "[0]," * 20_000,
    "cut": '[signals]\nspeed = "vx',
}


@pytest.mark.parametrize("text", HOSTILE_TOML.values(), ids=HOSTILE_TOML)
def test_hostile_toml_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "hostile.toml"
    path.write_text(text)
    with pytest.raises(FifthwheelError):
        parse_toml(text)
    for read in (Vehicle.load, SignalMap.load, read_sensors):
        with pytest.raises(FifthwheelError, match=r"hostile\.toml"):
            read(path)


def test_the_largest_toml_is_parsed_in_seconds() -> None:
    depth = MAX_DEPTH - 2  # with the table itself and its values
    header = "[" + ".".join("a" * depth) + "]\n"
    text = header + "\n".join(f"k{k} = 1" for k in range((MAX_TOML_SIZE - len(header)) // 12))
    start = time.process_time()
    table = parse_toml(text)
    assert time.process_time() - start < 10
    for _ in range(depth):
        table = table["a"]
    assert len(table) > 20_000


def test_a_key_is_not_hidden_by_a_string() -> None:
    for text in (r'"\"".' + "a." * 900 + '"b" = 1', "'\"'." + "a." * 900 + "'\"' = 1", "x = {" + "a." * 900 + "a = 1}"):
        with pytest.raises(FifthwheelError, match="line 1 has a key nested deeper"):
            parse_toml(text)
    dots = "." * 100
    assert parse_toml(f'# {dots}\na = "{dots}" # {dots}\nb = [{"1.5, " * 50}]')["a"] == dots


@pytest.mark.parametrize("text", ["[" * 100_000, '{"a":' * 100_000, "9" * 5000, "[" * 40 + "]" * 40, "{", ""])
def test_hostile_json_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "hostile.json"
    path.write_text(text)
    with pytest.raises(FifthwheelError, match=r"hostile\.json: not a JSON file|nested deeper"):
        read_json(path)
    for read in (Identification.load, Learner.load):
        with pytest.raises(FifthwheelError, match=r"hostile\.json"):
            read(path)


@POSIX
@pytest.mark.parametrize("make", [os.mkfifo, os.mkdir, lambda path: os.symlink("/dev/zero", path)])
def test_only_regular_files_are_read(tmp_path: Path, make) -> None:
    make(tmp_path / "x")
    for read in READERS:
        if make is os.mkdir and read == Identification.load:  # reads the file in a folder
            continue
        with pytest.raises(FifthwheelError, match="x: cannot be read, it is not a regular file"):
            read(tmp_path / "x")


def test_a_large_file_is_refused_without_reading_it(tmp_path: Path) -> None:
    with (tmp_path / "x").open("wb") as file:
        file.truncate(1 << 40)
    for read in READERS:
        with pytest.raises(FifthwheelError, match=f"larger than ({MAX_TOML_SIZE / 1e6:g}|{MAX_JSON_SIZE / 1e6:g}) MB"):
            read(tmp_path / "x")


def test_paths_links_and_texts(tmp_path: Path) -> None:
    """A missing path, text that is not UTF-8, a link, and the line ends of all systems."""
    (tmp_path / "x").write_bytes(b"a = '\xff'")
    for name, message in (("missing", "cannot be read"), ("a\0b", "cannot be read"), ("x", "text in UTF-8 expected")):
        for read in READERS:
            with pytest.raises(FifthwheelError, match=message):
                read(tmp_path / name)
    (tmp_path / "x").write_bytes(b"a = 1\r\nb = 2\rc = 3\n")
    if os.name == "posix":
        (tmp_path / "link").symlink_to("x")
        assert parse_toml(read_toml(tmp_path / "link")) == {"a": 1, "b": 2, "c": 3}
    assert parse_toml(read_toml(tmp_path / "x")) == {"a": 1, "b": 2, "c": 3}
