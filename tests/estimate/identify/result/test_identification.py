"""An identification as text, table, plots and files, and what it passes on to an observer and to JSON."""

import json
import math
import pickle
import sys
from dataclasses import replace
from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from fifthwheel.base.errors import FifthwheelError, SignalError
from fifthwheel.base.formatting import shown
from fifthwheel.data.channels import STEER as STEER_ANGLE
from fifthwheel.estimate.identify import Identification, OneStage
from fifthwheel.estimate.identify.doubts import Cause, Doubt, DoubtKind
from fifthwheel.estimate.identify.result import display
from fifthwheel.estimate.identify.result.storage import _finite
from fifthwheel.truck.quantities import BANK_VARIATION, quantity_of
from tests.estimate.identify.result.conftest import RUN, TRUCK

SERIES = ("fits", "residuals", "histories")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["result", "published"])
def test_a_saved_identification_is_loaded_exactly(name, request, tmp_path):
    saved = request.getfixturevalue(name)
    saved.save(tmp_path / "out")
    files = {"identification.json", "vehicle.toml", "series.npz", *(["knowledge.json"] if saved.knowledge else [])}
    assert {path.name for path in (tmp_path / "out").iterdir()} == files
    loaded = Identification.load(tmp_path / "out")
    assert loaded == saved == pickle.loads(pickle.dumps(saved))
    assert type(loaded.settings) is type(saved.settings)
    assert loaded.to_json() == saved.to_json()
    assert Identification.load(tmp_path / "out" / "identification.json").parameters == saved.parameters
    loaded.save(tmp_path / "again")
    assert Identification.load(tmp_path / "again") == saved
    for history in saved.histories.values():  # its band ends with the sigma of the result
        for estimate in filter(lambda e: e.name in history.names, saved.parameters):
            sigma = history.sigma[:, history.names.index(estimate.name)]
            band, factor = display.history_panel(history, estimate).items[0], shown(estimate.unit).factor
            half = (np.asarray(band.upper) - np.asarray(band.lower)) / 2 / factor
            assert half[-1] == pytest.approx(estimate.sigma)
            assert (half >= sigma * (1 - 1e-9)).all() == (estimate.sigma >= sigma[-1] * (1 - 1e-9))


@pytest.mark.slow
def test_a_result_is_a_collection_of_named_estimates(result):
    names = list(result)
    assert {e.name for e in (*result.parameters, *result.derived, *result.uncertain)} == set(names)
    assert names[0] in result
    assert "tractor.colour" not in result
    assert result._ipython_key_completions_() == names
    with pytest.raises(KeyError, match="0: not estimated"):
        result[0]


def test_results_that_differ_in_one_number_are_not_equal(result, tmp_path):
    fit, knowledge = result.fits[0], result.knowledge
    changed = fit.predicted.copy()
    changed[5] = np.nextafter(changed[5], 1.0)
    assert replace(fit, predicted=fit.predicted.copy()) == fit != replace(fit, predicted=changed)
    assert replace(result, fits=(replace(fit, predicted=changed), *result.fits[1:])) != result
    assert replace(knowledge, logs=()) != knowledge
    replace(result, fits=(replace(fit, explained=float("nan")),)).save(tmp_path)
    assert np.isnan(Identification.load(tmp_path).fits[0].explained)


@pytest.mark.slow
def test_a_result_never_replaces_a_foreign_file(result, tmp_path):
    (tmp_path / "vehicle.toml").write_text("mine")
    with pytest.raises(FifthwheelError, match=r"vehicle\.toml: not of an earlier result; choose another folder"):
        result.save(tmp_path)
    assert (tmp_path / "vehicle.toml").read_text() == "mine"
    result.save(tmp_path / "new")
    result.save(tmp_path / "new")


@pytest.mark.slow
def test_missing_and_damaged_files(result, tmp_path):
    result.save(tmp_path)
    (tmp_path / "series.npz").write_bytes(b"PK damaged")
    with pytest.raises(SignalError, match=r"series\.npz: damaged"):
        Identification.load(tmp_path)
    (tmp_path / "series.npz").unlink()
    loaded = Identification.load(tmp_path)
    assert loaded.parameters == result.parameters
    assert loaded.plot().panels
    for series in (*(lambda kind=kind: loaded.plot(kind) for kind in SERIES), loaded.residuals):
        with pytest.raises(FifthwheelError, match="identify again"):
            series()
    path = tmp_path / "identification.json"
    contents = json.loads(path.read_text())
    damaged = [{k: v for k, v in contents.items() if k != key} for key in contents.keys() - {"preset", "vehicle"}]
    for content in (*damaged, contents | {"vehicle_file": {"name": "x", "units": []}}):
        path.write_text(json.dumps(content))
        with pytest.raises(SignalError, match=r"identification\.json") as refused:
            Identification.load(tmp_path)
        assert "vehicle_file" in content or "of this version ('vehicle_file')" in str(refused.value)


@pytest.mark.slow
def test_an_observer_of_the_result(result):
    observer = result.observer()
    assert set(observer.inputs) | set(observer.outputs) == set(RUN.signals)
    assert observer.settings == result.observer_settings()
    first = observer.batch(RUN).values["sideslip.semitrailer"]
    again = pickle.loads(pickle.dumps(result)).observer().batch(RUN).values["sideslip.semitrailer"]
    np.testing.assert_array_equal(first, again)
    few = result.observer(["speed", "steer.tractor.front", "yaw_rate.tractor"], log="run", min_speed=7.0)
    assert few.outputs == ("yaw_rate.tractor",)
    assert few.settings.min_speed == 7.0
    own, other = result.uncertainty("run"), result.uncertainty("another")  # whose sensor errors have their priors
    assert set(own.names) == set(other.names)
    i = other.names.index(f"{STEER}.offset")
    assert other.covariance[i, i] ** 0.5 == pytest.approx(STEER_ANGLE.error("offset").prior)
    assert np.count_nonzero(other.covariance[i]) == 1


@pytest.mark.slow
def test_the_text_is_short_and_the_summary_complete(result):
    assert len(repr(result)) < 200
    assert "parameters converged, from run" in repr(result)
    lines = result.summary().splitlines()
    for estimate in (*result.parameters, *result.derived):
        (line,) = [line for line in lines if line.startswith(f"{estimate.name} ")]
        derived = ", derived" if estimate in result.derived else ""
        assert line.endswith(f"{estimate.verdict.replace('_', ' ')}{derived}")
    assert any(line.startswith("<other> (validation)  yaw_rate.tractor") for line in lines)
    assert "kN/rad" in result.summary()
    cause = Cause(name="semitrailer.mass", changes={}, prior_sigmas=5.24)
    doubt = Doubt(kind=DoubtKind.ASSUMPTION, causes=(cause,), parameters=("semitrailer.yaw_inertia",), statistic=5.0)
    words = " ".join(replace(result, doubts=(doubt,)).summary().split())
    assert "contradicted assumption: semitrailer.mass (+5.2 prior sigma); doubtful: semitrailer.yaw_inertia" in words
    assert "contradicted" not in replace(result, doubts=()).summary()


@pytest.mark.slow
def test_the_tables_of_a_notebook(result, monkeypatch):
    page, estimate = result._repr_html_(), result["tractor.front.cornering_stiffness"]
    rows = [["".join(cell.itertext()) for cell in row] for row in ElementTree.fromstring(page).iter("tr")]
    front = next(row for row in rows if row[0] == estimate.name)
    assert " ± " in front[1]
    assert front[3] == estimate.verdict.replace("_", " ")
    assert "&lt;other&gt;" in page
    frame = result.to_pandas()
    expected = {name: getattr(estimate, name) for name in ("value", "sigma", "unit", "initial", "prior")}
    assert frame.loc[estimate.name].to_dict() == expected | {"verdict": str(estimate.verdict)}
    assert list(frame.index) == [e.name for e in (*result.parameters, *result.derived)]
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(FifthwheelError, match=r"fifthwheel\[pandas\]"):
        result.to_pandas()


@pytest.mark.slow
def test_residuals(result, published, tmp_path):
    frame, whitened = result.residuals(), result.residuals(whitened=True)
    assert frame.index.names == ["log", "time"]
    for fit in result.fits:
        of_log = frame.loc[fit.log, fit.signal]
        np.testing.assert_array_equal(of_log.index, fit.time)
        np.testing.assert_array_equal(of_log, fit.measured - fit.predicted)
    assert set(whitened.index.get_level_values("log")) == {"run"}
    for name, raw in frame.loc["run"].items():
        white = whitened.loc["run", name]
        np.testing.assert_array_equal(white.index, raw.index)
        assert abs(np.corrcoef(white[1:], white[:-1])[0, 1]) < 4 / np.sqrt(len(white))
        assert white.std() == pytest.approx(1, abs=4 / np.sqrt(2 * len(white)))
        assert np.corrcoef(white, raw)[0, 1] > 0.9  # the log has white noise, so the filter leaves most of it
    with pytest.raises(FifthwheelError, match=r"whitened: this identification .*identify with OneStage\(\)"):
        published.residuals(whitened=True)
    result.save(tmp_path)
    assert Identification.load(tmp_path).residuals(whitened=True).equals(whitened)


@pytest.mark.slow
def test_the_plots(result, published):
    (panel,) = result.plot().panels
    guess, estimates = panel.items
    row = list(panel.y.ticks.values()).index("tractor.front.cornering_stiffness")
    front = result["tractor.front.cornering_stiffness"]
    assert guess.x[row] == pytest.approx(4.0e5 / front.value)
    assert estimates.x[row] == 1.0
    assert estimates.x_sigma[row] == pytest.approx(front.sigma / front.value)
    assert "kN/rad" in estimates.texts[row]
    fits = result.plot("fits", log="<other>").panels
    titles = [f"{f.signal}, <other> (validation)" for f in result.fits if f.log != "run"]
    assert [panel.title for panel in fits] == titles
    measured, predicted = fits[0].items
    (residual,) = result.plot("residuals", log="<other>").panels[0].items[1:]
    np.testing.assert_allclose(residual.y, measured.y - predicted.y)
    assert len(result.plot("histories").panels) == len(result.histories["one stage"].names)
    for plot in (result.plot(), result.plot("fits"), result.plot("residuals"), published.plot("histories")):
        plot.to_plotly()
        plot.to_matplotlib()
    with pytest.raises(SignalError, match=r"history: no such plot; available: parameters, fits, residuals, histories"):
        result.plot("history")
    with pytest.raises(SignalError, match="nowhere: not a log"):
        result.plot("fits", log="nowhere")


# Sensor errors and noise for an observer

STEER, YAW, LATERAL = "steer.tractor.front", "yaw_rate.tractor", "lateral_acceleration.tractor"


def error(name: str, value: float, log: str | None) -> SimpleNamespace:
    return SimpleNamespace(name=name, value=value, log=log, sigma=0.003)


class Fields(SimpleNamespace):
    """Some fields of an identification, with what an observer gets from them."""

    friction = Identification.friction
    sensor_settings = Identification.sensor_settings
    prior_of_sensor_error = Identification.prior_of_sensor_error
    _uncertainties = Identification._uncertainties


IDENTIFICATION: Any = Fields(
    sensors=[
        error(f"{STEER}.gain", 1.1, None),
        error(f"{YAW}.offset", 0.001, "first"),
        error(f"{YAW}.offset", 0.002, "second"),
        error("time_base.trailer.delay", 0.1, None),
    ],
    logs=[
        SimpleNamespace(name="first", noise={YAW: 1e-6}, bank=None, drive_axle_braking=(0.7, 0.1)),
        SimpleNamespace(name="second", noise={YAW: 2e-6}, bank=None, drive_axle_braking=None),
    ],
    signals=(STEER, YAW, LATERAL),
    initial_vehicle=TRUCK,
    settings=OneStage(given={"sensors": "exact", "road.bank": "exact"}),
    surroundings={"tyre.shape": 1.2, "body.half_track": 0.9},
    covariance=None,
)

VARYING = math.hypot(0.02, quantity_of(BANK_VARIATION).sigma)
"""Standard deviation of the bank at a place of the first log, rad."""


@pytest.mark.parametrize(
    ("log", "offset", "noise"), [("first", 0.001, 1e-6), ("second", 0.002, 2e-6), (None, None, 1e-6), ("b", None, 1e-6)]
)
def test_sensor_errors_and_noise_of_a_log(log: str | None, offset: float | None, noise: float) -> None:
    """Of another log only what all logs share, with the noise of the first; an observer has one time base. The first
    log informs who brakes, of another log nothing is known of it."""
    settings = IDENTIFICATION.sensor_settings(log)
    own = {} if offset is None else {f"{YAW}.offset": offset}
    brakes = {} if log == "second" else {"brakes.drive_axle": 0.7 if log == "first" else 0.5}
    road = {"friction": None, "half_track": 0.9, "surroundings": {"tyre.shape": 1.2} | brakes}
    exact = dict.fromkeys(("bank_mean", "bank", "steer_offset", "acceleration_offset", "wheel_speed_offset"), 0.0)
    assert settings == {"sensor_errors": {f"{STEER}.gain": 1.1, **own}, "noise": {YAW: noise}} | road | exact


def test_bank_and_offsets_of_a_log() -> None:
    """The joint covariance contains the offsets of a log that has them; other logs have the priors. The bank varies
    within a log."""
    sensors = [*IDENTIFICATION.sensors, *(error(f"{name}.offset", 0.004, "first") for name in (STEER, LATERAL))]
    first, *others = IDENTIFICATION.logs
    logs = [SimpleNamespace(**{**vars(first), "bank": (0.01, 0.02)}), *others]
    changes = {"sensors": sensors, "logs": logs, "settings": OneStage()}
    prior = (0.0, 0.03, 0.01, 0.3)
    for log, covariance, expected in (
        ("first", object(), (0.01, VARYING, 0.0, 0.0)),
        ("first", None, (0.01, VARYING, 0.003, 0.003)),
        *((log, object(), prior) for log in ("second", None, "b")),
    ):
        identification: Any = Fields(**{**vars(IDENTIFICATION), **changes, "covariance": covariance})
        settings = identification.sensor_settings(log)
        names = ("bank_mean", "bank", "steer_offset", "acceleration_offset")
        assert tuple(settings[name] for name in names) == expected


def test_json_has_no_number_that_is_not_finite() -> None:
    data = {"a": [1.0, math.nan, (math.inf, {"b": -math.inf})], "c": "nan", "d": None, "e": 3}
    assert _finite(data) == {"a": [1.0, None, [None, {"b": None}]], "c": "nan", "d": None, "e": 3}
    json.dumps(_finite(data), allow_nan=False)
