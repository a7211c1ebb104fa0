"""Names that others have chosen on a terminal, and packages that are missing."""

import io
import json
import subprocess
import sys

import pytest

from fifthwheel.apps.cli import common
from tests.apps.cli.conftest import TRUCK
from tests.apps.live.truck_bus import write_files

HOSTILE = "x\x1b[2J[/bold]\udcff"


def test_a_path_cannot_control_the_terminal(run):
    outcome = run("identify", f"missing {HOSTILE}.csv", "-v", TRUCK)
    assert outcome.code == 2
    assert outcome.err.startswith(r"error: missing x\u001b[2J[/bold]\udcff.csv: cannot be read")
    outcome = run("simulate", f"no folder {HOSTILE}/run.csv")
    assert outcome.code == 2
    assert r"no folder x\u001b[2J" in outcome.err
    assert "\x1b" not in outcome.err


def test_a_title_cannot_control_the_progress_bar(monkeypatch):
    class Terminal(io.StringIO):
        def isatty(self):
            return True

    shown = Terminal()
    monkeypatch.setattr(sys, "stderr", shown)
    monkeypatch.setenv("COLUMNS", "200")
    with common.progress_bar(quiet=False) as progress:
        progress(f"reading {HOSTILE}", 1, 2)
    assert r"x\u001b[2J[/bold]\udcff" in shown.getvalue()
    assert "\x1b[2J" not in shown.getvalue()


def test_devices_are_refused(run):
    for option in ("--signals", "--identification", "--vehicle"):
        outcome = run("states", "run.csv", *(() if option == "--vehicle" else ("-v", TRUCK)), option, "/dev/zero")
        assert outcome.code == 2
        assert outcome.err.startswith("error: /dev/zero")
    outcome = run("identify", "/dev/zero", "-v", TRUCK)
    assert outcome.err.startswith("error: /dev/zero: cannot be read, it is not a regular file")


LIVE = ("live", "--signals", "signals.toml", "--vehicle", "cheng_cebon_2011", "--bus")
MANIFEST = "log,truck,vehicle\na.csv,t,cheng_cebon_2011\nb.csv,t,cheng_cebon_2011\n"
CODE = """
import json, sys
from fifthwheel.apps import cli
for package, *arguments in json.loads(sys.argv[1]):
    sys.modules[package], sys.argv = None, ["fifthwheel", *arguments]
    print(f"{package}:", end="", file=sys.stderr)
    try:
        cli.main()
    except SystemExit as stop:
        print(f"code {stop.code}", end="\\0", file=sys.stderr)
    del sys.modules[package]
"""
COMMANDS = [
    ("cantools", "live", (*LIVE, "virtual:truck")),
    ("can", "live", (*LIVE, "virtual:truck")),
    ("msgpack", "live", (*LIVE, "udp_multicast:239.0.0.1")),
    ("nicegui", "app", ("app", "workspace", "--no-browser", "--port", "0")),
    ("distributed", "fleet", ("fleet", "run", "manifest.csv", "--scheduler", "tcp://127.0.0.1:9")),
    ("fsspec", "fleet", ("fleet", "run", "s3://depot/manifest.csv")),
    ("s3fs", "fleet", ("fleet", "run", "s3://depot/manifest.csv")),
    ("ziglang", "fmu", ("export", "fmu", "--vehicle", "cheng_cebon_2011")),
]


@pytest.mark.slow
def test_the_error_names_the_extra(tmp_path) -> None:
    """Of each package that is missing; one process runs all commands."""
    write_files(tmp_path)
    (tmp_path / "manifest.csv").write_text(MANIFEST)
    commands = json.dumps([(package, *arguments) for package, _, arguments in COMMANDS])
    command = [sys.executable, "-c", CODE, commands]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=tmp_path, timeout=120)
    texts = [text.partition(":") for text in done.stderr.split("\0") if text]
    for (package, extra, _), (printed, _, text) in zip(COMMANDS, texts, strict=True):
        assert printed == package
        assert text.endswith("code 2")
        assert text.startswith("error: ")
        assert f"pip install 'fifthwheel[{extra}]'" in text
        assert "pip install can\n" not in text  # another project
