"""The service and the container file are what systemd and docker accept."""

import json
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import typer

from fifthwheel.apps import cli

ROOT = Path(__file__).parents[3]
DEPLOY = ROOT / "deploy"
INSTRUCTIONS = ("FROM", "RUN", "COPY", "USER", "ENV", "WORKDIR", "VOLUME", "STOPSIGNAL", "ENTRYPOINT", "CMD")


def service() -> str:
    return (DEPLOY / "fifthwheel-live.service").read_text()


def container() -> list[tuple[str, str]]:
    text = re.sub(r"^#.*\n", "", (DEPLOY / "Dockerfile").read_text(), flags=re.MULTILINE).replace("\\\n", " ")
    return [tuple(line.split(maxsplit=1)) for line in text.splitlines() if line.strip()]  # type: ignore[misc]


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="needs systemd-analyze")
def test_systemd_accepts_the_service(tmp_path):
    unit = tmp_path / "fifthwheel-live.service"
    unit.write_text(service().replace("/opt/fifthwheel/bin/fifthwheel", sys.executable))
    checked = subprocess.run(["systemd-analyze", "verify", str(unit)], capture_output=True, text=True, check=False)
    complaints = [line for line in checked.stderr.splitlines() if unit.name in line]
    assert not complaints


def test_the_service_calls_the_command_with_its_options():
    (line,) = re.findall(r"^ExecStart=((?:.*\\\n)*.*)", service(), re.MULTILINE)
    words = shlex.split(line.replace("\\\n", " ").replace("%%", "%"))
    assert words[1] == "live"
    command = typer.main.get_command(cli.app).commands["live"]
    options = {option for parameter in command.params for option in parameter.opts}
    assert {word for word in words if word.startswith("--")} <= options
    assert "KillSignal=SIGINT" in service()


def test_the_container_file_is_valid():
    lines = container()
    assert lines[0][0] == "FROM"
    assert ":" in lines[0][1]  # a version
    assert {word for word, _ in lines} <= set(INSTRUCTIONS)
    for word, rest in lines:
        if word == "COPY":
            assert all((ROOT / source).exists() for source in rest.split()[:-1])
        if word in ("ENTRYPOINT", "CMD"):
            assert isinstance(json.loads(rest), list)
    words = [word for word, _ in lines]
    assert words.index("USER") > words.index("RUN")  # it does not run as root
    assert dict(lines)["STOPSIGNAL"] == "SIGINT"


def test_the_container_installs_extras_that_exist():
    (extras,) = re.findall(r"/source\[(.*?)\]", (DEPLOY / "Dockerfile").read_text())
    import tomllib

    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert set(extras.split(",")) <= project["optional-dependencies"].keys()
