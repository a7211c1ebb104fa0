"""The command line: files, exit codes, and errors that fit one line."""

import importlib
import json
import re
import shlex
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import typer
from pyarrow import parquet

import fifthwheel
from fifthwheel.apps import cli
from fifthwheel.apps.cheng_cebon_2011 import article
from fifthwheel.apps.cli.vehicles import ask
from fifthwheel.apps.workflow.new_vehicle import QUESTIONS
from fifthwheel.base.errors import SignalError
from fifthwheel.data.logs import read_log, write_record
from fifthwheel.data.logs.readers import open_log
from fifthwheel.estimate.observe import Status
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import Vehicle, catalogue, get
from tests.apps.cli.conftest import ESTIMATED, FILES, LINEAR, TRUCK, refused
from tests.truck.test_classes import TEXT

COMMANDS = [command.callback.__name__.replace("_", "-") for command in cli.app.registered_commands]


@pytest.mark.slow
def test_files_and_json_of_an_identification(identified, folder):
    out, printed = identified
    assert sorted(path.name for path in out.iterdir()) == sorted([*FILES, "run.json"])
    assert printed["files"] == {name: str(out / name) for name in FILES}
    assert "# published: 8.0 m to the middle axle" in (out / "vehicle.toml").read_text()  # of the catalogue's file
    assert set(parquet.read_table(out / "states.parquet")["log"].to_pylist()) == {"first", "second", "flat"}
    page = (out / "report.html").read_text(encoding="utf-8")
    assert page.lstrip().lower().startswith("<!doctype html>")
    assert not re.search(r'<(script|link|img)[^>]+(src|href)="https?:', page)  # opens without a network
    text = (out / "identification.json").read_text()
    assert "NaN" not in text
    assert "Infinity" not in text
    found = json.loads(text)
    files = [Path(file["path"]).name for file in found.pop("provenance")["files"]]
    assert files == ["first.csv", "second.parquet", "flat.csv"]
    assert {**found, "files": printed["files"]} == printed
    assert found["version"] == fifthwheel.__version__
    assert (found["method"], found["preset"], found["vehicle"]) == ("one-stage", "default", TRUCK)
    assert [p["name"] for p in found["parameters"]] == ESTIMATED
    truth = get(TRUCK).parameters() | get(TRUCK).derived()
    for parameter in (*found["parameters"], *found["derived"]):
        assert {"name", "value", "sigma", "unit", "initial", "verdict"} <= parameter.keys()
        assert abs(parameter["value"] - truth[parameter["name"]]) < 5 * parameter["sigma"], parameter
        assert 0 < parameter["sigma"] < 0.25 * parameter["value"]
        assert parameter["verdict"] == "converged"
    assert [p["unit"] for p in found["parameters"]] == ["N/rad", "N/rad", "N/rad", "kg m^2", "m"]
    assert [(log["name"], log["span"]) for log in found["logs"]] == [("first", [0, 15.99]), ("second", [0, 15.99])]
    fits = {(f["log"], f["signal"]): f for f in found["fit"]}
    assert {log for log, _ in fits} == {"first", "second", "flat"}
    assert all(f["identified_on"] == (log != "flat") for (log, _), f in fits.items())
    assert fits["flat", "yaw_rate.semitrailer"]["explained"] > 0.9


@pytest.mark.slow
def test_the_next_command_takes_what_identify_wrote(identified, folder, run):
    out, _ = identified
    outcome = run("states", folder / "first.csv", "-v", out / "vehicle.toml", "-o", "o", "--json")
    assert (outcome.code, outcome.err) == (0, "")
    found = outcome.json()
    assert found["files"] == {name: str(Path("o") / name) for name in ("states.json", "states.parquet", "report.html")}
    verified = {Path(file["path"]).name: file["state"] for file in run("verify", "o", "--json").json()["files"]}
    files = ("report.html", "states.json", "states.parquet", "first.csv", "vehicle.toml")
    assert verified == dict.fromkeys(files, "same")
    (log,) = found["logs"]
    assert (log["name"], log["samples"]) == ("first", 1600)
    status = log["status"]
    assert status.pop("settling") == pytest.approx(10 / log["samples"])
    assert status.pop("ok") == pytest.approx(1 - 10 / log["samples"])
    assert set(status) == {"coasting", "too_slow", "input_missing", "inconsistent"}
    assert not any(status.values())
    assert "sideslip.semitrailer" in log["states"]


@pytest.mark.slow
def test_states_as_one_file_for_other_tools(folder, run):
    pytest.importorskip("asammdf")
    pytest.importorskip("mcap_ros2")
    for name in ("states.mf4", "states.mcap"):
        outcome = run("states", folder / "first.csv", "-v", TRUCK, "--out", name, "--json")
        assert (outcome.code, outcome.json()["files"]) == (0, {name: name})
        refused(run("states", folder / "first.csv", "-v", TRUCK, "--out", name), rf"{name}: exists")
    assert sorted(path.name for path in Path().iterdir() if not path.is_dir()) == ["states.mcap", "states.mf4"]
    with open_log("states.mf4") as log:
        assert log.columns["sideslip.semitrailer.sigma"].unit == "rad"
    with open_log("states.mcap") as log:
        assert "fifthwheel/velocity.twist.twist.linear.y" in log.columns
    several, one = (("states", *folder.glob(name), "-v", TRUCK, "-o") for name in ("*.csv", "first.csv"))
    refused(run(*several, "all.mcap"), r"all\.mcap: \d logs, whose times overlap")
    refused(run(*one, "x.mf4", "--figures", "svg"), "--figures: needs a folder")


@pytest.mark.slow
def test_fixed_parameters_keep_their_values_and_inform_of_the_next_log(folder, run):
    fixed, height = ["tractor.front.cornering_stiffness", "semitrailer.payload.height"], "semitrailer.payload.height"
    exact = [f"--set={name}=exact" for name in fixed]
    outcome = run("identify", folder / "first.csv", "-v", TRUCK, *LINEAR, "--json", *exact, "-o", "known")
    assert outcome.code == 0, outcome.err
    found = {p["name"]: p for p in outcome.json()["parameters"]}
    truth = get(TRUCK).parameters()
    for name in fixed:
        assert (found[name]["value"], found[name]["sigma"], found[name]["verdict"]) == (truth[name], None, "fixed")
        assert Vehicle.load("known/vehicle.toml").parameters()[name] == truth[name]
    assert found["semitrailer.cornering_stiffness"]["verdict"] == "converged"
    assert outcome.json()["settings"]["given"] == dict.fromkeys(fixed, "exact")
    sigmas, known = [], ("--knowledge", "known", "--load", "timber")
    for options in ((), known):
        outcome = run("check", folder / "second.parquet", "-v", TRUCK, *options, "--json")
        assert outcome.code == 0, outcome.err
        sigmas += [p["sigma"] for p in outcome.json()["parameters"] if p["name"] == height]
    assert sigmas[1] < 0.8 * sigmas[0]
    outcome = run("identify", folder / "first.csv", "-v", TRUCK, "--method", "article", *known)
    refused(outcome, "--knowledge: needs --method one-stage")


def test_the_articles_preset(folder, run, monkeypatch):
    chosen = []

    def identified(records, vehicle, settings, **_):
        chosen.append(settings)
        raise SignalError("stop")

    monkeypatch.setattr("fifthwheel.apps.workflow.runs.identify", identified)
    refused(run("identify", folder / "first.csv", "-v", TRUCK, "--method", "article"), "stop")
    assert chosen == [article()]


def test_states_of_logs_of_one_name_and_another_least_speed(folder, run):
    for place in ("one", "two"):
        Path(place).mkdir()
        write_record(read_log(folder / ("first.csv" if place == "one" else "flat.csv")), Path(place) / "run.csv")
    outcome = run("states", "one/run.csv", "two/run.csv", "-v", TRUCK, "--json", "--min-speed", "30")
    assert [log["name"] for log in outcome.json()["logs"]] == ["one/run.csv", "two/run.csv"]
    table = parquet.read_table("fifthwheel-states/states.parquet")
    assert (table["status"].to_numpy() == Status.TOO_SLOW).all()
    assert np.isnan(table["sideslip.tractor"].to_numpy()).all()


@pytest.mark.parametrize("name", ["log.csv", "log.parquet"])
def test_simulate(name, run):
    outcome = run("simulate", name, "--count", "1", "--seed", "5", "--json")
    assert (outcome.code, outcome.err) == (0, "")
    assert outcome.json()["file"] == name
    assert (outcome.json()["samples"], outcome.json()["span"]) == (800, [0, 7.99])
    record = read_log(name)
    assert record == simulate(get(TRUCK), count=1, seed=5)
    assert list(record.signals) == outcome.json()["signals"]
    assert list(record.reference) == outcome.json()["reference"]


def test_vehicle(run):
    listed = run("vehicle")
    assert listed.code == 0
    for name in catalogue.names():
        assert re.search(rf"^{name} +\S+", listed.out, re.MULTILINE)
        printed = run("vehicle", name)
        assert (printed.code, printed.err) == (0, "")
        assert printed.out == catalogue.text(name)
        Path("truck.toml").write_text(printed.out)
        assert Vehicle.load("truck.toml") == get(name)
        assert run("vehicle", name, "--json").json()["parameters"] == get(name).parameters()
    entries = run("vehicle", "--json").json()["vehicles"]
    assert {entry["name"]: entry["source"] for entry in entries} == {n: get(n).source for n in catalogue.names()}


@pytest.mark.slow
def test_show_a_vehicle(run):
    Path("truck.toml").write_text(TEXT)
    shown = run("vehicle", "show", "truck.toml", "--plot", "truck.svg", "--speed", "60")
    assert shown.code == 0, shown.err
    assert "at 60 km/h" in shown.out
    assert "semitrailer.roll_stiffness" in shown.out
    assert Path("truck.svg").read_text().startswith("<?xml")
    contents = run("vehicle", "show", "truck.toml", "--json").json()
    assert {number["path"] for number in contents["assumed"]} == set(Vehicle.load("truck.toml").assumed)
    assert contents["summary"]["axle_loads"] == Vehicle.load("truck.toml").axle_loads()
    refused(run("vehicle", "show", "truck.toml", "--plot", "truck.svg"), r"truck\.svg: .*--force")


NEW = ["--tractor", "tractor_4x2", "--trailer", "semitrailer_3", "--wheelbase", "3.7m", "--trailer-wheelbase", "7.7m"]


@pytest.mark.slow
def test_a_new_vehicle_by_options(run):
    made = run("vehicle", "new", *NEW, "--laden", "6850 10500 22500", "--solo", "5200 2000", "--accuracy", "0.5%")
    assert (made.code, made.out) == (0, "Written: truck.toml\n"), made.err
    vehicle = Vehicle.load("truck.toml")
    assert vehicle.unit("semitrailer").mass == pytest.approx(32650, rel=0.002)
    assert vehicle.stated["tractor.mass"] == pytest.approx(28, rel=0.02)
    assert "fifth_wheel.leading_position" not in vehicle.assumed
    assert run("vehicle", "show", "truck.toml").code == 0
    refused(run("vehicle", "new", *NEW, "--laden", "6850 10500 22500"), r"truck\.toml: .*--force")
    assert run("vehicle", "new", "--like", "a_double", "-o", "long.toml").code == 0
    assert len(Vehicle.load("long.toml").units) == 4
    refused(run("vehicle", "new", "--like", "a_double", "--load-mass", "3t", "-o", "c.toml"), "like: expected alone")
    refused(run("vehicle", "new", *NEW[2:], "-o", "b.toml"), r"tractor: expected a value, got none; give --tractor, or")
    assert not Path("b.toml").exists()


def test_exchanged_axle_loads_and_unusual_masses_are_named(run):
    Path("exchanged.toml").write_text(vehicle_file_with('cog = "-1.03 m"', 'cog = "-2.67 m"'))
    made = run("vehicle", "new", *NEW, "--laden", "6850 10500 22500", "--solo", "5200 2000", "--load-mass", "20 t")
    heavy = "warning: semitrailer: the empty semitrailer weighs 12.7 t by "
    for outcome, warning in (
        (run("vehicle", "show", "exchanged.toml"), "warning: tractor.cog: front and drive axle loads seem exchanged: "),
        (made, heavy),
        (run("vehicle", "show", "truck.toml"), heavy),
    ):
        assert outcome.code == 0
        assert outcome.err.startswith(warning)


def test_questions_are_asked_until_they_are_answered(monkeypatch, capsys):
    answers = iter(["lorry", "tractor_4x2", "", "semitrailer_3", "", "3.7 t", "3.7 m"])  # "" refused, "" skipped
    monkeypatch.setattr(typer, "prompt", lambda *_, **__: next(answers))
    keys = ("tractor", "trailer", "tractor_spread", "fifth_wheel", "wheelbase", "load_height")
    asked = {"load_mass": "0"}
    ask([next(q for q in QUESTIONS if q.key == key) for key in keys], asked)
    chosen = {"tractor": "tractor_4x2", "trailer": "semitrailer_3", "wheelbase": "3.7 m"}
    assert asked == {**chosen, "load_mass": "0"}  # a 4x2 has no spread, no load no height
    errors = capsys.readouterr().err.splitlines()
    assert [line.partition(":")[0] for line in errors] == ["tractor", "trailer", "wheelbase"]


@pytest.mark.parametrize("end", [EOFError, KeyboardInterrupt])
def test_ending_the_questions_keeps_the_answers(run, monkeypatch, end):
    """Ctrl-D and Ctrl-C print the command that asks for the rest; an error in the numbers prints it, too."""
    typed: list[object] = []

    def prompt(text, **_):
        answer = typed.pop(0)
        if isinstance(answer, type):
            raise typer.Abort from answer()
        return answer

    monkeypatch.setattr(typer, "prompt", prompt)
    typed += ["semitrailer_3", "3.7 m", end]
    outcome = run("vehicle", "new", "--ask", "--tractor", "tractor_4x2")
    assert outcome.code == 130
    assert not Path("truck.toml").exists()
    command = outcome.err.splitlines()[-1]
    expected = "fifthwheel vehicle new --ask --tractor tractor_4x2 --trailer semitrailer_3 --wheelbase '3.7 m'"
    assert command == expected
    typed += ["", "", "8 m", "", "6900 11200 21500", "5200 1990", "", "", "20 t +- 1 t", *[""] * 5]
    outcome = run(*shlex.split(command)[1:])
    assert outcome.code == 0, outcome.err
    assert Vehicle.load("truck.toml").stated["semitrailer.payload.mass"] == 1000
    typed += ["", "", "8 m", "", "11200 6900 21500", "5200 1990", *[""] * 8]
    outcome = run(*shlex.split(command)[1:], "--force")
    assert outcome.code == 2
    assert "--laden '11200 6900 21500' --solo '5200 1990'\nerror: laden: front and drive axle loads seem" in outcome.err


def vehicle_file_with(old: str, new: str) -> str:
    text = catalogue.text(TRUCK)
    assert old in text
    return text.replace(old, new, 1)


BAD_MAPS = (
    ("[signals\n", r"map\.toml: not TOML"),
    ('[signals]\nspeeed = "speed"\n', r"map\.toml: .*speeed: .*did you mean 'speed'"),
    ('[signals]\nspeed = {column = "speed", unt = "m/s"}\n', r"map\.toml: signals\.speed\.unt: unknown"),
    ('[signals]\nspeed = "velocity"\n', r"first\.csv: .*velocity"),
    ('[signals]\nspeed = {column = "speed", unit = "knot/h"}\n', r".*speed: .*knot"),
    ('[signals]\nspeed = {column = "speed", sign = 2}\n', r"map\.toml: signals\.speed\.sign: "),
)
BAD_VEHICLES = (
    ("yaw_inertia =", "yaw_intertia =", r"truck\.toml: tractor\.yaw_intertia: no such key; did you mean"),
    ("mass =", 'colour = "red"\nmass =', r"truck\.toml: tractor\.colour: no such key"),
    ('[[unit]]\nname = "tractor"', '[[unit]]\nname = ""', r"truck\.toml: "),
    ("steerable = true", "steerable = maybe", r"truck\.toml: expected TOML"),
    ("steerable = true", "steerable = false", r"steer\.|truck\.toml: "),
)


@pytest.mark.parametrize("command", ["identify", "states"])
def test_files_that_are_refused(command, folder, run):
    good, truck = folder / "first.csv", ("-v", TRUCK)
    Path("binary.csv").write_bytes(bytes(range(256)) * 20)
    Path("text.csv").write_text("never,a\nlog,of\nthis,truck\n")
    Path("file").write_text("")
    for arguments, start in (
        (("nothing.csv", *truck), r"nothing\.csv: cannot be read"),
        ((good, "nothing.csv", *truck), r"nothing\.csv: cannot be read"),
        ((".", *truck), r"\.: cannot be read"),
        (("binary.csv", *truck), r"binary\.csv: "),
        (("text.csv", *truck), r"text\.csv: "),
        ((good, "-v", "lorry"), r"lorry: no such file, and not in the catalogue, which has "),
        ((good, "-v", "."), r"\.: (no such file|a folder without (identification.json|vehicle.toml))"),
        ((good, *truck, "-s", "nothing.toml"), r"nothing\.toml: cannot be read"),
        ((good, "-v", good), r".*first\.csv: "),
        ((good, *truck, "-o", "file"), r"file: expected a folder, got a file; choose another name"),
    ):
        refused(run(command, *arguments), start)
    if command == "identify":
        for text, start in BAD_MAPS:
            Path("map.toml").write_text(text)
            refused(run(command, good, *truck, "-s", "map.toml"), start)
        for old, new, start in BAD_VEHICLES:
            Path("truck.toml").write_text(vehicle_file_with(old, new))
            refused(run(command, good, "-v", "truck.toml"), start)
    assert not [path for path in Path().iterdir() if path.is_dir()]


def test_a_log_that_is_not_checked(folder, run):
    record = read_log(folder / "first.csv")
    write_record(record.with_signals({"yaw_rate.tractor": -record.signals["yaw_rate.tractor"]}), "log.csv")
    refused(run("states", "log.csv", "-v", TRUCK), r"yaw_rate\.tractor: the sign contradicts")
    outcome = run("states", "log.csv", "-v", TRUCK, "--no-check", "--json")
    assert outcome.code == 0, outcome.err


IDENTIFY, STATES = ("identify", "log.csv", "-v", TRUCK), ("states", "log.csv", "-v", TRUCK)
TWO_STAGE, ARTICLE = ("--method", "two-stage"), ("--method", "article")
USAGE = (
    ([*IDENTIFY, "--frobnicate"], ".*--frobnicate"),
    (["frobnicate"], ".*frobnicate"),
    (["nonsense"], ".* See fifthwheel --help"),
    (["design"], ".* See fifthwheel design --help"),
    (["export", "c"], ".* See fifthwheel export c --help"),
    (["identify", "-v", TRUCK], "(?i).*logs"),
    (["states", "log.csv"], ".*--vehicle"),
    (["states", "run.csv", "--unknown"], ".* See fifthwheel states --help"),
    ([*IDENTIFY, "--method", "ours"], ".*--method"),
    ([*IDENTIFY, *TWO_STAGE, "--passes", "0"], ".*--passes"),
    ([*IDENTIFY, "--passes", "3"], "--passes: needs --method two-stage"),
    ([*IDENTIFY, *ARTICLE, "--form", "prediction-error"], "--form: needs --method one-stage"),
    ([*IDENTIFY, "--set", "steer_lag=+- 5 ms"], "steer_lag: no such parameter"),
    ([*IDENTIFY, "--set", "tractor.mas=exact"], r"tractor\.mas: no such parameter"),
    ([*IDENTIFY, "--set", "steer.*.delay=+- 5 deg"], r"steer\.\*\.delay=.*s"),
    ([*IDENTIFY, "--set", "sensors=+- 5 %"], "sensors=.*: expected 'exact' for so many"),
    ([*IDENTIFY, "--set", "exact"], "exact: expected NAME="),
    ([*IDENTIFY, "--friction", "0.3"], r"No such option: --friction\. If it is .*, state it by --set friction=VALUE"),
    ([*IDENTIFY, "-m", "map.toml"], "No such option: -m See fifthwheel identify --help"),
    (["evaluate", "run.csv", "--frict", "0.3"], r"No such option: --frict [^.]*See fifthwheel evaluate --help"),
    ([*STATES, "--at", "sideslip.semitrailer=rear"], "--at sideslip.semitrailer=rear: expected SIGNAL=X"),
    ([*STATES, "--figures", "gif"], ".*--figures"),
    (["simulate", "log.csv", "--count", "many"], ".*--count"),
    (["simulate", "log.csv", "--rate", "1"], ".*--rate"),
    (["simulate", "log.csv", "--speed", "300"], r"speed: expected 5 to 40 m/s .*, got 83\.33 m/s"),
    (["simulate", "log.csv", "--manoeuvre", "slalom"], "manoeuvre: 'slalom' is not known"),
    (["simulate", "log.csv", "--model", "longitudinal", "--speed", "80"], "--speed: not available in the longitudinal"),
    (["simulate", "log.txt"], r"log\.txt: no format for '\.txt'"),
    (["simulate", "nowhere/log.csv"], r"nowhere/log\.csv: No such file"),
    (["simulate", "log.csv", "-v", "lorry"], "lorry: no such file"),
    (["vehicle", "lorry"], "lorry: no such vehicle in the catalogue"),
)


def test_usage(run):
    """Each is refused for its own reason, before the log is read."""
    for arguments, message in USAGE:
        refused(run(*arguments), message)
    assert list(Path().iterdir()) == []


def examples():
    """Each example of each help, as the words behind `fifthwheel`; without that of a folder that must exist."""
    groups = [cli.app, *(group.typer_instance for group in cli.app.registered_groups)]
    for command in (command for group in groups for command in group.registered_commands):
        for part in re.split(r"\n|&&", command.epilog or ""):
            if part.strip().startswith("fifthwheel") and "/var/lib" not in part:
                yield shlex.split(part.partition(" >")[0])[1:]


@pytest.mark.parametrize("words", [*examples()], ids=" ".join)
def test_every_example_parses(words):
    command = typer.main.get_command(cli.app)
    context = command.make_context("fifthwheel", words)
    while hasattr(command, "resolve_command") and (rest := [*context._protected_args, *context.args]):
        name, command, rest = command.resolve_command(context, rest)
        context = command.make_context(name, rest, parent=context)


def test_help_imports_nothing_slow():
    """Neither NumPy nor anything that needs it, so that help appears at once."""
    code = (
        "import contextlib, sys; from fifthwheel.apps import cli\n"
        "for command in ['--help', *sys.argv[1:]]:\n"
        "    sys.argv = ['fifthwheel', command, '--help']\n"
        "    with contextlib.suppress(SystemExit): cli.main()\n"
        "print(*sys.modules, file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code, *COMMANDS], capture_output=True, text=True, check=True)
    assert done.stdout.count("Examples") == len(COMMANDS)
    for command in COMMANDS:
        assert done.stdout.count(f"fifthwheel {command}") >= 3  # its usage and two examples
    assert not {"numpy", "pyarrow", "casadi", "scipy"} & set(done.stderr.split())


def fifthwheel_process(*arguments: str | Path, cwd: Path) -> subprocess.CompletedProcess[str]:
    """It leaves the names of all imported modules in a file."""
    code = (
        "import sys; from fifthwheel.apps.cli import main\n"
        "try: main()\nfinally: print(*sys.modules, file=open('modules', 'w'))"
    )
    command = [sys.executable, "-c", code, *map(str, arguments)]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=60, check=False)


@pytest.mark.slow
def test_as_a_process(folder, tmp_path):
    version = fifthwheel_process("--version", cwd=tmp_path)
    assert (version.returncode, version.stdout, version.stderr) == (0, f"fifthwheel {fifthwheel.__version__}\n", "")
    done = fifthwheel_process("identify", folder / "first.csv", "-v", TRUCK, "--json", *LINEAR, cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert [p["name"] for p in json.loads(done.stdout)["parameters"]] == ESTIMATED
    assert (tmp_path / "fifthwheel-out" / "report.html").exists()
    modules = set((tmp_path / "modules").read_text().split())
    assert "fifthwheel.apps.cli" in modules
    assert not {"scipy", "pandas"} & modules  # both take longer to import than a short log takes to process
    missing = fifthwheel_process("states", "nothing.csv", "-v", TRUCK, cwd=tmp_path)
    assert (missing.returncode, missing.stdout) == (2, "")
    assert missing.stderr == "error: nothing.csv: cannot be read (No such file or directory); check the path\n"


@pytest.mark.slow
def test_simulates_the_nonlinear_truck(run, tmp_path):
    """The log has the requested sensors, with the truth as reference; each wrong call is refused by name."""
    sensors = tmp_path / "sensors.toml"
    sensors.write_text('[speed]\n["steer.tractor.front"]\n["yaw_rate.tractor"]\nnoise = "0.2 deg/s"\n')
    outcome = run(
        "simulate", "a.csv", "--model", "nonlinear", "--count", 1, "--sensors", sensors, "--with", "bank=1 deg",
        "--braking", 3, "--json",
    )  # fmt: skip
    assert outcome.code == 0
    assert read_log(tmp_path / "a.csv").signals["speed"].min() < 7
    assert set(outcome.json()["signals"]) == {"speed", "steer.tractor.front", "yaw_rate.tractor"}
    assert "sideslip.semitrailer.landing_leg" in outcome.json()["reference"]
    for arguments, message in (
        (["--braking", 3], "--braking: not available in the linear model"),
        (["--model", "nonlinear", "--with", "bnk=1"], "did you mean 'bank'"),
        (["--model", "nonlinear", "--with", "bank"], "PROPERTY=VALUE"),
        (["--model", "nonlinear", "--manoeuvre", "loop"], "loop"),
        (["--model", "nonlinear", "--yaw-only"], "--yaw-only"),
        (["--model", "nonlinear", "--rate", "60"], "rate"),
    ):
        wrong = run("simulate", "b.csv", *arguments)
        assert wrong.code == 2
        assert message in wrong.err
    assert not (tmp_path / "b.csv").exists()


@pytest.mark.slow
def test_reproduces_the_article_in_short(run, tmp_path, monkeypatch):
    """With one lane change and the settings of the article: numbers are not looked at."""
    program = importlib.import_module("fifthwheel.apps.cheng_cebon_2011.reproduce")
    monkeypatch.setattr(program, "QUICK", replace(program.QUICK, repetitions=1))
    outcome = run("reproduce", "--quick", "--seeds", "1", "--arms", "article", "--out", "r", "--json")
    assert outcome.code == 0
    names = {path.name for path in (tmp_path / "r").iterdir()}
    assert {"reproduction.html"} | {f"figure_{n}.svg" for n in range(4, 10)} <= names
    assert len(outcome.json()["rows"]) > 20
