"""The documentation is complete, its tables say what the code does, its examples run and its links lead somewhere."""

import importlib
import os
import re
import shlex
import shutil
import subprocess
import sys
from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest
import typer
from pydantic import BaseModel

import fifthwheel
from fifthwheel import truck as vehicle
from fifthwheel.apps import cli
from fifthwheel.apps.cheng_cebon_2011 import TwoStage
from fifthwheel.data.channels.table import ALL
from fifthwheel.data.checks import Fault
from fifthwheel.data.logs import SignalMap
from fifthwheel.data.logs.signal_map import SignalSource, TimeColumn
from fifthwheel.estimate.identify import OneStage
from fifthwheel.estimate.identify.verdict import Verdict
from fifthwheel.estimate.observe import ObserverSettings, Status
from fifthwheel.estimate.online import LearnerSettings
from fifthwheel.model import plant
from fifthwheel.model.manoeuvres import MANOEUVRES
from fifthwheel.results.evaluate import METHODS
from fifthwheel.results.evaluate.tolerances import DEFAULTS
from fifthwheel.truck import Axle, AxleGroup, Coupling, Payload, SprungMass, Unit, Vehicle
from fifthwheel.truck.classes import CLASSES
from fifthwheel.truck.component import Component
from fifthwheel.truck.driveline import Driveline
from fifthwheel.truck.toml_format import FILE_KEYS
from tests.test_architecture import SOURCE

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")), *sorted((ROOT / "docs" / "howto").glob("*.md"))]
TRUCK = vehicle.get("cheng_cebon_2011")
COMMANDS: dict[str, Any] = typer.main.get_command(cli.app).commands  # type: ignore[attr-defined]


def page(name: str) -> str:
    return (ROOT / "docs" / name).read_text(encoding="utf-8")


def extension(name: str) -> Any:
    """A module of the site."""
    pytest.importorskip("sphinx")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(ROOT / "docs" / "_extensions")
        return importlib.import_module(name)


def site_page(name: str) -> str:
    """A page with the tables that the site adds."""
    return str(extension("generated_tables").with_tables(page(name)))


def prose(text: str) -> str:
    """A page without its code."""
    return re.sub(r"^```.*?^```$", "", text, flags=re.MULTILINE | re.DOTALL)


def rows(text: str) -> list[list[str]]:
    """Cells of every line of a table."""
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines() if line[:1] == "|"]


def blocks(path: Path, language: str, marker: str = "") -> list[str]:
    """The code of a page, or that behind the marker."""
    pattern = rf"^{marker}```{language}\n(.*?)^```$"
    return re.findall(pattern, path.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)


SLOW = {("live", "python"), ("limits", "python")}
"""Pages and languages of the examples that compile the learner, or the observer with saturating tyres."""


def examples(language: str, marker: str = "") -> list[object]:
    return [
        pytest.param(block, id=f"{path.stem}-{i}", marks=[pytest.mark.slow] if (path.stem, language) in SLOW else [])
        for path in PAGES
        for i, block in enumerate(blocks(path, language, marker))
    ]


def section(text: str, title: str) -> str:
    """What stands under a heading, up to the next of its level or above."""
    text = prose(text)
    head = re.search(rf"^(#+) {re.escape(title)}$", text, re.MULTILINE)
    assert head, title
    end = re.search(rf"^#{{1,{len(head[1])}}} ", text[head.end() :], re.MULTILINE)
    return text[head.end() :][: end.start() if end else None]


PREFIXES: dict[type[BaseModel], str] = {
    Unit: "<unit>",
    SprungMass: "<unit>.sprung",
    Payload: "<unit>.payload",
    AxleGroup: "<group>",
    Axle: "<unit>.<axle>",
    Coupling: "<coupling>",
    Driveline: "driveline",
}
SI_UNITS = {key: unit for kind in Component.__subclasses__() for key, unit in kind.si_units.items()}
PARAMETERS = [f"{prefix}.{w}" for kind, prefix in PREFIXES.items() for w in kind.model_fields if w in SI_UNITS]


def test_every_parameter_of_a_vehicle_is_in_the_glossary() -> None:
    table = {cells[0]: cells[1] for cells in rows(section(site_page("glossary.md"), "Parameters of the vehicle"))}
    for pattern in PARAMETERS:
        assert table[f"`{pattern}`"] == SI_UNITS[pattern.rpartition(".")[2]], pattern
    assert {pattern.rpartition(".")[2] for pattern in PARAMETERS} == set(SI_UNITS)
    assert {path.rpartition(".")[2] for path in TRUCK.parameters()} <= set(SI_UNITS)
    for word in {path.rpartition(".")[2] for path in TRUCK.derived()}:
        assert f"`<unit>.{word}`" in page("glossary.md")


def test_every_quantity_of_a_log_is_told_with_its_unit() -> None:
    told: dict[str, str] = {}
    for cells in rows(section(page("signals.md"), "Names")):
        quantities = re.findall(r"`([^`]+)`", cells[0])
        units = [unit.strip() for unit in cells[1].split(",")]
        told |= dict(zip(quantities, units if len(units) > 1 else units * len(quantities), strict=True))
    assert told == {channel.quantity: channel.unit for channel in ALL}  # without those of other tests


def test_every_fault_verdict_and_status_is_told() -> None:
    faults = {cells[0] for cells in rows(section(page("signals.md"), "Faults"))}
    assert {f"`{fault.value}`" for fault in Fault} <= faults
    verdicts = {cells[0] for cells in rows(section(page("verdicts.md"), "Verdicts"))}
    assert {f"`{verdict.value}`" for verdict in Verdict} <= verdicts
    states = {cells[0]: cells[1] for cells in rows(section(page("states.md"), "Status"))}
    assert {f"`{status.name}`": str(int(status)) for status in Status}.items() <= states.items()


def test_every_setting_has_its_line_in_the_tables_of_the_site() -> None:
    tables = "\n".join(extension("settings_reference").reference())
    for settings in (OneStage(), TwoStage(), LearnerSettings(), ObserverSettings()):
        kind = type(settings).__name__
        assert f"`{kind}`" in page("settings.md")
        lines = {cells[0].strip("`"): cells[1:] for cells in rows(section(tables, kind))[2:]}
        assert list(lines) == [field.name for field in fields(settings)]
        assert all(meaning for *_, meaning in lines.values())
    two_stage = {cells[0].strip("`"): cells[1:3] for cells in rows(section(tables, "TwoStage"))[2:]}
    assert two_stage["forgetting"] == ["`1`", "`0.999`"]
    assert two_stage["gate"] == ["`6`", "`1000000.0`"]


def test_every_public_name_is_on_a_page_of_the_reference() -> None:
    entries = [entry for page in extension("python_reference").pages().values() for entry in page]
    assert len({entry.name for entry in entries}) == len(entries)
    names = {entry.name.partition(".")[0] for entry in entries} | {entry.name for entry in entries}
    assert set(fifthwheel.__all__) - {"__version__"} <= names
    assert {"identify", "vehicle", "estimate.identify.doubts.Doubt", "model.dynamics.summary.VehicleSummary"} <= names
    assert [entry.name for entry in entries if not entry.summary()] == []


def test_every_key_of_the_maps_is_told() -> None:
    table = rows(section(site_page("signals.md"), "signals.toml"))
    clock, first = (
        next(i for i, cells in enumerate(table) if cells[0] == f"`[{name}]`") for name in ("time", "signals")
    )
    assert {f"`{key}`" for key in TimeColumn.model_fields} == {cells[1] for cells in table[clock:first]}
    assert {f"`{key}`" for key in SignalSource.model_fields} <= {cells[1] for cells in table[first:]}
    for name in SignalMap.model_fields:
        assert any(f"`[{name}]`" in cells[0] or cells[0] == f"`{name}`, a list" for cells in table)


def by_first_cell(name: str, title: str) -> dict[str, list[str]]:
    """The other cells of each line of a table of the site, by the first."""
    return {cells[0].strip("`"): cells[1:] for cells in rows(section(site_page(name), title))[2:]}


def test_tables_of_names_are_complete() -> None:
    assert by_first_cell("vehicle.md", "The catalogue").keys() == set(vehicle.names())
    classes = {name: cells[0] for name, cells in by_first_cell("vehicle.md", "Vehicle classes").items()}
    assert classes == {name: kind.description for name, kind in CLASSES.items()}
    assert {name: cells[0] for name, cells in by_first_cell("evaluate.md", "Tolerances").items()} == dict(DEFAULTS)
    methods = by_first_cell("evaluate.md", "The methods")
    assert {name: cells[0] for name, cells in methods.items()} == {n: method.standard for n, method in METHODS.items()}
    named = {name for cells in methods.values() for name in cells[1].replace("`", "").split(", ")}
    assert named <= set(MANOEUVRES)
    forms = {
        name: [
            "acceleration" if m.acceleration else "open loop" if m.open_loop else "",
            "path" if m.path else "open loop" if m.open_loop else "",
        ]
        for name, m in MANOEUVRES.items()
    }
    assert {name: cells[:2] for name, cells in by_first_cell("plant.md", "Manoeuvres").items()} == forms
    assert {field.name for field in fields(plant.Properties)} <= by_first_cell("plant.md", "Properties").keys()
    text = site_page("plant.md")
    for field in fields(plant.Sensor):
        assert re.search(rf"^{field.name} = ", text, re.MULTILINE), field.name


def test_every_key_of_a_vehicle_file_is_in_the_example() -> None:
    example = (ROOT / "examples" / "every_key.toml").read_text(encoding="utf-8")
    assert Vehicle.loads(example).axle_loads()
    texts = blocks(ROOT / "docs" / "vehicle.md", "text")
    example += next(block for block in texts if block.startswith("[steering]")).join(["\n", ""])
    kinds: list[type[BaseModel]] = [Vehicle, *PREFIXES]
    for kind in kinds:
        for field in kind.model_fields:
            assert re.search(rf"\b{FILE_KEYS.get(field, field)}\b( =|\]\])|\.{field}[].]|\n\[{field}\]", example), field


@pytest.mark.slow
@pytest.mark.parametrize("block", examples("python", "<!-- runnable -->\n"))
def test_examples_run(
    block: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    exec(compile(block, "example", "exec"), {"__name__": "example"})
    if expected := re.search(r"^# prints (.*)$", block, re.MULTILINE):
        assert capsys.readouterr().out.strip() == expected[1]


@pytest.mark.parametrize("block", examples("toml"))
def test_toml_is_read(block: str, tmp_path: Path) -> None:
    if "[[unit]]" in block:
        truck = Vehicle.loads(block)
        assert [unit.name for unit in truck.units] == ["tractor", "semitrailer"]
        assert truck.axle_loads()
    elif "[signals" in block:
        assert SignalMap.parse(block).signals
    else:
        file = tmp_path / "sensors.toml"
        file.write_text(block, encoding="utf-8")
        assert plant.read_sensors(file)


@pytest.mark.parametrize("block", examples("sh"))
def test_commands_exist_with_their_options(block: str) -> None:
    for line in re.findall(r"^(?:\S*/)?fifthwheel (.*)$|&& \S*/fifthwheel (.*)$", block, re.MULTILINE):
        name, *words = shlex.split("".join(line), comments=True)
        if name != "--version":
            command = COMMANDS[name]
            if subcommands := getattr(command, "commands", None):
                named = bool(words) and words[0] in subcommands
                command = subcommands[words.pop(0)] if named else subcommands["catalogue"]
            own = {flag for option in command.params for flag in (*option.opts, *option.secondary_opts)}
            for word in words:
                assert not re.match("--?[a-z]", word) or word.partition("=")[0] in own, line


def agree(shown: str, printed: str) -> bool:
    """Whether two words are the same, or numbers that differ only by rounding."""
    try:
        return float(printed) == pytest.approx(float(shown), rel=0.03, abs=5e-5)
    except ValueError:
        return shown == printed


@pytest.mark.slow
@pytest.mark.parametrize("name", ["start", "logs", "howto/measure", "howto/plan", "knowledge"])
def test_shown_output_is_that_of_the_commands(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Each block of text after commands consists of lines that they print, in this order. Later commands do not run."""
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "120")
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}:{os.environ['PATH']}")
    steps = re.findall(r"^```sh\n(.*?)^```\n(?:\n```text\n(.*?)^```)?", page(f"{name}.md"), re.MULTILINE | re.DOTALL)
    while not steps[-1][1]:
        steps.pop()
    for commands, shown in steps:
        if re.search(r"pip install|\brun\.(csv|mf4|blf)", commands):
            continue
        for line in commands.splitlines():
            run_line(line)
        text = capsys.readouterr().out
        printed = iter(line.split() for line in text.splitlines())
        for line in filter(None, map(str.split, shown.splitlines())):
            found = (len(line) == len(other) and all(map(agree, line, other)) for other in printed)
            assert any(found), f"not printed: {' '.join(line)}\n{text}"


def run_line(line: str) -> None:
    """A line of a shell; fifthwheel runs inside this process, unless its output goes to a file."""
    name, *words = shlex.split(line, comments=True)
    if name != "fifthwheel" or ">" in words:
        subprocess.run(["bash", "-e", "-c", line], capture_output=True, check=True)
        return
    code: object = 0
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", [name, *words])
        try:
            cli.main()
        except SystemExit as stop:
            code = stop.code
    assert not code, line


def anchors(path: Path) -> set[str]:
    """Anchors of a page's headings, as forges make them, with those that the site adds."""
    text = path.read_text(encoding="utf-8")
    if path.name == "settings.md":
        text += "\n".join(extension("settings_reference").reference())
    titles = re.findall(r"^#+ (.*)$", prose(text), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


@pytest.mark.parametrize("path", [*PAGES, ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md"], ids=lambda path: path.stem)
def test_links_lead_somewhere(path: Path) -> None:
    for target in re.findall(r"\]\(([^)\s]+)\)", prose(path.read_text(encoding="utf-8"))):
        if re.match(r"[a-z]+:", target):
            continue
        file, _, anchor = target.partition("#")
        there = (path.parent / file).resolve() if file else path
        drawn = ROOT / "docs" / "_figures" / f"{there.stem}.py"  # by the build of the site
        assert there.is_file() or (there.parent.name == "_static" and drawn.is_file()), target
        assert not anchor or anchor in anchors(there), target


def test_readme_and_pages_have_at_most_40_000_words() -> None:
    assert sum(len(path.read_text(encoding="utf-8").split()) for path in PAGES) <= 40_000


def test_every_page_is_in_the_contents() -> None:
    for path in PAGES[1:]:
        name = path.relative_to(ROOT / "docs").as_posix()
        assert name == "index.md" or f"({name})" in page("index.md")


def test_every_package_is_described() -> None:
    described = {name.strip("`") for name, _ in rows(section(site_page("architecture.md"), "Layers"))[2:]}
    layers = [path for path in SOURCE.iterdir() if (path / "__init__.py").exists()]
    inside = {f"{layer.name}/{path.stem}" for layer in layers for path in layer.iterdir() if path.name[:1] not in "_."}
    assert {name for name in described if "/" in name} == {name for name in inside if not name.startswith("truck/")}
    assert {name for name in described if "/" not in name} == {layer.name for layer in layers}


def test_the_places_of_the_architecture_exist() -> None:
    paths = re.findall(r"`([a-z_0-9]+(?:/[a-z_0-9.]*|\.py)+)`", prose(page("architecture.md")))
    assert len(paths) > 20
    for path in paths:
        assert any(file.exists() for file in (SOURCE / path, SOURCE / f"{path}.py", ROOT / path)), path


def test_the_names_of_the_architecture_exist() -> None:
    """A function or class that a row of the table names stands in the place of that row."""
    for question, place in rows(section(page("architecture.md"), "Where is what"))[2:]:
        for name, path in re.findall(r"`(\w+)` in `([a-z_/0-9]+(?:\.py)?)`", place):
            files = [SOURCE / path] if path.endswith(".py") else (SOURCE / path).rglob("*.py")
            defined = rf"^(def {name}\(|class {name}\b|{name}\b.*=)"
            assert any(re.search(defined, file.read_text(encoding="utf-8"), re.MULTILINE) for file in files), question


ACCURACY = {
    "linear truck, one stage, all else known": "Linear truck, all else known, 1 lane change",
    "linear truck, recursive, all else known": "Linear truck, recursive, all else known, 1 lane change",
    "linear truck, one stage, sensor errors unknown": (
        "Linear truck, one stage, sensor errors estimated too, 1 lane change"
    ),
    "linear truck, two stages, sensor errors unknown": "Linear truck, two stages, 1 lane change",
    "linear truck, one stage, nothing exact": (
        "Linear truck, random vehicle parameters and sensor errors, 1 lane change"
    ),
    "linear truck, the article's preset, 12 lane changes": "Linear truck, the article's preset, 12 lane changes",
    "nonlinear truck, one stage, all else known": "Nonlinear truck, all else known, 1 lane change",
    "nonlinear truck, one stage, nothing exact, bank of 2°": (
        "Nonlinear truck, random vehicle parameters, steering gain (3 %), offsets and bank (2 degrees), 1 lane change"
    ),
    "nonlinear truck, two stages, sensor errors unknown": "Nonlinear truck, two stages, 1 lane change",
}
"""Rows of the page on accuracy, and the section of the benchmark that has their numbers."""
ACCURACY_COLUMNS = (
    *("tractor.front.cornering_stiffness", "tractor.drive.cornering_stiffness", "semitrailer.cornering_stiffness"),
    *("semitrailer.yaw_inertia", "semitrailer.payload.height", "semitrailer.cog_height"),
)


def test_the_page_on_accuracy_has_the_numbers_of_the_benchmark() -> None:
    """Rms errors and coverages with their standard errors, rms / sqrt(2 n) and sqrt(p (1 - p) / n), as rounded."""
    measured = (ROOT / "benchmarks" / "accuracy.md").read_text(encoding="utf-8")
    truck, checked = "", set()
    for label, seeds, *cells in (row for row in rows(page("accuracy.md")) if len(row) == 8):
        truck = label if seeds == "seeds" else truck
        if seeds.isdigit():
            checked.add(f"{truck}, {label}")
            text = section(measured, ACCURACY[f"{truck}, {label}"])
            assert f"\n{seeds} seeds." in text
            n, results = int(seeds), {row[0]: row for row in rows(text)}
            for cell, name in filter(all, zip(cells, ACCURACY_COLUMNS, strict=True)):
                rms, p = float(results[name][2]), float(results[name][7]) / 100
                expected = [rms, rms / (2 * n) ** 0.5, 100 * p, 100 * (p * (1 - p) / n) ** 0.5]
                for shown, number in zip(re.findall(r"[\d.]+", cell), expected, strict=False):
                    step = 10.0 ** -len(shown.partition(".")[2])
                    assert float(shown) == pytest.approx(number, abs=0.501 * step), (label, name)
    assert checked == set(ACCURACY)
