"""A command whose extra is not installed names it."""

import subprocess
import sys

import pytest

from tests.live.truck_bus import write_files

LIVE = ("live", "--signals", "signals.toml", "--vehicle", "cheng_cebon_2011", "--bus")
MANIFEST = "log,truck,vehicle\na.csv,t,cheng_cebon_2011\nb.csv,t,cheng_cebon_2011\n"
CODE = "import sys; sys.modules[sys.argv.pop(1)] = None; from fifthwheel import cli; cli.main()"
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


@pytest.mark.parametrize(("package", "extra", "arguments"), COMMANDS)
def test_the_error_names_the_extra(package: str, extra: str, arguments: tuple[str, ...], tmp_path) -> None:
    write_files(tmp_path)
    (tmp_path / "manifest.csv").write_text(MANIFEST)
    command = [sys.executable, "-c", CODE, package, *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=tmp_path, timeout=120)
    assert done.returncode == 2, done.stderr
    assert done.stderr.startswith("error: ")
    assert f"pip install 'fifthwheel[{extra}]'" in done.stderr
    assert "pip install can\n" not in done.stderr  # another project
