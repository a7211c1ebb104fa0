"""One short identification and its variants, for the tests of diagnosis and report."""

import base64
import functools
import itertools
import zlib
from dataclasses import dataclass, replace
from html.parser import HTMLParser

import numpy as np
import pytest

from fifthwheel.data.record import Record
from fifthwheel.estimate.identify import Identification, identify
from fifthwheel.estimate.identify.verdict import Verdict
from fifthwheel.estimate.observe import Observer, States
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import get

NASTY = 'bend <b> & "quoted" </script><!--'


@dataclass(frozen=True)
class Result:
    """An identification with its logs, one identified on and one only predicted, and their states."""

    identification: Identification
    records: list[Record]
    states: list[States]


@pytest.fixture(scope="session")
def result() -> Result:
    """Two lane changes, and two more with faults in a log with special characters in its name, only predicted."""
    return _result()


@functools.cache  # a fixture that several conftest.py import runs once for each
def _result() -> Result:
    truck = get("cheng_cebon_2011")
    first = simulate(truck, count=2, seed=1, name="lane changes")
    records = [first, faulty(simulate(truck, count=2, seed=2, name=NASTY))]
    start = truck.replace({"semitrailer.yaw_inertia": 0.9 * truck.parameters()["semitrailer.yaw_inertia"]})
    identification = identify(records[:1], start, validate=records[1:])
    states = [
        Observer(identification.vehicle, r.signals, identification.observer_settings(r.name)).batch(r) for r in records
    ]
    return Result(identification, records, states)


def faulty(record: Record) -> Record:
    """Three seconds too slow, a segment without gyros, spikes, and a channel at half the rate."""
    signals = {name: values.copy() for name, values in record.signals.items()}
    signals["speed"][300:600] = 3.0
    for name in signals:
        if "rate" in name:
            signals[name][1000:1200] = np.nan
    signals["yaw_rate.tractor"][[100, 700, 800]] += 1.0
    signals["roll_rate.semitrailer"][1::2] = np.nan
    return replace(record, signals=signals)


@pytest.fixture(scope="session")
def every_verdict(result) -> Identification:
    """The same with a verdict of each kind."""
    old = result.identification.parameters
    verdicts = [verdict for verdict in Verdict if verdict is not Verdict.FIXED]
    of_verdict = itertools.cycle(old)
    changed = [replace(e, verdict=verdict) for verdict, e in zip(verdicts, of_verdict, strict=False)]
    fixed = replace(old[0], name="tractor.yaw_inertia", unit="kg m^2", verdict=Verdict.FIXED, sigma=None)
    changed.append(fixed)
    return replace(result.identification, parameters=tuple(changed))


VOID = {"meta", "wbr", "br", "hr", "img", "input", "link"}


class Page(HTMLParser):
    """A parsed page: its text, links and scripts; an error if a tag is not closed."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.open: list[str] = []
        self.text = ""
        self.ids: list[str] = []
        self.links: list[tuple[str, str]] = []
        self.scripts: dict[str, str] = {}
        self.script = ""
        self.feed(text)
        self.close()
        assert not self.open, f"not closed: {self.open}"

    def data(self, script: str) -> bytes:
        """The decompressed data of a script."""
        return zlib.decompress(base64.b64decode(self.scripts[script]))

    def handle_starttag(self, tag, attrs):
        named = dict(attrs)
        if "id" in named:
            self.ids.append(named["id"])
        self.links += [(tag, named[key]) for key in ("src", "href") if key in named]
        if tag == "script":
            self.script = named.get("id", f"script {len(self.scripts)}")
            self.scripts[self.script] = ""
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        assert tag in VOID | {"path"}

    def handle_endtag(self, tag):
        assert tag not in VOID
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] == "script":
            self.scripts[self.script] += data
        elif not self.open or self.open[-1] != "style":
            self.text += data
