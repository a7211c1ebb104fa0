"""How runs and remedies are chosen from predicted sigmas, and the parts of a prediction, each against a closed form."""

from types import SimpleNamespace

import numpy as np
import pytest

from fifthwheel.data.record import Record
from fifthwheel.data.record.derived import article_gyro_variance
from fifthwheel.estimate.design import DesignSettings
from fifthwheel.estimate.design.experiment import _best_of_each_kind
from fifthwheel.estimate.design.predict import (
    InformationPredictor,
)
from fifthwheel.estimate.design.remedies import LANE_CHANGE, REPEAT, PredictedRemedies
from fifthwheel.estimate.design.search import ProposedRun
from fifthwheel.estimate.identify import OneStage
from fifthwheel.estimate.identify.dataset import LogData
from fifthwheel.model.manoeuvres.candidates import CandidateManoeuvre
from fifthwheel.model.simulate import simulate
from fifthwheel.truck.quantities import MASS_SCALE

BELOW, ABOVE = 1 - 1e-9, 1 + 1e-9
GYROS = article_gyro_variance(["tractor", "semitrailer"])


def candidate(kind: str, duration: float, ratio: float, acceleration: float = 1.0, count: int = 1) -> ProposedRun:
    manoeuvre = CandidateManoeuvre(
        kind=kind, frequency=None, speed=20.0, period=duration / count, acceleration=np.zeros_like
    )
    return ProposedRun(
        manoeuvre=manoeuvre, rate=100.0, repetitions=count, leading=1.0, acceleration=acceleration,
        unit_steer=np.zeros(1), sigma={}, verdicts={}, worst_ratio=ratio,
    )  # fmt: skip


def chosen(*candidates: ProposedRun, near: float = 1.05) -> list[ProposedRun]:
    return _best_of_each_kind(candidates, DesignSettings(near=near))


def test_the_shortest_run_that_reaches_the_targets() -> None:
    """Of equally long ones the gentlest; ratios up to 1 reach the targets."""
    exact, missed = candidate("bend", 20.0, 1.0), candidate("sweep", 1.0, ABOVE)
    longer, hard = candidate("bend", 21.0, 0.1, acceleration=0.1), candidate("random", 20.0, 0.1, acceleration=1.1)
    gentle = candidate("random", 20.0 + 1e-8, 0.9, acceleration=1.0 - 1e-9)
    assert chosen(hard, longer, missed, exact, gentle) == [gentle, exact]
    assert chosen(candidate("bend", 20.0 + 1e-5, 0.9, acceleration=0.1), hard)[0] is hard
    assert chosen(longer, candidate("bend", 40.0, 0.5, count=2)) == [longer]
    # none reaches them: within 1.05 of the smallest ratio; of equally long ones the nearest to the targets
    best, short = candidate("bend", 30.0, 2.0), candidate("sweep", 10.0, 2.1)
    far, near = candidate("random", 5.0, 2.1 * ABOVE), candidate("random", 10.0, 2.05, acceleration=9.0)
    assert chosen(best, short, far) == [short, best]
    assert chosen(best, short, far, near) == [near, short, best]
    assert chosen(best, short, near, near=1.01) == [best]


class Predictor:
    """Sigma of a parameter by what is known, added and repeated; its prior sigma is 10."""

    setup = SimpleNamespace(
        estimated=("stiffness",),
        outputs=("yaw", "roll", "hitch"),
        vehicle=SimpleNamespace(units=[SimpleNamespace(name=name, axle_groups=()) for name in ("tractor", "trailer")]),
        unknowns=tuple(
            SimpleNamespace(name=n)
            for n in ("stiffness", "gain", MASS_SCALE, "tractor.mass", "trailer.mass", "axle.softening", "offset")
        ),
    )

    def __init__(self, **sigmas: float) -> None:
        self.sigmas = sigmas

    def prior_sigma(self, name: str) -> float:
        assert name == "stiffness"
        return 10.0

    def posterior(self, runs: list, *, known: list = (), added: list = ()) -> SimpleNamespace:
        drive = "" if len(runs) == 1 else "again" if runs[0] is runs[1] else "lane_change"
        weighed = ["weighed" if n == MASS_SCALE else n.removesuffix(".mass") for n in known]
        sigma = self.sigmas.get("_".join([drive, *added, *weighed]).strip("_"), 1.0)
        return SimpleNamespace(reliable_sigma=lambda _: sigma)


def remedies(sigmas: dict[str, float], *, estimated_knowable: bool = True, **limits: float) -> list[tuple]:
    run = SimpleNamespace(logged={"yaw": None})
    made = PredictedRemedies.of(
        Predictor(**sigmas), [run], SimpleNamespace(logged={"yaw": None}), estimated_knowable=estimated_knowable
    )
    chosen = made.best("stiffness", 10.0, **{"target": 0.5, "min_reduction": 0.2, "max_count": 2, **limits})
    return [(*remedy.known, remedy.channel, remedy.drive, remedy.sigma) for remedy in chosen]


def test_remedies_of_each_kind() -> None:
    """A remedy leaves at most 80 % of sigma; the smallest sigma of each kind, at most two of them."""
    assert remedies({"gain": 0.8 * ABOVE, "roll": 0.8 * ABOVE, "again": 0.8 * ABOVE}) == []
    assert remedies({"gain": 0.8}, target=8.0) == [("gain", None, None, 8.0)]
    several = {"gain": 0.7, "offset": 0.6, "roll": 0.5, "hitch": 0.4, "again": 0.5, "lane_change": 0.3}
    assert remedies(several, target=9.0, max_count=3) == [
        (None, LANE_CHANGE, 3.0),
        ("hitch", None, 4.0),
        ("offset", None, None, 6.0),
    ]
    assert remedies(several, target=9.0) == [(None, LANE_CHANGE, 3.0), ("hitch", None, 4.0)]
    assert remedies({**several, "again": 0.2}, target=9.0)[0] == (None, REPEAT, 2.0)
    # a lane change with a channel only if no single change suffices; two numbers if one misses the target
    double = {"lane_change_roll": 0.3, "lane_change_hitch": 0.2}
    assert remedies(double) == [("hitch", LANE_CHANGE, 2.0)]
    assert remedies({**double, "again": 0.8}) == [(None, REPEAT, 8.0)]
    two = {"gain": 0.7, "gain_offset": 0.5, "offset": 0.75}
    assert remedies(two, target=7.0) == [("gain", None, None, 7.0)]
    assert remedies(two, target=7.0 * BELOW) == [("gain", None, None, 7.0), ("gain", "offset", None, None, 5.0)]


def test_what_could_be_known() -> None:
    """All masses together, not the softening of tyres, not the parameter itself, others only if they may be known."""
    run = SimpleNamespace(logged={"yaw": None})
    for knowable in (True, False):
        made = PredictedRemedies.of(Predictor(), [run], run, estimated_knowable=knowable)
        assert made.knowable == (*["stiffness"] * knowable, "gain", MASS_SCALE, "offset")
    assert [remedy.channel for remedy, _ in made.double] == ["roll", "hitch"]
    assert remedies({"weighed_tractor_trailer": 0.5}) == [(MASS_SCALE, None, None, 5.0)]
    assert remedies({"stiffness": 0.1}) == []


@pytest.fixture(scope="module")
def lanes(truck) -> Record:
    return simulate(truck, count=1, seed=4, name="lanes")


def test_the_conditional_sigma_of_a_parameter(truck, lanes) -> None:
    """All other estimated parameters known, but no uncertain number, sensor error or initial state."""
    vehicle = truck.with_logged_steering(lanes.signals, lanes.name)
    predictor = InformationPredictor.of(vehicle, OneStage(), [20.0])
    run = predictor.run_information(LogData(name="lanes", segments=[lanes], noise=dict(GYROS)))
    information, estimated = run.information(), predictor.setup.estimated
    nuisances = [i for i, name in enumerate(run.names) if name not in estimated]
    assert len(estimated) == 5 < len(nuisances)
    for name in estimated:
        kept = [run.names.index(name), *nuisances]
        expected = np.linalg.inv(np.eye(len(kept)) + information[np.ix_(kept, kept)])[0, 0]
        assert predictor.posterior([run]).conditional_sigma(name) == pytest.approx(np.sqrt(expected), rel=1e-6)
