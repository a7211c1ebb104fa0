"""Every fault of a log in identification, observer and command line.

No fault may lead to a wrong result without a message: an error names the signal, or a note of the result names it, or
the result is right.
"""

import re
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from pyarrow import parquet

from fifthwheel.apps import cli
from fifthwheel.apps.cheng_cebon_2011 import TwoStage
from fifthwheel.base.errors import SignalError
from fifthwheel.data.checks import Fault
from fifthwheel.data.logs import write_record
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify import Identification, OneStage, identify
from fifthwheel.estimate.identify.unknowns.parameters import stage_1_names
from fifthwheel.estimate.observe import Observer, Status
from fifthwheel.estimate.time_bases import check_signals
from fifthwheel.model.simulate import simulate
from fifthwheel.results.report import conclude_identification
from fifthwheel.truck import get
from tests.estimate.observe.conftest import but_settling

TRUCK = get("cheng_cebon_2011")
TRUTH = TRUCK.parameters() | TRUCK.derived()
# the vehicle file of the user: every estimated parameter is wrong by 20 %
GUESS = TRUCK.replace(
    {n: TRUTH[n] * k for n, k in zip(stage_1_names(TRUCK), [0.8, 1.2, 0.8, 1.2], strict=True)}
    | {"semitrailer.payload.height": 1.0}
)
LINEAR = OneStage(tyres="linear")
"""Of most cases: the true tyres are linear, and an identification of tyres that saturate takes five times as long."""
BASE = simulate(TRUCK, count=2)
STEER, SPEED = "steer.tractor.front", "speed"
YAW, YAW2 = "yaw_rate.tractor", "yaw_rate.semitrailer"
ROLL, ROLL2 = "roll_rate.tractor", "roll_rate.semitrailer"
MEASURED = (YAW, YAW2, ROLL, ROLL2)
DEGREES = 180 / np.pi

Inject = Callable[[Record], Record]


def scaled(name: str, factor: float, offset: float = 0.0) -> Inject:
    return lambda record: record.with_signals({name: factor * record.signals[name] + offset})


def during(name: str, start: float, stop: float, value: float | None) -> Inject:
    """A signal replaced by a value from start to stop, s; by its value at start if the value is None."""

    def inject(record: Record) -> Record:
        values, inside = record.signals[name].copy(), (record.time >= start) & (record.time < stop)
        values[inside] = values[inside][0] if value is None else value
        return record.with_signals({name: values})

    return inject


def incomplete(name: str, fraction: float) -> Inject:
    def inject(record: Record) -> Record:
        lost = np.random.default_rng(1).random(len(record)) < fraction
        return record.with_signals({name: np.where(lost, np.nan, record.signals[name])})

    return inject


def spiked(name: str, size: float) -> Inject:
    def inject(record: Record) -> Record:
        values = record.signals[name].copy()
        values[[150, 380, 700, 900, 1200, 1450]] += size * np.array([1, -1, 1, 1, -1, 1])
        return record.with_signals({name: values})

    return inject


def noise(name: str, sigma: float) -> Inject:
    return lambda record: record.with_signals({name: np.random.default_rng(5).normal(0, sigma, len(record))})


def added(name: str, like: str) -> Inject:
    return lambda record: record.with_signals({name: record.signals[like]})


def late(delay: float, *names: str) -> Inject:
    def inject(record: Record) -> Record:
        return record.with_signals({n: np.interp(record.time - delay, record.time, record.signals[n]) for n in names})

    return inject


def fast(rate: float, *names: str) -> Inject:
    def inject(record: Record) -> Record:
        time = record.time / (1 + rate)
        return record.with_signals({n: np.interp(time, record.time, record.signals[n]) for n in names})

    return inject


def swapped(one: str, other: str) -> Inject:
    return lambda record: record.with_signals({one: record.signals[other], other: record.signals[one]})


@dataclass(frozen=True)
class Case:
    """A fault, its signal, and the expected reaction."""

    fault: Fault
    signal: str
    inject: Inject
    refused: bool
    variant: str = ""
    among: tuple[str, ...] = ()
    """Signals that may be named instead of the faulty one."""

    def __str__(self) -> str:
        return " ".join(filter(None, [self.fault.value, self.signal, self.variant]))


CASES = [
    *(Case(Fault.DROPOUT, n, during(n, 0, 99, np.nan), True, "all") for n in (SPEED, STEER, YAW2, ROLL2)),
    *(Case(Fault.DROPOUT, n, during(n, 9, 11, np.nan), False, "2 s") for n in (SPEED, STEER, YAW, ROLL2)),
    Case(Fault.DROPOUT, STEER, during(STEER, 9, 9.4, np.nan), False, "0.4 s"),
    *(Case(Fault.DROPOUT, n, incomplete(n, 0.3), False, "30 %") for n in (SPEED, YAW2)),
    *(Case(Fault.DROPOUT, n, incomplete(n, 0.6), True, "60 %") for n in (YAW, ROLL2)),
    *(
        Case(Fault.SPIKE, n, spiked(n, size), False)
        for n, size in ((SPEED, 10.0), (STEER, 0.3), (YAW, 0.6), (ROLL2, 1.0))
    ),
    *(Case(Fault.STUCK, n, during(n, 5, 99, None), True, "11 s") for n in (STEER, *MEASURED)),
    *(Case(Fault.STUCK, n, during(n, 9, 10.3, None), False, "1.3 s") for n in (STEER, YAW2)),
    Case(Fault.ZERO_SPEED, SPEED, scaled(SPEED, 0.0), True),
    Case(Fault.ZERO_SPEED, SPEED, scaled(SPEED, 0.1), True, "crawling"),
    Case(Fault.ZERO_SPEED, SPEED, during(SPEED, 11, 13, 0.0), False, "2 s"),
    Case(Fault.OUT_OF_RANGE, SPEED, scaled(SPEED, 1000.0), True),
    Case(Fault.OUT_OF_RANGE, ROLL2, scaled(ROLL2, 1e5), True),
    Case(Fault.UNIT, SPEED, scaled(SPEED, 3.6), True, "km/h"),
    *(Case(Fault.DEGREES, n, scaled(n, DEGREES), True) for n in (STEER, *MEASURED)),
    Case(Fault.STEERING_WHEEL, STEER, scaled(STEER, 18.0), True),
    Case(Fault.STEERING_WHEEL, STEER, scaled(STEER, 18.0 * DEGREES), True, "in degrees"),
    Case(Fault.GAIN, STEER, scaled(STEER, 3.0), False),
    *(Case(Fault.SWAPPED_SIGN, n, scaled(n, -1.0), True) for n in (SPEED, STEER, YAW, YAW2, ROLL, ROLL2)),
    Case(Fault.WRONG_COLUMN, STEER, noise(STEER, 0.015), True, "noise"),
    Case(Fault.WRONG_COLUMN, YAW, noise(YAW, 0.03), True, "noise"),
    Case(Fault.WRONG_COLUMN, YAW2, noise(YAW2, 0.03), False, "noise"),
    Case(Fault.WRONG_COLUMN, ROLL2, noise(ROLL2, 0.02), False, "noise"),
    Case(Fault.WRONG_COLUMN, STEER, swapped(STEER, ROLL), False, "with a noisy gyro", among=MEASURED),
    Case(Fault.WRONG_COLUMN, STEER, swapped(STEER, YAW), False, "with the yaw rate", among=MEASURED),
    Case(Fault.WRONG_COLUMN, YAW2, swapped(YAW, YAW2), True, "with the other yaw rate"),
    Case(Fault.EXCHANGED, YAW2, swapped(YAW, YAW2), True),
    Case(Fault.DUPLICATE, YAW2, added(YAW2, YAW), True),
    Case(Fault.TIME_OFFSET, YAW2, late(0.35, YAW2, ROLL2), False, "trailer logger", among=(ROLL2,)),
    Case(Fault.TIME_OFFSET, YAW, late(0.5, YAW), False),
    Case(Fault.CLOCK_RATE, YAW2, fast(0.04, YAW2, ROLL2), False, among=(ROLL2,)),
    Case(Fault.UNUSED, "pitch_rate.tractor", added("pitch_rate.tractor", ROLL2), False),
    Case(Fault.UNKNOWN_UNIT, "roll_rate.trailer", added("roll_rate.trailer", ROLL2), True),
    *(
        Case(Fault.OFFSET, n, scaled(n, 1.0, 0.04), False, among=(f"{n}.offset", YAW2, STEER))
        for n in (STEER, YAW, ROLL2)
    ),
]
IDENTIFIED = (
    "dropout speed 2 s",
    "spike steer.tractor.front",
    "wrong column yaw_rate.semitrailer noise",
    "wrong column steer.tractor.front with the yaw rate",
    "time offset yaw_rate.semitrailer trailer logger",
    "clock rate yaw_rate.semitrailer",
    "offset steer.tractor.front",
)
"""One accepted case of each fault that reaches the estimator in another way."""
COMMANDS = ("dropout speed all", "zero speed speed 2 s", "wrong column steer.tractor.front with the yaw rate")
"""Cases of the command line: a refused log, and those whose states are not all good."""


def chosen(*names: str) -> pytest.MarkDecorator:
    found = [case for case in CASES if str(case) in names]
    assert len(found) == len(names), names
    return pytest.mark.parametrize("case", found, ids=str)


def logged(case: Case) -> Record:
    """The log of a case; 2 s of it if no sample is right, because the observer restarts at each of them."""
    record = case.inject(BASE)
    return record.cut(0, 2) if case.fault in (Fault.DEGREES, Fault.STEERING_WHEEL, Fault.WRONG_COLUMN) else record


def require_finite(found: Identification) -> None:
    """All estimates, sigmas, histories and fits of an identification are finite."""
    estimates = [(e.name, e.value, e.sigma) for e in (*found.parameters, *found.derived)]
    estimates += [(e.name, e.value, e.sigma) for e in found.sensors]
    for name, value, sigma in estimates:
        assert np.isfinite(value), name
        assert np.isfinite(sigma), name
        assert sigma >= 0, name
    assert all(np.isfinite(t.values).all() and np.isfinite(t.sigma).all() for t in found.histories.values())
    assert all(np.isfinite([f.explained, f.rms]).all() for f in found.fits)


def wrong_parameters(found: Identification) -> list[str]:
    """Parameters called converged that are wrong by more than 5 sigma and 5 %."""
    return [
        f"{e.name}: {e.value:.4g} +- {e.sigma:.2g}, true value {TRUTH[e.name]:.4g}"
        for e in (*found.parameters, *found.derived)
        if e.verdict == "converged"
        and e.name in TRUTH
        and abs(e.value - TRUTH[e.name]) > 5 * e.sigma + 0.05 * abs(TRUTH[e.name])
    ]


def messages(found: Identification) -> str:
    """All that is said beside the numbers."""
    conclusion = conclude_identification(found)
    return "\n".join([*conclusion.cautions, *conclusion.consequences, *conclusion.notes])


def run(capsys: pytest.CaptureFixture[str], *arguments: str | Path) -> tuple[int, str, str]:
    """Exit code, output and errors of the command line."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["fifthwheel", *map(str, arguments)])
        try:
            cli.main()
            code = 0
        except SystemExit as stop:
            code = int(stop.code or 0)
    return code, *capsys.readouterr()


def test_every_fault_has_a_case():
    assert {case.fault for case in CASES} == set(Fault) - {Fault.MASS}  # of the vehicle file, not of a signal


@pytest.mark.slow
def test_without_a_fault():
    found = identify([BASE], GUESS)
    require_finite(found)
    assert not wrong_parameters(found)
    others = {e.name: e.verdict for e in found.parameters if e.verdict != "converged"}
    assert others == {"road.friction": "not_excited"}  # the tyres of the log are linear
    assert not [line for line in messages(found).splitlines() if any(n in line for n in (SPEED, *MEASURED))]
    assert (but_settling(Observer(TRUCK, BASE.signals).batch(BASE).status) == Status.OK).all()


@pytest.mark.slow
@chosen(*IDENTIFIED)
def test_identification(case):
    """A log that is not refused has a message that names the signal, or the result is right."""
    require_message(case, identify([case.inject(BASE)], GUESS, LINEAR))


@pytest.mark.slow
@chosen("gain steer.tractor.front")
def test_identification_of_tyres_that_saturate(case):
    require_message(case, identify([case.inject(BASE)], GUESS))


def require_message(case: Case, found: Identification) -> None:
    require_finite(found)
    named = [name for name in (case.signal, *case.among) if f"{name}" in messages(found)]
    if case.fault is Fault.OFFSET:  # the offset is estimated
        named += [e.name for e in found.sensors if e.name == f"{case.signal}.offset" and e.value > 5 * e.sigma]
    uncertain = [e.name for e in found.parameters if e.verdict != "converged"]
    assert named or uncertain, f"no message: {[str(e) for e in found.parameters]}"
    if case.fault is not Fault.WRONG_COLUMN and case.fault is not Fault.SWAPPED_SIGN:
        assert named
        assert not wrong_parameters(found)
    elif not named:
        assert not wrong_parameters(found)


@pytest.mark.slow
@chosen("swapped sign steer.tractor.front")
def test_identification_without_checks_gives_finite_numbers_or_an_error(case):
    try:
        found = identify([case.inject(BASE)], GUESS, TwoStage(check=False, passes=2, rounds=1))
    except SignalError as error:
        assert str(error).partition(":")[0].split(".")[0] in {n.split(".")[0] for n in BASE.signals}  # noqa: PT017
        return
    require_finite(found)


@pytest.mark.parametrize("case", CASES, ids=str)
def test_findings_name_the_signal_and_the_cure(case):
    findings = check_signals(case.inject(BASE), TRUCK)
    for finding in findings:
        assert finding.message.startswith(f"{finding.signal}: ")
        assert finding.severity == "warning" or "signals.toml" in finding.message.partition("; ")[2]
    errors = [finding.signal for finding in findings if finding.severity == "error"]
    assert (case.signal in errors) == bool(errors) == case.refused


@pytest.mark.slow
@chosen(*COMMANDS)
def test_command_line(case, tmp_path, capsys):
    """`states` refuses the logs with errors, with one line for each error, without a traceback."""
    log = tmp_path / "log.parquet"
    record = case.inject(BASE) if case.refused else logged(case)
    write_record(record, log)
    code, out, err = run(capsys, "states", log, "-v", "cheng_cebon_2011", "-o", tmp_path, "--json")
    assert "Traceback" not in err
    if any(finding.severity == "error" for finding in check_signals(record, TRUCK)):
        assert code == 2
        assert out == ""
        assert err.startswith("error: ")
        assert any(line.removeprefix("error: ").startswith(f"{case.signal}: ") for line in err.splitlines())
        assert sorted(path.name for path in tmp_path.iterdir()) == ["log.parquet"]
        return
    assert code == 0, err
    table = parquet.read_table(tmp_path / "states.parquet")
    good = ~np.isin(table["status"].to_numpy(), [Status.TOO_SLOW, Status.INPUT_MISSING])
    assert good.mean() > 0.85
    for name in set(table.column_names) - {"time", "log", "status"}:
        assert np.isfinite(table[name].to_numpy()[good]).all(), name


@pytest.mark.slow
@pytest.mark.parametrize("command", ["identify", "states"])
@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda text: text[: len(text) // 2] + text, r"error: log\.csv: "),
        (lambda text: text.replace("speed", "velocity", 1), r"error: speed: not (in log|among the signals)"),
        (lambda text: text.replace("yaw_rate.", "rate.").replace("roll_", "lean_"), r"error: yaw_rate\.tractor: "),
    ],
    ids=["twice", "no speed", "no yaw rates"],
)
def test_unusable_files_are_refused(damage, message, command, tmp_path, capsys):
    log = tmp_path / "log.csv"
    write_record(BASE, log)
    log.write_text(damage(log.read_text()))
    code, out, err = run(capsys, command, log, "-v", "cheng_cebon_2011", "-o", tmp_path / "out")
    assert (code, out) == (2, "")
    assert "Traceback" not in err
    assert sum(line.startswith("error: ") for line in err.splitlines()) == 1
    assert re.match(message, err), err


def test_several_faults_are_all_named():
    record = scaled(STEER, -1.0)(scaled(ROLL2, DEGREES)(BASE))
    with pytest.raises(SignalError) as error:
        identify([record], GUESS)
    assert {line.partition(":")[0] for line in str(error.value).splitlines()} == {STEER, ROLL2}


def test_a_faulty_log_beside_good_ones_is_refused():
    bad = replace(scaled(YAW, DEGREES)(BASE), name="bad")
    with pytest.raises(SignalError, match=rf"^{YAW}: "):
        identify([BASE, bad], GUESS)
    with pytest.raises(SignalError, match=rf"^{YAW}: "):
        identify([BASE], GUESS, validate=[bad])
