"""Masses from weighbridge slips: against a vehicle whose loads are known, and sigma against repeated weighings."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fifthwheel.base.errors import VehicleError
from fifthwheel.base.units import STANDARD_GRAVITY
from fifthwheel.truck import catalogue, with_axle_loads
from fifthwheel.truck.slip import Lengths, Slip, weigh
from fifthwheel.truck.weighing import exchanged_loads

TRUCK = catalogue.get("cheng_cebon_2011")
GROUPS = ("tractor.front", "tractor.drive", "semitrailer")
LENGTHS = Lengths(wheelbase=3.7, coupling=(3.1, None), trailer=(8.0, None))
LADEN = {path: load / STANDARD_GRAVITY for path, load in TRUCK.axle_loads().items()}
SOLO = {"tractor.front": 7200 * (3.7 - 1.03) / 3.7, "tractor.drive": 7200 * 1.03 / 3.7}
EMPTY = {
    path: load / STANDARD_GRAVITY
    for path, load in TRUCK.replace(
        {"semitrailer.mass": 13328.0, "semitrailer.sprung.mass": 1000.0, "semitrailer.payload.mass": 10.0}
    )
    .axle_loads()
    .items()
}
TRUE = {
    "tractor.mass": 7200,
    "tractor.cog": 1.03,
    "trailer.mass": 33450,
    "trailer.cog": 5.49,
    "payload.mass": 20122,
    "coupling": 3.1,
}


def test_exact_slips_give_the_true_masses() -> None:
    slip = Slip(laden=LADEN, solo=SOLO, empty=EMPTY)
    unknown = Lengths(wheelbase=3.7, coupling=None, trailer=(8.0, None))
    weighed = weigh(unknown, slip, GROUPS, {})
    assert {key: value for key, (value, _) in weighed.items()} == pytest.approx(TRUE)
    known = weigh(LENGTHS, slip, GROUPS, {})
    del weighed["coupling"]
    assert {key: value for key, (value, _) in known.items()} == pytest.approx({k: v for k, (v, _) in weighed.items()})


@pytest.mark.parametrize("coupling", [None, 3.1])
def test_sigma_is_the_spread_of_repeated_weighings(coupling: float | None) -> None:
    random, results = np.random.default_rng(1), []
    for _ in range(200):
        trailer = 8.0 + 0.05 * random.normal()
        lengths = Lengths(wheelbase=3.7, coupling=coupling and (coupling, None), trailer=(trailer, 0.05))
        noisy = [
            {path: load * (1 + 0.01 * random.normal()) for path, load in loads.items()}
            for loads in (LADEN, SOLO, EMPTY)
        ]
        slip = Slip(laden=noisy[0], solo=noisy[1], empty=noisy[2], accuracy=0.01)
        results.append(weigh(lengths, slip, GROUPS, {}))
    for key in results[0]:
        sigma = results[0][key][1]
        assert np.std([result[key][0] for result in results]) == pytest.approx(sigma, rel=0.15), key


def test_a_brochure_replaces_slips() -> None:
    slip = Slip(laden=LADEN)
    tares = {"tractor.mass": (7200.0, 200.0), "tractor.cog": (1.03, 0.1), "trailer.mass": (13328.0, 300.0)}
    weighed = weigh(LENGTHS, slip, GROUPS, tares)
    assert {key: value for key, (value, _) in weighed.items()} == pytest.approx(
        {k: v for k, v in TRUE.items() if k != "coupling"}
    )
    assert weighed["payload.mass"][1] == pytest.approx((weighed["trailer.mass"][1] ** 2 + 300**2) ** 0.5, rel=1e-6)
    with pytest.raises(VehicleError, match=r"solo: expected the loads of the tractor alone, .*give"):
        weigh(Lengths(wheelbase=3.7, coupling=None, trailer=(8.0, None)), slip, GROUPS, tares)


def test_the_laden_slip_gives_the_cog_of_the_tractor_where_the_kingpin_is_known() -> None:
    """With the spread of repeated weighings, brochures and tapes; it counts against what was known before."""
    random, found = np.random.default_rng(4), []
    for _ in range(300):
        loads = {path: load * (1 + 0.01 * random.normal()) for path, load in LADEN.items()}
        lengths = replace(LENGTHS, coupling=(3.1 + 0.02 * random.normal(), 0.02))
        tares = {
            "tractor.mass": (7200 + 200 * random.normal(), 200.0),
            "tractor.cog": (1.03 + 0.3 * random.normal(), 0.3),
        }
        found.append(weigh(lengths, Slip(laden=loads, accuracy=0.01), GROUPS, tares)["tractor.cog"])
    values, sigmas = np.array(found).T
    assert np.mean(values) == pytest.approx(1.03, abs=3 * np.std(values) / 300**0.5)
    assert np.std(values) == pytest.approx(np.mean(sigmas), rel=0.15)
    assert np.mean(sigmas) < 0.2


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[loaded]\na = 1", r"slip\.toml: loaded: no such key; .*laden"),
        ('[laden]\ntractor.front = "6 m"', r"laden\.tractor\.front: .*give the load as a mass"),
        ("[laden]\nsemitrailer = -1", r"laden\.semitrailer: expected a load of 500 to 40000 kg, got -1 kg; correct it"),
        ('accuracy = "good"', r"accuracy: expected '1 %' or '20 kg', got 'good'"),
        ('accuracy = "700 kg"', r"accuracy: expected 0 to 500 kg, got 700 kg"),
        ('accuracy = "80 %"', r"accuracy: expected a fraction from 0 to 0\.5"),
    ],
)
def test_slip_files(text: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "slip.toml"
    loads = 'tractor.front = "6.85 t"\ntractor.drive = 10500\nsemitrailer = "22500 kg"\n'
    path.write_text(f'accuracy = "0.5 %"\n[laden]\n{loads}')
    slip = Slip.load(path)
    assert slip == Slip(laden={"tractor.front": 6850, "tractor.drive": 10500, "semitrailer": 22500}, accuracy=0.005)
    path.write_text(f'accuracy = "+- 20 kg"\n[laden]\n{loads}')
    assert [Slip.load(path).sigma(load) for load in (6850, 22500)] == [20, 20]
    path.write_text(text)
    with pytest.raises(VehicleError, match=message):
        Slip.load(path)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        (
            {"laden": LADEN | {"semitrailer.rear": 1000.0}},
            r"laden\.semitrailer\.rear: no such axle load; .*semitrailer",
        ),
        ({"laden": {"tractor.front": 6900.0}}, r"laden\.tractor\.drive: expected a load, got none; weigh every axle"),
        ({"laden": SOLO | {"semitrailer": 5000.0}}, r"laden: expected more on tractor\.front and tractor\.drive than"),
        (
            {"laden": LADEN | {"tractor.front": 8300.0, "tractor.drive": 9300.0}},
            r"laden: expected a kingpin .* by the loads \(tractor\.front differs by \+\d+ kg .* measure the position",
        ),
    ],
)
def test_contradictions_are_refused(changed: dict[str, dict[str, float]], message: str) -> None:
    with pytest.raises(VehicleError, match=message):
        weigh(LENGTHS, Slip(**{"laden": LADEN, "solo": SOLO, **changed}), GROUPS, {})  # type: ignore[arg-type]


def test_exchanged_loads_of_a_vehicle_file() -> None:
    """Of no published vehicle; of a tractor whose CoG was computed from exchanged loads."""
    assert [name for name in catalogue.names() if exchanged_loads(catalogue.get(name))] == []
    text = exchanged_loads(TRUCK.replace({"tractor.cog": -2.67}))
    assert text.startswith(
        "tractor.cog: front and drive axle loads seem exchanged: -2.67 m means 2004 kg on tractor.front"
    )
    assert "5196 kg on tractor.drive" in text
    assert text.endswith("exchanged, the CoG is at -1.03 m; correct it")
    assert exchanged_loads(TRUCK.replace({"tractor.cog": -3.5})) == ""  # exchanged it would be impossible, too


def test_exchanged_loads_of_a_log() -> None:
    loads = TRUCK.axle_loads()
    front, drive, _ = GROUPS
    with pytest.raises(
        VehicleError, match=r"tractor\.front, tractor\.drive: front and drive axle loads seem exchanged"
    ):
        with_axle_loads(TRUCK, {**loads, front: loads[drive], drive: loads[front]})
    with pytest.raises(VehicleError, match=r"^tractor\.front: expected \d+ N from the tractor's CoG"):
        with_axle_loads(TRUCK, {**loads, front: 0.8 * loads[front]})


@settings(max_examples=60)
@given(
    st.floats(3.2, 4.2), st.floats(0.84, 1.0), st.floats(6.5e3, 9e3), st.floats(0.28, 0.48), st.floats(4e3, 14e3),
    st.sampled_from([(), ("solo",), ("laden",), ("solo", "laden")]), st.booleans(),
)  # fmt: skip
def test_exchanged_loads_of_usual_tractors(
    wheelbase: float, place: float, mass: float, fraction: float, hitch: float, wrong: tuple[str, ...], known: bool
) -> None:
    """Right loads are never called exchanged; what is refused as exchanged is what was exchanged."""
    front, drive, bogie = GROUPS
    solo = {front: (1 - fraction) * mass, drive: fraction * mass}
    laden = {front: solo[front] + (1 - place) * hitch, drive: solo[drive] + place * hitch, bogie: 2e4}
    lengths = Lengths(wheelbase=wheelbase, coupling=(place * wheelbase, None) if known else None, trailer=(7.7, None))
    loads = {"solo": solo, "laden": laden}
    for condition in wrong:
        right = loads[condition]
        loads[condition] = {**right, front: right[drive], drive: right[front]}
    try:
        weigh(lengths, Slip(**loads), GROUPS, {})
        message = ""
    except VehicleError as error:
        message = str(error)
    if wrong == ():
        assert message == ""
    elif "seem exchanged" in message:
        named = message.partition(":")[0].split(" and ")
        assert {*named} <= {*wrong}  # one of them may explain both
    elif "laden" in wrong and abs(laden[front] - laden[drive]) > 0.3 * (laden[front] + laden[drive]) and known:
        pytest.fail(f"not named: {message}")
