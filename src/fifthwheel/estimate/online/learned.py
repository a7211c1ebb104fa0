"""What a learner learned, as the knowledge of a log, and its doubts by the rules of `estimate.identify.doubts`.

With the means z0 and z1 of the estimated unknowns at the start and now, and their covariances P0 and P1, which contain
the effect of the considered unknowns, the samples between contribute the information H = P1^-1 - P0^-1 and
H z = P1^-1 z1 - P0^-1 z0. Start and information together give the estimates of the learner with their sigma. Directions
of z that gained nothing, because the estimates walk or a considered unknown determines them, contribute nothing. Of the
considered unknowns nothing is kept: their effect is a bound of model errors, from which they cannot be estimated.
"""

import datetime
import math
import uuid
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from fifthwheel.base.types import Array
from fifthwheel.data.channels import is_sensor_error
from fifthwheel.estimate.filters.relinearised import JointEstimate
from fifthwheel.estimate.identify.doubts import Doubt, DoubtKind, Evidence, PriorTest, describe_doubt, most_likely
from fifthwheel.estimate.identify.knowledge.information import (
    Labels,
    LogKnowledge,
    Occasion,
    SharedInformation,
    masses_of_load,
)
from fifthwheel.estimate.identify.knowledge.storage import restored_logs
from fifthwheel.estimate.identify.one_stage.shared_information import marginal_information
from fifthwheel.estimate.identify.one_stage.solution import LogLinearisation
from fifthwheel.estimate.identify.stored import restored, stored
from fifthwheel.estimate.identify.unknowns.unknown import Unknown, is_possible
from fifthwheel.estimate.online.live_filter import LiveFilter
from fifthwheel.estimate.online.start import EstimateBlock

GAINED = 1e-3
"""Smallest information of a direction of z that counts, in units of the prior's."""
UNUSUAL_CHANGE = 3.5
"""Prior standard deviations that the estimate of a number of the vehicle changes at least, with its prior, if it is
contradicted. A smaller change with a large score is mostly what the estimates do not absorb exactly: in eight lane
changes of an exact truck a score is 6 standard deviations from 0, but the change 2.7 (`tyre_roll_stiffness`). The
errors of sensors act on one channel, and need no such limit."""


@dataclass(frozen=True, kw_only=True)
class LearnedLog:
    """What a learner learns from now on, which is one log, and the logs before it."""

    occasions: Mapping[str, Occasion]  # of each trailer by the name under which its estimates are kept
    logs: tuple[LogKnowledge, ...] = ()  # of the couplings that ended
    digest: str = field(default_factory=lambda: uuid.uuid4().hex)  # of the log that is learned
    date: datetime.datetime | None = None  # of the last sample before the learner was loaded

    def finished(self, live: LiveFilter, trailer: str, time: float) -> "LearnedLog":
        """With what a filter learned up to a time, s, and a new log after it."""
        occasion, setup = self.occasions[trailer], live.setup
        date = self._date(occasion, time)
        labels = Labels.of(setup.vehicle, replace(occasion, road=""), setup.estimated)  # it learns on many roads
        information = learned_knowledge(live, labels)
        if information is None:
            return self
        log = LogKnowledge(
            **vars(labels) | {"name": f"learned until {date:%Y-%m-%d %H:%M}"},
            date=date,
            information=information,
            digest=self.digest,
            doubts=tuple(describe_doubt(doubt) for doubt in find_doubts(live, live.estimate())),
            masses=masses_of_load(setup.vehicle),
        )
        return LearnedLog(occasions=self.occasions, logs=(*self.logs, log))

    def as_dict(self, live: LiveFilter, trailer: str, time: float) -> dict[str, Any]:
        """The content for JSON."""
        began = EstimateBlock.of(live.setup.unknowns, *live.joint(live.began))
        occasions = {name: Occasion(trailer=of.trailer, load=of.load) for name, of in self.occasions.items()}
        learned = replace(self, occasions=occasions, date=self._date(self.occasions[trailer], time))
        return {"began": stored(EstimateBlock, began), **stored(LearnedLog, learned)}

    @classmethod
    def restored(cls, content: Mapping[str, Any], live: LiveFilter) -> "LearnedLog":
        """That of `as_dict`, whose start the filter gets."""
        began, logs = EstimateBlock.restored(content["began"]), restored_logs(content["logs"])
        live.began = live.joint_estimate(began.z, began.Pz)
        learned: LearnedLog = restored(cls, {**content, "logs": logs})
        return learned

    def _date(self, occasion: Occasion, time: float) -> datetime.datetime:
        """Of the last sample: by its time, or of the learner that was loaded, if no sample came since."""
        return self.date if self.date and math.isnan(time) else occasion.date_at(time)


def learned_information(live: LiveFilter) -> tuple[Array, Array]:
    """Information (n_z, n_z) on the estimated unknowns since the start, and its product with their mean (n_z,)."""
    n = len(live.setup.estimated_unknowns)
    (z0, P0), (z1, P1) = ((z[:n], np.linalg.inv(P[:n, :n])) for z, P in (live.joint(live.began), live.joint()))
    gained, axes = np.linalg.eigh(P1 - P0)
    axes, gained = axes[:, gained > GAINED], gained[gained > GAINED]
    return axes * gained @ axes.T, axes @ (axes.T @ (P1 @ z1 - P0 @ z0))


def learned_knowledge(live: LiveFilter, labels: Labels) -> SharedInformation | None:
    """What a filter learned since its start; None if nothing."""
    now, setup = live.filter.estimate(), replace(live.setup, unknowns=live.setup.estimated_unknowns)
    information, vector = learned_information(live)
    if not information.any():
        return None
    log = LogLinearisation(
        indices=np.arange(len(now.z)),
        information=information,
        gradient=information @ now.z - vector,
        score_covariance=max(1.0, *live.innovations.autocorrelation) * information,
    )
    return marginal_information(setup, [u.name for u in setup.unknowns], now.z, log, labels)


def find_doubts(live: LiveFilter, estimate: JointEstimate) -> tuple[Doubt, ...]:
    """The doubts of a filter at an estimate, each with the parameters that it concerns."""
    setup, learner, innovations = live.setup, live.learner, live.innovations
    unknowns = setup.estimated_unknowns
    evidence = Evidence(
        names=[u.name for u in unknowns],
        z=estimate.z,
        covariance=estimate.covariance()[: len(unknowns), : len(unknowns)],
        unknowns={u.name: u for u in setup.unknowns},
        parameters=tuple(u.name for u in unknowns if u.is_of_truck),
    )
    doubts = [
        *evidence.contradicted_assumptions(_likely(score_tests(live, estimate), evidence.unknowns)),
        *evidence.unusual_estimates(),
    ]
    size, autocorrelation = max(innovations.mean_square), max(innovations.autocorrelation)
    if size > learner.max_innovation_ratio or autocorrelation > learner.max_autocorrelation:
        largest = max(size, autocorrelation)
        doubts.append(Doubt(kind=DoubtKind.NOISE, causes=(), parameters=evidence.parameters, statistic=largest))
    return tuple(doubts)


def least_change(unknown: Unknown) -> float:
    """The change in prior standard deviations, with the prior, from which an unknown is tested."""
    return 0.0 if is_sensor_error(unknown.name) else UNUSUAL_CHANGE


def _likely(tests: Sequence[PriorTest], unknowns: Mapping[str, Unknown]) -> list[PriorTest]:
    """The likely causes of a contradiction: if there are any, errors of sensors, and numbers on which the drive has no
    less information than their prior."""
    informed = [test for test in tests if is_sensor_error(test.name) or test.variance <= 2]
    return most_likely(informed, unknowns) or most_likely(tests, unknowns)


def score_tests(live: LiveFilter, estimate: JointEstimate) -> list[PriorTest]:
    """The test of every considered unknown that changes enough, and that a truck can have as it implies.

    The innovations of the filter are independent of the estimates, so no other information matrix is needed.
    """
    tests, cross = [], estimate.B @ estimate.correlation
    for i, unknown in enumerate(live.setup.considered_unknowns):
        gradient, information = float(estimate.gradient[i]), float(estimate.information[i])
        if information <= 0 or abs(gradient) < least_change(unknown) * (1 + information):
            continue
        implied = -gradient / information
        change = implied * float(live.considered.sigma[i])
        if is_possible(unknown, change):
            tests.append(
                PriorTest(
                    name=unknown.name,
                    statistic=-gradient / np.sqrt(information * (1 + information)),
                    implied=change,
                    shifts=cross[:, i] * implied,
                )
            )
    return tests
