"""The combination of trips: shared unknowns, coverage, changes with their dates, false alarms."""

import itertools
from dataclasses import replace

import numpy as np
import pyarrow as pa
import pytest

from fifthwheel.apps.fleet import FleetSettings, storage
from fifthwheel.apps.fleet.dataset import TripDataset
from fifthwheel.apps.fleet.tables import SCHEMAS, CombinationJob, combine_trucks
from fifthwheel.apps.fleet.trips import SCHEMA, log_knowledge, parquet
from fifthwheel.estimate.filters.model import pack_array, unpack_array
from fifthwheel.estimate.identify.knowledge.changes import WINDOWS
from fifthwheel.estimate.identify.knowledge.combination import combine
from fifthwheel.estimate.identify.knowledge.information import Labels
from tests.apps.fleet.synthetic import NAMES, PARAMETERS, SCALES, Synthetic, value

WALK = 0.004


def history(rng, *, trips=10, walk=WALK, change=None, **options):
    """A truck and the rows of its trips every third day; `change(truck)` acts before the given trip."""
    truck = Synthetic(rng, **options)
    rows = []
    for k in range(trips):
        if k:
            truck.step(3, walk)
        if change and k == change[0]:
            change[1](truck)
        rows.append(truck.trip(3 * k))
    return truck, rows


def combined(rows, *, walk=WALK, false_alarms=0.05, trucks=1):
    tests = len(rows) * len(WINDOWS) * trucks
    return combine([log_knowledge(row) for row in rows], tyre_walk=walk, false_alarm=false_alarms / tests)


def estimates(result, k):
    return {unknown.name: result.estimate(k, unknown) for unknown in result.parameters(k)}


OWNERS = {
    (
        None,
        None,
    ): """tractor.front.cornering_stiffness steer.tractor.front.gain mass_scale time_base speed.delay tractor.mass
        tractor.axle_positions tractor.drive.relative_friction road.friction""",
    ("A", None): """semitrailer.cornering_stiffness semitrailer.roll_stiffness semitrailer.axle_positions
        fifth_wheel.roll_stiffness tyre.shape body.drag_area yaw_rate.semitrailer.gain""",
    ("A", "steel"): """semitrailer.payload.height semitrailer.payload.mass semitrailer.yaw_inertia semitrailer.mass
        semitrailer.cog semitrailer.static_load tractor.drive.static_load""",
}
"""Names of numbers by the trailer and load that trips must share for them."""


def test_what_trips_share() -> None:
    """Axle loads of the tractor depend on the load too; the tyre law holds for the tyres of tractor and trailer."""
    log = Labels(tractor="tractor", trailer="A", load="steel", road="track")
    for expected, names in OWNERS.items():
        for name in names.split():
            unknown = log.owned(name)
            assert (unknown.of("trailer"), unknown.of("load")) == expected, name
            of_road = name == "road.friction"
            assert (replace(log, tractor="lorry").owned(name) == unknown) == of_road
            assert unknown.of("log") is None
            assert (replace(log, road="").owned(name).of("log") is None) != of_road


@pytest.mark.slow
def test_intervals_cover() -> None:
    """90 % intervals of every parameter at the first, a middle and the last trip, with drift and uncertain masses.

    The p-values of the trips are uniform, and at most the stated 30 % of the trucks report a change (95 % limit of the
    binomial distribution).
    """
    rng, inside, p_values, alarms, stated = np.random.default_rng(3), [], [], [], 0.3
    for _ in range(60):
        truck = Synthetic(rng)
        rows, truth = [], []
        for k in range(10):
            truck.step(3 if k else 0, WALK)
            truth.append(truck.z.copy())
            rows.append(truck.trip(3 * k))
        result = combined(rows, false_alarms=1e-6)
        p_values += [*result.p_values]
        alarms.append(bool(combined(rows, false_alarms=stated).changes))
        for k in (0, 5, 9):
            for name, (estimate, sigma) in estimates(result, k).items():
                i = NAMES.index(name)
                inside.append(abs(estimate - value(truth[k][i], i)) < 1.645 * sigma)
    assert 0.85 < np.mean(inside) < 0.95
    assert 0.43 < np.mean(np.array(p_values) < 0.5) < 0.57
    assert np.mean(alarms) <= stated + 1.645 * np.sqrt(stated * (1 - stated) / len(alarms))
    # not what is uncertain of the vehicle file: it has no row in the tables, and no change of it is tested
    assert {u.name for u in result.parameters(1)} == set(PARAMETERS)


def test_two_trucks_share_nothing() -> None:
    """Not even what has no unit in its name."""
    rng = np.random.default_rng(4)
    rows = [Synthetic(rng).trip(k) | {"tractor": tractor} for k, tractor in enumerate(("tractor", "lorry"))]
    for row in rows:
        row["information"]["names"][:2] = ("mass_scale", "time_base")
    result = combined(rows)
    assert len(result.layout.unknowns) == 2 * len(NAMES)
    for name in ("mass_scale", "time_base"):
        owners = {u.owner for u in result.layout.unknowns if u.name == name}
        assert owners == {(("tractor", "lorry"),), (("tractor", "tractor"),)}


def test_another_prior_of_a_later_vehicle_file_changes_nothing() -> None:
    """The information of a trip is converted to the prior of the first trip."""
    _, rows = history(np.random.default_rng(6), trips=3)
    other = []
    for row in rows[1:]:
        shift, stretch, own = 0.3, 2.0, row["information"]
        k = len(NAMES)
        H, v, logarithmic = unpack_array(np.array(own["information"]), k), np.array(own["vector"]), own["logarithmic"]
        a = np.where(logarithmic, stretch, 1.0)
        b = np.where(logarithmic, shift / np.array(own["scale"]), 0.0)  # z = a z' + b
        changed = {
            "centre": (own["centre"] * np.where(logarithmic, np.exp(shift), 1.0)).tolist(),
            "scale": (own["scale"] * a).tolist(),
            "information": pack_array(H * np.outer(a, a)).tolist(),
            "score_covariance": pack_array(H * np.outer(a, a)).tolist(),
            "vector": (a * (v - H @ b)).tolist(),
        }
        other.append(row | {"information": own | changed})
    expected, found = (estimates(combined(r), 2) for r in (rows, [rows[0], *other]))
    for name, pair in expected.items():
        assert found[name] == pytest.approx(pair, rel=1e-8)


def tyres(truck) -> None:
    truck.z[1] += np.log(0.85) / SCALES[1]


def load(truck) -> None:
    truck.z[3] += np.log(1.25) / SCALES[3]
    truck.z[4] += 0.3


@pytest.mark.slow
@pytest.mark.parametrize(("change", "kind"), [(tyres, "tyres"), (load, "load")])
def test_a_change_is_found_and_dated(change, kind) -> None:
    """In 5 trucks with the right kind and date; of tyres by 15 %, of the load by 25 % and 0.3 m."""
    rng, hits = np.random.default_rng(7), 0
    for _ in range(5):
        _, rows = history(rng, trips=12, change=(6, change))
        changes = combined(rows, trucks=20).changes
        hits += any(c.kind.name == kind and c.trip == 6 for c in changes) and len(changes) == 1
    assert hits == 5


def test_a_single_different_trip_is_an_outlier() -> None:
    rng = np.random.default_rng(8)
    _, rows = history(rng, trips=12)
    _, wrong = history(np.random.default_rng(9), trips=12)
    rows[5] = rows[5] | {"information": wrong[5]["information"]}
    (change,) = combined(rows).changes
    assert (change.kind.name, change.trip) == ("outlier", 5)


def best(P, i, chosen):
    """Fraction of the variance of unknown i that would go if the chosen ones were exact."""
    kept = [j for j in range(len(P)) if j not in chosen]
    conditional = np.linalg.inv(np.linalg.inv(P)[np.ix_(kept, kept)])
    return 1 - conditional[kept.index(i), kept.index(i)] / P[i, i]


@pytest.fixture(scope="module")
def of_truck(tmp_path_factory):
    """A truck whose tyres change before trip 6 and that pulls trailer B in trip 4: its combination and its tables."""
    truck, rows, data = Synthetic(np.random.default_rng(7)), [], TripDataset(str(tmp_path_factory.mktemp("data")))
    for k in range(12):
        truck.step(3 if k else 0, WALK)
        if k == 6:
            tyres(truck)
        row = truck.trip(3 * k, trailer="B" if k == 4 else "A", load="" if k == 4 else "steel")
        verdicts = ("converged" if k < 3 else "not_excited", *["converged"] * 4)
        row["estimates"] = [
            {"name": n, "value": 100.0 + k, "sigma": 1.0 + i, "unit": "", "verdict": verdict}
            for i, (n, verdict) in enumerate(zip(PARAMETERS, verdicts, strict=True))
        ]
        rows.append(row | {"digest": f"digest {k}"})
    storage.write_bytes(data.file("trips/part-1.parquet"), parquet(pa.Table.from_pylist(rows, schema=SCHEMA)))
    job = CombinationJob(path=data.path, settings=FleetSettings(tyre_walk=WALK), false_alarm=1e-4)
    logs = {row["digest"]: f"{k}.csv" for k, row in enumerate(rows)}
    tables = combine_trucks(job, [("U", {"unknown digest": "0.csv"}), ("T", logs)])
    return combine([log_knowledge(row) for row in rows], tyre_walk=WALK, false_alarm=1e-4), tables, rows


def test_a_truck_that_cannot_be_combined_does_not_stop_others(of_truck) -> None:
    _, tables, _ = of_truck
    assert tables.failed == {"U": "KeyError: 'unknown digest'"}
    assert {row["truck"] for name in SCHEMAS for row in tables.tables[name]} == {"T"}


def test_the_latest_estimates_of_a_truck_and_its_trailers(of_truck) -> None:
    """At the last trip with the trailer; the first value is that after the change of the tyres."""
    result, tables, rows = of_truck
    latest = {(u.name, u.of("trailer"), u.of("load") or None): (u, k) for k in range(12) for u in result.parameters(k)}
    of_truck_alone = {row["parameter"]: row for row in tables.tables["trucks"]}
    assert of_truck_alone.keys() == set(list(PARAMETERS)[:2])
    trailers = {(row["parameter"], row["trailer"], row["load"] or None): row for row in tables.tables["trailers"]}
    every = {(name, None, None): row for name, row in of_truck_alone.items()} | trailers
    assert every.keys() == latest.keys()
    for (name, trailer, _), row in every.items():
        unknown, last = latest[name, trailer, row.get("load") or None]
        assert (row["value"], row["sigma"]) == pytest.approx(result.estimate(last, unknown), rel=1e-9)
        assert row["date"] == rows[last]["date"]
        assert row["trips"] == {None: 12, "A": 11, "B": 1}[trailer]
        first = 6 if name == "tractor.drive.cornering_stiffness" else 4 if trailer == "B" else 0
        assert row["first_value"] == pytest.approx(result.estimate(first, unknown)[0], rel=1e-9)
        assert row["excited_trips"] == (3 if name == "tractor.front.cornering_stiffness" else row["trips"])
        P, places = result.last.P, result.layout.unknowns
        others = {i: u.name for u, i in places.items() if u not in result.layout.estimated}
        named = itertools.product(*([i for i, n in others.items() if n == source] for source in row["limited_by"]))
        fractions = {chosen: best(P, places[unknown], chosen) for chosen in named}
        chosen = min(fractions, key=lambda chosen: abs(fractions[chosen] - row["limited_fraction"]))
        assert row["limited_fraction"] == pytest.approx(fractions[chosen], abs=1e-6)
        assert 1 <= len(chosen) <= 3
        singles = [best(P, places[unknown], [j]) for j in others]
        assert best(P, places[unknown], chosen[:1]) == pytest.approx(max(singles))
        assert len(chosen) == 3 or row["limited_fraction"] > 0.5
        assert len(chosen) == 1 or best(P, places[unknown], chosen[:-1]) <= 0.5


def test_the_history_of_a_truck(of_truck) -> None:
    """Every parameter at every trip, from all trips and from the trip alone."""
    result, tables, rows = of_truck
    found = {(row["parameter"], row["log"]): row for row in tables.tables["history"]}
    assert len(found) == len(tables.tables["history"]) == 12 * 5
    for k in range(12):
        for i, unknown in enumerate(result.parameters(k)):
            row = found[unknown.name, f"{k}.csv"]
            assert (row["value"], row["sigma"]) == pytest.approx(result.estimate(k, unknown), rel=1e-9)
            assert (row["trailer"], row["load"]) == (unknown.of("trailer"), unknown.of("load"))
            place = list(PARAMETERS).index(unknown.name)
            assert (row["trip_value"], row["trip_sigma"]) == (100.0 + k, 1.0 + place), i
            assert (row["date"], row["p_value"]) == (rows[k]["date"], pytest.approx(result.p_values[k], rel=1e-6))
            assert row["outlier"] is False


def test_the_changes_of_a_truck(of_truck) -> None:
    result, tables, rows = of_truck
    (change,), (row,) = result.changes, tables.tables["changes"]
    assert (row["kind"], row["subject"], row["log"], row["trailer"]) == ("tyres", "tractor.drive", "6.csv", "A")
    assert (row["after"], row["date"]) == (rows[5]["date"], rows[6]["date"])
    assert row["parameter"] == "tractor.drive.cornering_stiffness"
    (unknown,) = [u for u in result.parameters(6) if u.name == row["parameter"]]
    assert row["before"] == pytest.approx(result.estimate(5, unknown)[0], rel=1e-9)
    assert (row["value"], row["sigma"]) == pytest.approx(result.estimate(6, unknown), rel=1e-9)
    expected = (change.probability, change.statistic, change.threshold)
    assert (row["probability"], row["statistic"], row["threshold"]) == pytest.approx(expected, rel=1e-6)
