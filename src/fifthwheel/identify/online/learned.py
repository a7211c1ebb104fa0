"""What a learner learned, as the knowledge of a log.

The estimates z of a learner and the considered unknowns c, in units of their priors, are jointly normal. With
z | c ~ N(z0 + B0 (c - c0), P0) at the start and z | c ~ N(z1 + B1 (c - c0), P1) now, the samples between contribute to
the cost of z and c, up to a function of c alone,

    (z - z1 - B1 (c - c0))' P1^-1 (...) / 2 - (z - z0 - B0 (c - c0))' P0^-1 (...) / 2.

Hence the information A = P1^-1 - P0^-1 of z, and N = P0^-1 B0 - P1^-1 B1 between z and c. Of the function of c the
learner keeps only tests. The least information that A and N allow is that for which the minimum of the cost over z is
the same for all c: N' A^+ N. Directions of z that gained nothing, where the walk of the estimates exceeds what was
learned, contribute nothing.

The cornering stiffness of a log varies about that which logs share, with a standard deviation that is no unknown of a
learner. With the covariance Q of this variation, the information H of the log on the shared one is
H (I + Q H)^-1.
"""

import datetime
import math
import uuid
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from fifthwheel._types import Array
from fifthwheel.filters.relinearised import JointEstimate
from fifthwheel.identify.doubts import describe_doubt
from fifthwheel.identify.knowledge.information import LogKnowledge, Occasion, SharedInformation, masses_of_load
from fifthwheel.identify.knowledge.storage import log_contents, log_of
from fifthwheel.identify.one_stage.shared_information import marginal_information
from fifthwheel.identify.one_stage.solution import LogLinearisation
from fifthwheel.identify.online.evidence import find_doubts
from fifthwheel.identify.online.live_filter import LiveFilter
from fifthwheel.identify.online.persistence import EstimateBlock
from fifthwheel.identify.online.start import Considered
from fifthwheel.identify.setup import Setup
from fifthwheel.names import ParameterPath

GAINED = 1e-3
"""Smallest information of a direction of z that counts, in units of the prior's."""


@dataclass(frozen=True, kw_only=True)
class LearnedLog:
    """What a learner learns from now on, which is one log, and the logs before it."""

    occasions: Mapping[str, Occasion]
    """Of each trailer by the name under which its estimates are kept."""
    logs: tuple[LogKnowledge, ...] = ()
    """Of the couplings that ended."""
    digest: str = field(default_factory=lambda: uuid.uuid4().hex)
    """Of the log that is learned."""
    date: datetime.datetime | None = None
    """Of the last sample before the learner was loaded."""

    def finished(self, live: LiveFilter, trailer: str, time: float) -> "LearnedLog":
        """With what a filter learned up to a time, s, and a new log after it."""
        occasion, information = self.occasions[trailer], learned_knowledge(live)
        if information is None:
            return self
        date, setup = self._date(occasion, time), live.setup
        log = LogKnowledge(
            name=f"learned until {date:%Y-%m-%d %H:%M}",
            date=date,
            tractor=setup.vehicle.units[0].name,
            trailer=occasion.trailer,
            load=occasion.load,
            information=information,
            estimated=tuple(name for name in setup.estimated if name in information.names),
            digest=self.digest,
            doubts=tuple(describe_doubt(doubt) for doubt in find_doubts(live, live.estimate())),
            masses=masses_of_load(setup.vehicle),
        )
        return LearnedLog(occasions=self.occasions, logs=(*self.logs, log))

    def with_occasion(self, trailer: str, occasion: Occasion) -> "LearnedLog":
        """With that of another trailer."""
        return replace(self, occasions={**self.occasions, trailer: occasion})

    def as_dict(self, live: LiveFilter, trailer: str, time: float) -> dict[str, Any]:
        """The content for JSON."""
        began = EstimateBlock.of(live.setup.unknowns, *live.joint(live.began), range(len(live.setup.unknowns)))
        return {
            "began": began.as_dict(),
            "occasions": {name: [of.trailer, of.load] for name, of in self.occasions.items()},
            "logs": [log_contents(log) for log in self.logs],
            "digest": self.digest,
            "date": self._date(self.occasions[trailer], time).isoformat(),
        }

    @classmethod
    def restored(cls, content: Mapping[str, Any], live: LiveFilter) -> "LearnedLog":
        """That of `as_dict`, whose start the filter gets."""
        began = EstimateBlock.from_dict(content["began"])
        live.set_start(began.z, began.Pz)
        return cls(
            occasions={name: Occasion(trailer=of[0], load=of[1]) for name, of in content["occasions"].items()},
            logs=tuple(log_of(log) for log in content["logs"]),
            digest=content["digest"],
            date=datetime.datetime.fromisoformat(content["date"]),
        )

    def _date(self, occasion: Occasion, time: float) -> datetime.datetime:
        """Of the last sample: by its time, or of the learner that was loaded, if no sample came since."""
        return self.date if self.date and math.isnan(time) else occasion.date_at(time)


def learned_information(start: JointEstimate, now: JointEstimate, known: Considered) -> tuple[Array, Array]:
    """Information (n_p, n_p) of all unknowns, and its product with their mean (n_p,), from what was learned."""
    before, after = np.linalg.inv(start.Pz), np.linalg.inv(now.Pz)
    B_before, B_after = start.B / known.sigma, now.B / known.sigma
    gained, axes = np.linalg.eigh(after - before)
    axes, gained = axes[:, gained > GAINED], gained[gained > GAINED]
    cross = axes.T @ (before @ B_before - after @ B_after)
    vector = axes.T @ (after @ (now.z - B_after @ known.mean) - before @ (start.z - B_before @ known.mean))
    rows = np.hstack([gained[:, None] * axes.T, cross])  # of the information, in the directions that gained
    return rows.T @ (rows / gained[:, None]), rows.T @ (vector / gained)


def learned_knowledge(live: LiveFilter) -> SharedInformation | None:
    """What a filter learned since its start; None if nothing."""
    known, now, setup = live.considered, live.filter.estimate(), live.setup
    information, vector = learned_information(live.began, now, known)
    if not information.any():
        return None
    z, Q = np.append(now.z, known.mean), np.diag(_variation(setup))
    T = np.linalg.inv(np.eye(len(z)) + information @ Q)
    scores = max(1.0, *live.innovations.autocorrelation) * information + information @ Q @ information
    log = LogLinearisation(
        indices=np.arange(len(z)),
        information=T @ information,
        gradient=T @ (information @ z - vector),
        score_covariance=T @ scores @ T.T,
    )
    return marginal_information(setup, [u.name for u in setup.unknowns], z, log)


def _variation(setup: Setup) -> Array:
    """Variance (n_p,) of the unknowns from log to log, in units of their priors."""
    sigma = setup.settings.consider.get("stiffness_variation", 0.0)
    varies = [ParameterPath.of(u.name).quantity == "cornering_stiffness" for u in setup.unknowns]
    return np.array([(sigma / u.scale) ** 2 if v else 0.0 for u, v in zip(setup.unknowns, varies, strict=True)])
