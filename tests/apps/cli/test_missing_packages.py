"""A command whose extra is not installed names it."""

import json
import subprocess
import sys

import pytest

from tests.apps.live.truck_bus import write_files

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
    ("distributed", "fleet", ("fleet", "run", "manifest.csv", "--jobs", "2")),
    ("fsspec", "fleet", ("fleet", "run", "s3://depot/manifest.csv")),
    ("s3fs", "fleet", ("fleet", "run", "s3://depot/manifest.csv")),
    ("ziglang", "fmu", ("export", "fmu", "--vehicle", "cheng_cebon_2011")),
]


@pytest.fixture(scope="module")
def printed(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """What each command prints as an error, and its exit code, by package; one process runs all commands."""
    folder = tmp_path_factory.mktemp("commands")
    write_files(folder)
    (folder / "manifest.csv").write_text(MANIFEST)
    commands = json.dumps([(package, *arguments) for package, _, arguments in COMMANDS])
    command = [sys.executable, "-c", CODE, commands]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=folder, timeout=120)
    texts = [text.partition(":") for text in done.stderr.split("\0") if text]
    return {package: text for package, _, text in texts}


@pytest.mark.parametrize(("package", "extra"), [command[:2] for command in COMMANDS])
def test_the_error_names_the_extra(package: str, extra: str, printed: dict[str, str]) -> None:
    text = printed[package]
    assert text.endswith("code 2")
    assert text.startswith("error: ")
    assert f"pip install 'fifthwheel[{extra}]'" in text
    assert "pip install can\n" not in text  # another project
