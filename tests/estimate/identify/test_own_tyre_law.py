"""Identification, states, saved results and learner with a tyre law of a user's own module."""

import pickle
import sys
from dataclasses import replace
from pathlib import Path

import casadi as ca
import pytest

from fifthwheel.base.errors import SignalError
from fifthwheel.data.record import Record
from fifthwheel.estimate.identify import Identification, OneStage, identify
from fifthwheel.estimate.identify.verdict import Verdict
from fifthwheel.estimate.online import Learner
from fifthwheel.results.report import write_report
from fifthwheel.truck import Vehicle, get
from fifthwheel.truck.quantities import FRICTION, SHAPE, TYRES

sys.path.insert(0, str(Path(__file__).resolve().parents[3] / "examples"))
from tyre_laws import magic_formula, simulated

pytestmark = pytest.mark.slow

TRUCK = get("cheng_cebon_2011")
STIFFNESSES = [name for name in TRUCK.parameters() if name.endswith("cornering_stiffness")]
KNOWN = {"others": "exact", "sensors": "exact"}
EXACT = OneStage(tyres=magic_formula, given={**KNOWN, "road.friction": 0.5}, check=False)
"""Everything but the estimated parameters and the noise is known."""


def same_law(slip, load, stiffness, friction):
    """The built-in law in other words."""
    limit = friction * load
    return limit * ca.sin(ca.atan(stiffness * slip / limit))


@pytest.fixture(scope="module")
def record() -> Record:
    return simulated(TRUCK, 0.4)


@pytest.fixture(scope="module")
def guess() -> Vehicle:
    return TRUCK.replace({name: 0.85 * TRUCK.parameters()[name] for name in STIFFNESSES})


@pytest.fixture(scope="module")
def own(record: Record, guess: Vehicle) -> Identification:
    return identify([record], guess, EXACT)


@pytest.fixture(scope="module")
def built_in(record: Record, guess: Vehicle) -> Identification:
    return identify([record], guess, replace(EXACT, tyres="saturating"))


def test_the_law_of_the_truck_gives_its_parameters(own: Identification, built_in: Identification) -> None:
    """Errors are those of the noise; the other law explains less."""
    for name, true in {**{n: TRUCK.parameters()[n] for n in STIFFNESSES}, FRICTION: 0.4}.items():
        assert abs(own[name].value - true) < 3.5 * own[name].sigma < 0.01 * true
    assert own.log_likelihood > built_in.log_likelihood + 100


@pytest.fixture
def without_shape(monkeypatch: pytest.MonkeyPatch) -> None:
    """The built-in law tends to the peak friction, as an own law does, whose friction is that of its peak."""
    monkeypatch.setitem(TYRES, SHAPE, TYRES[SHAPE]._replace(default=1.0))


@pytest.mark.usefixtures("without_shape")
def test_the_built_in_law_in_other_words_gives_the_same(record: Record, guess: Vehicle) -> None:
    """The search begins at the prior, because this is enough friction for the log."""
    settings = replace(EXACT, given={**KNOWN, "road.friction": 1.0})
    built_in, own = (identify([record], guess, replace(settings, tyres=tyres)) for tyres in ("saturating", same_law))
    assert SHAPE not in own.vehicle.parameters()
    for e in built_in.parameters:
        assert own[e.name].value == pytest.approx(e.value, rel=1e-7)
        assert own[e.name].sigma == pytest.approx(e.sigma, rel=1e-6)
    assert own.log_likelihood == pytest.approx(built_in.log_likelihood, rel=1e-9)


def test_states_and_files_have_the_law_of_the_identification(
    own: Identification, record: Record, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert own.observer_settings().tyres is magic_formula
    assert own.observer(log=record.name).settings.tyres is magic_formula
    with pytest.raises(SignalError, match="tyres: expected the friction of the road, got none"):
        own.observer_settings(friction=None)
    assert pickle.loads(pickle.dumps(own)).settings == own.settings
    own.save(tmp_path)
    loaded = Identification.load(tmp_path)
    assert loaded.settings.tyres is magic_formula
    assert loaded.vehicle == own.vehicle
    write_report(tmp_path / "report.html", loaded, [record], title="own law")
    assert "tyre_laws:magic_formula" in (tmp_path / "report.html").read_text()
    monkeypatch.delitem(sys.modules, "tyre_laws")
    with pytest.raises(SignalError, match=r"identification.json: tyres: expected the function tyre_laws:magic_formula"):
        Identification.load(tmp_path)


def test_a_learner_learns_and_is_loaded_with_the_law(
    record: Record, guess: Vehicle, own: Identification, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    learner = Learner(guess, record.signals, EXACT)
    learner.learn(record)
    assert {e.verdict for e in learner.parameters} == {Verdict.CONVERGED}
    assert learner[FRICTION].value == pytest.approx(own[FRICTION].value, rel=0.05)
    name = "tractor.drive.cornering_stiffness"
    assert learner[name].value == pytest.approx(own[name].value, rel=0.05)
    learner.save(tmp_path / "learner.json")
    loaded = Learner.load(tmp_path / "learner.json")
    assert loaded[name].value == learner[name].value
    monkeypatch.delitem(sys.modules, "tyre_laws")
    with pytest.raises(SignalError, match=r"learner.json: tyres: expected the function tyre_laws:magic_formula"):
        Learner.load(tmp_path / "learner.json")
