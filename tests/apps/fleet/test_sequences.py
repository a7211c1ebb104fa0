"""Whatever a data set has gone through, a run gives what a first run on the same files gives."""

import contextlib
import json
import shutil
from dataclasses import dataclass

import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import fifthwheel as fw
from fifthwheel.apps.fleet import report, run, storage, trips
from fifthwheel.base.errors import FifthwheelError
from tests.apps.fleet.make import FAST, OTHER, make_fleet

SETTINGS = {"fast": FAST, "other": OTHER}
LOGS = ("truck0_0", "truck0_1")
LIMIT = "FIFTHWHEEL_READER_SAMPLES"


@dataclass(frozen=True)
class State:
    """What a run finds, its settings, and after how many files that it writes it is killed."""

    logs: tuple[str, ...]
    vehicle: str
    signals: str
    settings: str
    limit: str
    killed: int | None


KINDS = ("good", "good", "missing", "damaged", "of another trip")
STATES = st.builds(
    State,
    logs=st.tuples(*(st.sampled_from(KINDS) for _ in LOGS)),
    vehicle=st.sampled_from(("good", "good", "empty", "missing")),
    signals=st.sampled_from(("none", "good", "empty")),
    settings=st.sampled_from(tuple(SETTINGS)),
    limit=st.sampled_from(("default", "default", "not a number")),
    killed=st.sampled_from((None, None, *range(8))),
)


class Fleet:
    """Files that change between runs, and what first runs on them give."""

    def __init__(self, folder):
        self.folder, self.good = folder / "now", folder / "good"
        make_fleet(self.good, trucks=1, trips=len(LOGS) + 1)
        (self.good / "signals.toml").write_text(
            '[signals."yaw_rate.tractor"]\ncolumn = "yaw_rate.tractor"\nunit = "rad/s"\n'
        )
        (self.folder / "logs").mkdir(parents=True)
        self.first, self.identified, self.count = {}, {}, 0

    def run(self, state, out):
        """Put the files of a state in place, and run."""
        for name, kind in zip(LOGS, state.logs, strict=True):
            self._place(f"logs/{name}.parquet", kind)
        self._place("truck.toml", state.vehicle)
        self._place("signals.toml", "missing" if state.signals == "none" else state.signals)
        lines = ["log,truck,trailer,vehicle,load,date,signals"]
        signals = "" if state.signals == "none" else "signals.toml"
        for k, name in enumerate(LOGS):
            lines.append(f"logs/{name}.parquet,truck 0,A,truck.toml,steel,2026-01-0{k + 1},{signals}")
        manifest = self.folder / "manifest.csv"
        manifest.write_text("\n".join(lines))
        writes, write = iter(range(state.killed if state.killed is not None else 1000)), storage.write_bytes

        def write_bytes(path, data):
            if next(writes, None) is None:
                raise KeyboardInterrupt
            write(path, data)

        with pytest.MonkeyPatch.context() as patch:
            patch.setenv(LIMIT, "1000" if state.limit == "default" else state.limit)
            patch.setattr(storage, "write_bytes", write_bytes)
            patch.setattr(trips, "identify", self.identify)
            return run(manifest, out, settings=SETTINGS[state.settings], jobs=1)

    def _place(self, name, kind):
        path = self.folder / name
        path.unlink(missing_ok=True)
        if kind == "empty":
            path.write_text("")
        elif kind != "missing":
            shutil.copy2(self.good / ("logs/truck0_2.parquet" if kind == "of another trip" else name), path)
        if kind == "damaged":
            path.write_bytes(path.read_bytes()[:1000])

    def identify(self, records, vehicle, chosen):
        """Identifies the same samples with the same vehicle and settings once."""
        (record,) = records
        samples = b"".join(record.signals[name].tobytes() for name in sorted(record.signals))
        key = (record.name, samples, vehicle.dumps(), repr(chosen))
        if key not in self.identified:
            self.identified[key] = fw.identify(records, vehicle, chosen)
        return self.identified[key]

    def new_out(self):
        self.count += 1
        return self.folder / f"out{self.count}"

    def of_first_run(self, state):
        """What a first run gives in this state."""
        state = State(**{**vars(state), "killed": None})
        if state not in self.first:
            out = self.new_out()
            self.run(state, out)
            self.first[state] = self.stated(out)
        return self.first[state]

    def stated(self, out):
        """All that a data set states, without times of computation."""
        attention = [(a.truck, a.kind, a.text) for a in report(out, self.folder / "fleet.html")]
        fleet = json.loads((out / "fleet.json").read_text())
        fleet.pop("tables", None)  # digests
        tables = {n: pq.read_table(out / f"{n}.parquet").to_pylist() for n in ("trucks", "trailers", "history")}
        return {"fleet": fleet, **tables, "attention": attention}


@pytest.fixture(scope="module")
def fleet(tmp_path_factory):
    return Fleet(tmp_path_factory.mktemp("fleet"))


@pytest.mark.slow
@settings(max_examples=8, deadline=None, derandomize=True)
@given(states=st.lists(STATES, min_size=2, max_size=6))
def test_a_run_does_not_depend_on_earlier_runs(fleet, states) -> None:
    """Every run of a sequence gives what a first run gives; a killed one leaves the former result, or is reported."""
    out, before = fleet.new_out(), None
    for state in states:
        try:
            fleet.run(state, out)
        except KeyboardInterrupt:
            with contextlib.suppress(FifthwheelError):
                assert fleet.stated(out) == before
            continue
        before = fleet.stated(out)
        if state.limit == "default":  # a lower limit does not invalidate what is read already
            assert before == fleet.of_first_run(state)
