"""The evidence for a truck: on one A4 page, and as the JSON file of its assessment."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import fifthwheel
from fifthwheel.base import pages
from fifthwheel.base.atomic import file_digest
from fifthwheel.base.formatting import fixed, with_sigma
from fifthwheel.base.pages import html
from fifthwheel.estimate.identify import Identification
from fifthwheel.results.assess import Assessment
from fifthwheel.results.assess.measures import EDITIONS
from fifthwheel.results.assess.truck import HALF_TRACK
from fifthwheel.results.report.assessment import explanations, headline, is_good, verdict
from fifthwheel.results.report.provenance import FILES, FileUsed, Provenance
from fifthwheel.truck import unit_of
from fifthwheel.truck.spoken_names import spoken

PARAMETERS = ("Parameter|name", "Value ± sigma>", "Verdict|w")
SHOWN_PARAMETERS, SHOWN_FILES = 20, 8
"""Rows on the page; the JSON file has all."""


class AssessedParameter(NamedTuple):
    """A parameter of an assessed truck."""

    name: str
    value: float
    sigma: float | None
    """None: exact. Both SI."""
    unit: str
    verdict: str
    """Of an estimate, or "stated" by a file or the user, or "assumed"."""


@dataclass(frozen=True, kw_only=True)
class TruckEvidence:
    """What an assessment says of a truck, and what it was made from."""

    assessment: Assessment
    identification: Identification | None = None
    conclusion: Sequence[str] = ()
    """Sentences on the identification."""
    provenance: Provenance = field(default_factory=Provenance)

    def as_dict(self) -> dict[str, Any]:
        """The content of assessment.json."""
        return self.assessment.as_dict() | {
            "parameters": [parameter._asdict() for parameter in self.parameters()],
            "identification": list(self.conclusion),
            "provenance": self.provenance.as_dict(),
        }

    def parameters(self) -> list[AssessedParameter]:
        """The estimates; then every other uncertain number: what is stated first, then the largest relative sigma.

        An estimate that `changes` of the assessment replace is stated; what was derived from it is left out.
        """
        vehicle, found = self.assessment.vehicle, self.identification
        values = vehicle.parameters() | vehicle.derived()
        before = values if found is None else found.vehicle.parameters() | found.vehicle.derived()
        changed = {path for path, value in vehicle.parameters().items() if value != before.get(path)}
        estimates = () if found is None else (*found.parameters, *found.derived)
        kept = [e for e in estimates if values.get(e.name, e.value) == before.get(e.name, e.value)]
        rows = [AssessedParameter(e.name, e.value, e.sigma, e.unit, str(e.verdict)) for e in kept]
        others = (self.assessment.uncertain.keys() | changed) - {HALF_TRACK} - {e.name for e in kept}
        stated = vehicle.stated.keys() | changed
        sigmas = self.assessment.uncertain
        more = [
            AssessedParameter(
                path, values[path], sigmas.get(path), unit_of(path), "stated" if path in stated else "assumed"
            )
            for path in values
            if path in others
        ]
        return rows + sorted(more, key=lambda p: (p.verdict != "stated", -(p.sigma or 0.0) / (abs(p.value) or 1.0)))

    def document(self, contents: Path) -> pages.Document:
        """One A4 page; it has the digest of the JSON file with the `contents` of this evidence too."""
        assessment, size = self.assessment, contents.stat().st_size
        own = FileUsed(path=contents.name, size=size, sha256=file_digest(contents))
        parameters, files = self.parameters(), [own, *self.provenance.files]
        masses = fixed(sum(unit.mass for unit in assessment.vehicle.units), 0)
        blocks = [
            pages.Headline(headline(assessment), is_good(assessment)),
            *map(pages.Paragraph, self.conclusion),
            pages.Heading("Measures and thresholds"),
            _measures(assessment),
            pages.Heading("Parameters"),
            _parameters(parameters[:SHOWN_PARAMETERS]),
            pages.Heading("Files"),
            pages.Table(FILES, [file.row() for file in files[:SHOWN_FILES]]),
            pages.Items([*self._remarks(len(parameters) - SHOWN_PARAMETERS, len(files) - SHOWN_FILES)]),
        ]
        subtitle = f"Evidence by fifthwheel {fifthwheel.__version__}, {self.provenance.time}. Mass {masses} kg"
        return pages.Document(assessment.title, blocks, subtitle, sheet=True)

    def _remarks(self, parameters: int, files: int) -> Iterator[str]:
        """What the page leaves out, what its numbers mean, and how to verify them."""
        if self.provenance.command:
            yield f"Command: {self.provenance.command}"
        left_out = [f"{n} further {what}" for n, what in ((parameters, "parameters"), (files, "files")) if n > 0]
        if left_out:
            yield f"Only in assessment.json: {' and '.join(left_out)}."
        schemes = {t.scheme for m in self.assessment for t in m.thresholds}
        yield f"Sources of the thresholds: {'; '.join(EDITIONS[name] for name in EDITIONS if name in schemes)}."
        yield from explanations(self.assessment)
        yield "Verify the files: fifthwheel verify FOLDER. This is an engineering estimate and no certificate."


def write_evidence(path: Path, evidence: TruckEvidence, contents: Path) -> None:
    """Write the page of an evidence as one HTML file; `contents` is its JSON file."""
    html.write(path, evidence.document(contents))


def _measures(assessment: Assessment) -> pages.Table:
    table = assessment.table()
    rows = [(row[0], m.source, *row[1:], verdict(m)) for m, row in zip(assessment, table.rows, strict=True)]
    return pages.Table((table.heads[0], "Source", *table.heads[1:], "Verdict|w"), rows)


def _parameters(parameters: Sequence[AssessedParameter]) -> pages.Block:
    rows = [(spoken(p.name), with_sigma(p.value, p.sigma, p.unit), p.verdict.replace("_", " ")) for p in parameters]
    half = (len(rows) + 1) // 2
    return pages.Beside([pages.Table(PARAMETERS, rows[:half]), pages.Table(PARAMETERS, rows[half:])])
