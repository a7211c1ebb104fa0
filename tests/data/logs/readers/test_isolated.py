"""Reading in a child process: whatever happens to the child, the parent gets samples or a SignalError."""

import os
import signal
import subprocess
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from fifthwheel.base.errors import SignalError
from fifthwheel.data.logs import read_log
from fifthwheel.data.logs.readers import child, isolated, open_log

LINUX = pytest.mark.skipif(sys.platform != "linux", reason="limits and forks of Linux")


@pytest.fixture
def log(tmp_path):
    """Opens a file whose reader acts on opening and on reading."""

    def opened(opening="", reading="", progress=lambda done: None):
        path = tmp_path / "log.faulty"
        path.write_text(f"{opening}\n{reading}\n")
        return isolated.open_isolated(path, "tests.data.logs.readers.faulty", "FAULTY", [], progress)

    return opened


def rows(source, *names):
    return sum(len(next(iter(chunk.values.values()))) for chunk in source.chunks(names or ("x", "y")))


def gone(pid: int, seconds: float = 5.0) -> bool:
    """Whether a process ends within some time."""
    for _ in range(round(seconds / 0.02)):
        with suppress(FileNotFoundError, ProcessLookupError):  # it may end while it is looked at
            if Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z":
                time.sleep(0.02)
                continue
        return True
    return False


def test_a_reader_that_was_started_before_reads_the_next_file(log):
    """Only one waits, and another one is started if it has ended."""
    isolated._end_idle_children()
    isolated.start_reader()
    (ended,) = isolated._idle
    ended.kill()
    isolated.start_reader()
    isolated.start_reader()
    (started,) = isolated._idle
    with log() as source:
        assert source._child is started
        assert rows(source, "x") == 10_000
    assert started in isolated._idle


def test_samples_columns_and_notes_come_through(log):
    told = []
    with log(progress=told.append) as source:
        assert told[-1] == 1.0
        assert source.columns["x"].unit == "m"
        assert source.notes == ["opened"]
        chunks = list(source.chunks(["x"]))
        assert [chunk.done for chunk in chunks] == [k / 10 for k in range(1, 11)]
        assert all(chunk.clock == "c" for chunk in chunks)
        time = np.concatenate([chunk.time for chunk in chunks])
        assert (time == np.arange(10_000.0)).all()
        assert (np.concatenate([chunk.values["x"] for chunk in chunks]) == 2 * time).all()
        chunks[0].values["x"][0] = 1.0  # not read-only
        assert source.notes == ["opened", "read"]
        assert source.unusable == {"y": "no numbers"}
        table = next(source.chunks(["y"]))
        assert table.time is None
        assert np.isnan(table.values["y"]).all()
        with pytest.raises(SignalError, match="no column 'z'"):
            list(source.chunks(["z"]))


FAULTS = {
    "crash": r"log\.faulty: reading as FAULTY crashed \(SIGSEGV\)\. .*copy it again.*FIFTHWHEEL_READER_MEMORY",
    "exit": r"log\.faulty: reading as FAULTY crashed \(exit code 3\)",
    "refuse": "^refused$",
    "foreign": r"log\.faulty: cannot be read as FAULTY \(KeyError: 'some key'\); copy it again",
    "import": r"in the format FAULTY, and no_such_library is not installed; pip install 'fifthwheel\[logs\]'",
}


@pytest.mark.slow
@LINUX
def test_an_error_names_the_file_and_the_cure(log, monkeypatch, tmp_path):
    """On opening and on reading; temporary files are removed."""
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "temporary"))
    (tmp_path / "temporary").mkdir()
    for fault, error in FAULTS.items():
        with pytest.raises(SignalError, match=error):
            log(fault)
        with pytest.raises(SignalError, match=error), log("", fault) as source:
            rows(source)
        with log() as source:
            assert rows(source) == 10_030
    with pytest.raises(KeyboardInterrupt):
        log(progress=lambda done: signal.raise_signal(signal.SIGINT))
    with log("print", "print") as source:  # what a library prints is no message
        assert rows(source) == 10_030
    with log("names") as source:
        assert list(source.columns) == ["y"]
        assert rows(source, "y") == 30
        assert source.notes[-1].startswith("1 columns left out: a name, unit or group of more than 1000 characters")
    assert list((tmp_path / "temporary").iterdir()) == []


@LINUX
def test_limits_of_the_environment(log, monkeypatch):
    for name, value in ((child.SECONDS, "soon"), (child.MEMORY, "-1")):
        monkeypatch.setenv(name, value)
        with pytest.raises(SignalError, match=f"{name} is '{value}', a positive number expected"):
            log()
        monkeypatch.delenv(name)
    monkeypatch.setenv(child.MEMORY, "1000")
    with pytest.raises(SignalError, match=r"needs more than 1000 MB; if it is intact, set FIFTHWHEEL_READER_MEMORY to"):
        log("memory")


@pytest.mark.slow
@pytest.mark.parametrize("commands", [("hang",), ("", "block"), ("crawl",)])
def test_a_reader_without_progress_or_end_is_stopped(log, monkeypatch, commands):
    rows(log())  # the process has started, which is slow on a busy machine
    monkeypatch.setenv(child.SECONDS, "0.6")
    stopped = r"stopped after 1 s without progress.*If it is intact, set FIFTHWHEEL_READER_SECONDS"
    if commands == ("crawl",):
        monkeypatch.setattr(child, "_TOTAL", 2)
        stopped = r"stopped after 1 s\. The file is probably damaged"
    with pytest.raises(SignalError, match=stopped):
        rows(log(*commands))


def test_more_samples_than_permitted(log, monkeypatch):
    monkeypatch.setenv(child.SAMPLES, "0.1")
    with pytest.raises(SignalError, match=r"log\.faulty: its samples need more than 0 MB; map fewer .*SAMPLES to more"):
        rows(log())
    monkeypatch.setenv(child.SAMPLES, "0.5")
    with log() as source:
        assert rows(source) == rows(source) == 10_030  # the limit is that of one reading


@pytest.mark.parametrize("fault", ["", "crash", "refuse"])
def test_a_log_that_is_closed_or_has_failed_is_not_read(log, fault):
    """Nor one that is read again before."""
    source = log("", fault)
    unfinished = source.chunks(["x"])
    next(unfinished)
    with suppress(SignalError):
        rows(source)
    if not fault:
        again = source.chunks(["x"])
        next(again)
        next(source.chunks(["x"]))
        with pytest.raises(SignalError, match="read again before this reading was finished"):
            next(again)
        source.close()
    with log() as other:  # in the same process, unless that crashed
        for reading in (unfinished, source.chunks(["x"])):
            with pytest.raises(SignalError, match="closed"):
                next(reading)
        assert rows(other) == 10_030
    source.close()


@LINUX
def test_one_process_serves_many_files_each_in_a_fork(log, tmp_path):
    seen = []
    for opening in ("", "refuse", "", "foreign", ""):
        with suppress(SignalError), log(opening) as source:
            rows(source)
        seen.append((tmp_path / "log.pid").read_text().split())
    assert len({fork for fork, _ in seen}) == 5
    assert len({server for _, server in seen}) == 1


def test_several_threads_read_at_a_time(tmp_path):
    found = {}

    def read(k):
        path = tmp_path / f"{k}.faulty"
        path.write_text("\n\n")
        source = isolated.open_isolated(path, "tests.data.logs.readers.faulty", "FAULTY", [], lambda done: None)
        with source:
            found[k] = rows(source)

    threads = [threading.Thread(target=read, args=(k,)) for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == dict.fromkeys(range(4), 10_030)


@pytest.mark.slow
@LINUX
@pytest.mark.parametrize(("fault", "end"), [("block", signal.SIGKILL), ("hang", signal.SIGINT)])
def test_the_child_ends_with_its_parent(tmp_path, end, fault):
    (tmp_path / "good").write_text("\n\n")
    (tmp_path / "log.faulty").write_text(f"{fault}\n\n")
    code = (
        "import os; from pathlib import Path; from fifthwheel.data.logs.readers.isolated import open_isolated\n"
        "def log(name): return open_isolated(Path(name), 'tests.data.logs.readers.faulty', '', [], lambda done: None)\n"
        f"log('good').close(); os.environ['{child.SECONDS}'] = '1'; log('log.faulty')"
    )
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path), "TMPDIR": str(tmp_path)}
    parent = subprocess.Popen([sys.executable, "-c", code], env=environment, stderr=subprocess.DEVNULL, cwd=tmp_path)
    while parent.poll() is None and not (tmp_path / "log.pid").exists():
        time.sleep(0.01)
    time.sleep(0.1)
    parent.send_signal(end)
    parent.wait(5)
    assert all(gone(int(pid)) for pid in (tmp_path / "log.pid").read_text().split())
    assert not list(tmp_path.glob("fifthwheel-*"))


@LINUX
@pytest.mark.parametrize("make", [os.mkfifo, os.mkdir, lambda path: os.symlink("/dev/zero", path)])
def test_only_regular_files_are_read(tmp_path, make):
    make(tmp_path / "log.mf4")
    with pytest.raises(SignalError, match=r"log\.mf4: cannot be read, it is not a regular file"):
        read_log(tmp_path / "log.mf4")


def test_a_missing_library_is_named(tmp_path, monkeypatch):
    (tmp_path / "asammdf.py").write_text("raise ImportError('no asammdf', name='asammdf')")
    monkeypatch.syspath_prepend(tmp_path)
    isolated._end_idle_children()  # one that has not imported it
    (tmp_path / "log.mf4").write_bytes(b"MDF     4.10    x")
    with pytest.raises(SignalError, match=r"in the format ASAM MDF, and asammdf is not installed; pip install 'fifth"):
        open_log(tmp_path / "log.mf4")
    isolated._end_idle_children()
