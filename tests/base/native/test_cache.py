"""The cache of machine code: valid entries are used, all others are ignored."""

import errno
import os
from pathlib import Path

import llvmlite
import numpy as np
import pytest
from llvmlite import binding

from fifthwheel.base.native import Scan, cache, scan
from tests.base.native.conftest import times

KEY, OTHER = bytes(range(32)), bytes(range(1, 33))
CODE = b"machine code " * 20
posix = pytest.mark.skipif(not hasattr(os, "getuid"), reason="needs POSIX permissions")


def entry(folder: Path, key: bytes = KEY) -> Path:
    return folder / f"{key.hex()}.o"


def result(factor: float = 2.0, name: str = "times") -> float:
    """Result of a new Scan for the samples 1, 2, 3: six times the factor."""
    return Scan(times(factor, name))(np.zeros(1), np.array([[1.0], [2], [3]]), np.ones(1))[0].item()


@pytest.fixture
def loaded(monkeypatch: pytest.MonkeyPatch) -> list[bytes]:
    """All object code that engines load during the test."""
    recorded: list[bytes] = []
    real = scan.llvm.ObjectFileRef.from_data
    monkeypatch.setattr(
        scan.llvm.ObjectFileRef, "from_data", staticmethod(lambda code: (recorded.append(code), real(code))[1])
    )
    return recorded


@pytest.fixture
def compiled(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """All sources that are compiled during the test."""
    recorded: list[str] = []
    real = scan._compile
    monkeypatch.setattr(scan, "_compile", lambda source, level: (recorded.append(source), real(source, level))[1])
    return recorded


def test_entry_is_read_back_and_private(cache_folder: Path) -> None:
    assert cache.read(KEY) is None
    before = os.umask(0)
    try:
        cache.write(KEY, CODE)
    finally:
        os.umask(before)
    assert cache.read(KEY) == CODE
    assert cache.read(OTHER) is None
    assert os.listdir(cache_folder) == [entry(cache_folder).name]
    if hasattr(os, "getuid"):
        assert entry(cache_folder).stat().st_mode & 0o777 == 0o600
        assert cache_folder.stat().st_mode & 0o777 == 0o700
        cache_folder.chmod(0o755)  # others may read
        assert cache.read(KEY) == CODE
    cache.write(KEY, b"")
    assert cache.read(KEY) == b""


def test_second_scan_compiles_nothing(cache_folder: Path, compiled: list[str], loaded: list[bytes]) -> None:
    assert result() == 12
    assert (len(compiled), len(list(cache_folder.iterdir()))) == (1, 1)
    assert result() == 12
    assert len(compiled) == 1
    assert loaded[0] == loaded[1]
    assert result(3.0) == 18
    assert (len(compiled), len(list(cache_folder.iterdir()))) == (2, 2)


def test_lanes_compilers_and_processors_have_separate_entries(
    cache_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    step = times(2.0)
    for lanes in (1, 4):
        Scan(step, lanes).batch(np.zeros((3, 1)), np.ones((2, 1)), np.ones((3, 1)))
    assert len(list(cache_folder.iterdir())) == 2
    assert result(name="another_name") == 12  # the key does not depend on the name
    assert len(list(cache_folder.iterdir())) == 2
    *machine, identity = scan._platform()
    assert {llvmlite.__version__, binding.get_host_cpu_name(), binding.get_host_cpu_features().flatten()} <= {
        *identity.decode().split("\n")
    }
    monkeypatch.setattr(scan, "_platform", lambda: (*machine, identity + b"another"))
    assert result() == 12
    assert len(list(cache_folder.iterdir())) == 3


def test_every_changed_byte_is_detected(cache_folder: Path) -> None:
    cache.write(KEY, CODE)
    path = entry(cache_folder)
    good = path.read_bytes()
    for i in range(0, len(good), 3):
        path.write_bytes(good[:i] + bytes([good[i] ^ 1]) + good[i + 1 :])
        assert cache.read(KEY) is None, i
    for length in (0, 1, 31, 32, 63, 64, 65, len(good) - 1):
        path.write_bytes(good[:length])
        assert cache.read(KEY) is None, length
    path.write_bytes(good + b"\0")
    assert cache.read(KEY) is None
    path.write_bytes(good)
    assert cache.read(KEY) == CODE


def with_header(key: bytes, code: bytes) -> bytes:
    return key + cache.DIGEST(key + code).digest() + code


@pytest.fixture
def foreign(cache_folder: Path) -> tuple[Path, bytes, bytes]:
    """Path of this step's entry, which does not exist; its key; and the object code of another step."""
    result(999.0)
    (path,) = cache_folder.iterdir()
    code = path.read_bytes()[64:]
    path.unlink()
    result()
    (path,) = cache_folder.iterdir()
    key = bytes.fromhex(path.stem)
    path.unlink()
    return path, key, code


def test_foreign_file_is_ignored_and_rewritten(
    foreign: tuple[Path, bytes, bytes], loaded: list[bytes], tmp_path: Path
) -> None:
    """Without the checks, this code would run: with a valid header it does."""
    path, key, code = foreign
    path.write_bytes(with_header(key, code))
    assert result() == 999 * 6
    assert loaded.pop() == code
    for content in (
        code,
        with_header(OTHER, code),
        key + cache.DIGEST(code).digest() + code,
        b"\x7fELF" + bytes(1000),
        b"",
    ):
        path.write_bytes(content)
        assert result() == 12
        assert code not in loaded
        assert path.read_bytes() == with_header(key, loaded[0])
    target = tmp_path / "target"
    target.write_bytes(with_header(key, code))
    path.unlink()
    path.symlink_to(target)
    assert result() == 12
    assert not path.is_symlink()
    assert target.read_bytes() == with_header(key, code)
    path.unlink()
    path.mkdir()  # it cannot be read or replaced
    assert result() == 12
    assert code not in loaded


@posix
@pytest.mark.parametrize("mode", [0o620, 0o602])
def test_entry_that_others_can_write_is_not_run(
    foreign: tuple[Path, bytes, bytes], loaded: list[bytes], mode: int
) -> None:
    path, key, code = foreign
    path.write_bytes(with_header(key, code))
    path.chmod(mode)
    assert cache.read(key) is None
    assert result() == 12
    assert code not in loaded
    assert path.stat().st_mode & 0o777 == 0o600  # a new file
    assert cache.read(key) == loaded[0]


@posix
@pytest.mark.parametrize(
    ("kind", "message"),
    [
        (0o720, "{0}: not used .*other users can write.*chmod 700 {0}"),
        (0o1777, "{0}: not used .*other users can write.*chmod 700 {0}"),
        ("link", "it is a link; .*name its target by FIFTHWHEEL_CACHE"),
        ("owner", "belongs to another user; .*name a folder of your own"),
    ],
)
def test_folder_that_others_can_write_or_own_and_a_link_are_not_used(
    foreign: tuple[Path, bytes, bytes],
    loaded: list[bytes],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    kind: int | str,
    message: str,
) -> None:
    path, key, code = foreign
    path.write_bytes(with_header(key, code))
    owner = os.getuid()
    if kind == "link":
        (tmp_path / "link").symlink_to(path.parent, target_is_directory=True)
        monkeypatch.setenv("FIFTHWHEEL_CACHE", str(tmp_path / "link"))
    elif kind == "owner":
        monkeypatch.setattr(os, "getuid", lambda: owner + 1)
    else:
        path.parent.chmod(kind)
    with pytest.warns(RuntimeWarning, match=message.format(path.parent)) as caught:
        assert cache.folder() is None
    assert len(caught) == 1
    assert cache.folder() is None  # the warning comes once
    assert result() == 12
    assert code not in loaded
    cache.write(OTHER, CODE)
    assert os.listdir(path.parent) == [path.name]
    path.parent.chmod(0o700)
    assert path.read_bytes() == with_header(key, code)
    if kind == "owner" and owner == 0:
        monkeypatch.undo()
        monkeypatch.setenv("FIFTHWHEEL_CACHE", str(path.parent))
        os.chown(path, 65534, 65534)
        assert cache.folder() == path.parent
        assert cache.read(key) is None


def test_empty_variable_switches_the_cache_off(
    cache_folder: Path, monkeypatch: pytest.MonkeyPatch, compiled: list[str]
) -> None:
    result()
    before = sorted(cache_folder.rglob("*"))
    monkeypatch.setenv("FIFTHWHEEL_CACHE", "")
    monkeypatch.chdir(cache_folder.parent)
    compiled.clear()
    assert cache.folder() is None
    assert result() == 12
    assert len(compiled) == 1
    assert sorted(cache_folder.rglob("*")) == before
    assert {p.name for p in cache_folder.parent.iterdir()} <= {"cache"}


def test_default_folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv("FIFTHWHEEL_CACHE")
    monkeypatch.setattr(cache, "user_cache_path", lambda *names: tmp_path.joinpath("home", *names[:1]))
    assert cache.folder() == tmp_path / "home" / "fifthwheel" / "native"
    assert result() == 12
    assert len(list((tmp_path / "home" / "fifthwheel" / "native").iterdir())) == 1


def test_folder_that_cannot_be_created_or_written_is_no_error(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    file, read_only = tmp_path / "file", tmp_path / "read_only"
    file.write_text("content")
    for path in (file, file / "cache"):
        monkeypatch.setenv("FIFTHWHEEL_CACHE", str(path))
        assert cache.folder() is None
        assert cache.read(KEY) is None
        cache.write(KEY, CODE)
        assert result() == 12
    assert file.read_text() == "content"
    read_only.mkdir(mode=0o500)
    monkeypatch.setenv("FIFTHWHEEL_CACHE", str(read_only))
    assert result() == 12
    read_only.chmod(0o700)


@pytest.mark.parametrize("call", ["chmod", "write_bytes", "replace"])
def test_full_disk_is_no_error(cache_folder: Path, monkeypatch: pytest.MonkeyPatch, call: str) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "no space left")

    assert cache.folder() == cache_folder
    with monkeypatch.context() as patch:
        patch.setattr(Path, call, full)
        assert result() == 12
    assert not list(cache_folder.iterdir())
    assert result() == 12
    assert len(list(cache_folder.iterdir())) == 1
