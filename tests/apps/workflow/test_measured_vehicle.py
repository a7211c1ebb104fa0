"""Axle loads of a log against those of the vehicle file."""

import numpy as np
import pytest

from fifthwheel.apps.workflow.measured_vehicle import axle_load_differences, weigh_by_slip, weigh_vehicle
from fifthwheel.base.errors import SignalError, VehicleError
from fifthwheel.base.units import STANDARD_GRAVITY
from fifthwheel.data.record import Record
from fifthwheel.model.simulate import simulate
from fifthwheel.truck import Vehicle, catalogue, get
from fifthwheel.truck.slip import Slip
from tests.truck.test_classes import TEXT as CLASSES_TEXT

TRUCK = get("cheng_cebon_2011")


def loaded(loads: dict[str, float]) -> Record:
    """A straight run with constant axle loads, N."""
    record = simulate(TRUCK, manoeuvre="straight", duration=5, name="run")
    return record.with_signals({f"axle_load.{group}": np.full(len(record), load) for group, load in loads.items()})


def test_only_loads_beyond_the_tolerance_are_listed():
    loads = TRUCK.axle_loads()
    plain = simulate(TRUCK, manoeuvre="straight", duration=5)
    assert axle_load_differences(TRUCK, [plain, loaded(loads)]) == []
    record = loaded(
        {**loads, "tractor.drive": 1.04 * loads["tractor.drive"], "semitrailer": 0.9 * loads["semitrailer"]}
    )
    (difference,) = axle_load_differences(TRUCK, [record])
    measured, expected = (f"{factor * loads['semitrailer'] / 1e3:.1f} kN" for factor in (0.9, 1.0))
    assert difference.startswith(f"run: axle_load.semitrailer is {measured}, the vehicle file gives {expected}; ")


def test_weights_that_are_not_axle_loads_are_named():
    """The masses follow from the axle loads alone."""
    record = loaded(TRUCK.axle_loads())
    weights = {"gross_weight": 4e5, "weight.semitrailer": 3e5, "axle_load.tractor": 1.7e5}
    more = record.with_signals({name: np.full(len(record), value) for name, value in weights.items()})
    weighed = weigh_vehicle(more, TRUCK.to_toml())
    assert set(weighed.unused) == weights.keys()
    assert weighed.vehicle == weigh_vehicle(record, TRUCK.to_toml()).vehicle
    assert weigh_vehicle(record, TRUCK.to_toml()).unused == ()
    alone = {name: values for name, values in more.signals.items() if not name.startswith("axle_load")}
    with pytest.raises(SignalError, match=r"only gross_weight, weight\.semitrailer; `fifthwheel mass` uses"):
        weigh_vehicle(Record(time=more.time, signals=alone, name="run"), TRUCK.to_toml())


SLIP = {group: load / STANDARD_GRAVITY for group, load in TRUCK.axle_loads().items()}
PAYLOAD = "semitrailer.payload.mass"
SOLO = {"tractor.front": 7200 * (3.7 - 1.03) / 3.7, "tractor.drive": 7200 * 1.03 / 3.7}


def test_a_slip_gives_masses_and_their_uncertainty():
    heavier = TRUCK.replace({"semitrailer.mass": 30000.0, "semitrailer.payload.mass": 16672.0, "semitrailer.cog": -5.3})
    laden = {group: load / STANDARD_GRAVITY for group, load in heavier.axle_loads().items()}
    text = catalogue.text("cheng_cebon_2011")
    weighed = weigh_by_slip(Slip(laden=laden, solo=SOLO, accuracy=0.005), text, name="slip of May")
    assert weighed.vehicle.parameters() == pytest.approx(heavier.parameters(), rel=1e-3)
    assert weighed.vehicle.axle_loads() == pytest.approx(heavier.axle_loads(), rel=1e-3)
    assert weighed.vehicle.stated.keys() == {
        "tractor.mass", "tractor.cog", "semitrailer.mass", "semitrailer.cog", "semitrailer.payload.mass"
    }  # fmt: skip
    assert weighed.vehicle.stated["tractor.mass"] == 28
    assert weighed.vehicle.source.endswith("; weighed by slip of May")
    assert "published, (11)" in weighed.text
    assert weighed.vehicle == Vehicle.loads(weighed.text)


def test_a_stated_mass_is_joined_with_that_of_the_slip():
    """It is never known less after the slip; another load replaces that of the file, another tractor is refused."""
    slip = Slip(laden=SLIP, solo=SOLO)
    for sigma in (10.0, 55.0, 2000.0):
        stated = TRUCK.with_stated({"tractor.mass": sigma, "semitrailer.mass": 4 * sigma})
        by_slip, joined = (weigh_by_slip(slip, truck.to_toml()).vehicle.stated for truck in (TRUCK, stated))
        for path in ("tractor.mass", "semitrailer.mass"):
            expected = (by_slip[path] ** -2 + stated.stated[path] ** -2) ** -0.5
            assert joined[path] == pytest.approx(expected, rel=0.02)
    again = weigh_by_slip(slip, weigh_by_slip(slip, TRUCK.to_toml()).text).vehicle
    assert again.stated == by_slip
    other = stated.replace({path: TRUCK.parameters()[path] + 6e3 for path in ("semitrailer.mass", PAYLOAD)})
    other = other.with_stated({"semitrailer.mass": 100.0})
    assert weigh_by_slip(slip, other.to_toml()).vehicle.unit("semitrailer").mass == pytest.approx(33450, rel=1e-3)
    other = stated.replace({"tractor.mass": 8000.0}).with_stated({"tractor.mass": 50.0})
    with pytest.raises(VehicleError, match=r"tractor\.mass: the file states 8000 \+- 50, slip gives 7200 \+- 5"):
        weigh_by_slip(slip, other.to_toml())


def test_the_stated_sigma_of_the_trailers_axles_reaches_its_cog():
    axles = [f"semitrailer.{axle.name}.position" for axle in TRUCK.unit("semitrailer").axles]
    sure, unsure = (
        weigh_by_slip(Slip(laden=SLIP, solo=SOLO), TRUCK.with_stated(dict.fromkeys(axles, sigma)).to_toml()).vehicle
        for sigma in (0.01, 0.3)
    )
    # the CoG lies at 0.6 to 0.8 of the length behind the kingpin
    assert unsure.stated["semitrailer.cog"] == pytest.approx(0.3 * 0.7, rel=0.15)
    assert sure.stated["semitrailer.cog"] < 0.1


def test_a_slip_rescales_what_the_classes_give():
    lighter = Vehicle.loads(CLASSES_TEXT.replace("33.45 t", "30 t"))
    laden = {group: load / STANDARD_GRAVITY for group, load in lighter.axle_loads().items()}
    weighed = weigh_by_slip(Slip(laden=laden), CLASSES_TEXT.replace('mass = "20 t +- 300 kg"', "")).vehicle
    assert weighed.parameters()["semitrailer.yaw_inertia"] == pytest.approx(
        lighter.parameters()["semitrailer.yaw_inertia"], rel=1e-3
    )
    assert "semitrailer.cog" not in weighed.assumed
    assert "tractor.cog" not in weighed.assumed  # the laden loads give it
    assert weighed.parameters()["semitrailer.payload.mass"] == pytest.approx(30000 - 7500, rel=1e-3)


def test_an_unladen_trailer_takes_the_change_in_its_body():
    empty = get("auburn_6x4_unladen")
    laden = {group: 1.01 * load / STANDARD_GRAVITY for group, load in empty.axle_loads().items()}
    weighed = weigh_by_slip(Slip(laden=laden, accuracy=0.02), catalogue.text("auburn_6x4_unladen")).vehicle
    change = weighed.unit("semitrailer").mass - empty.unit("semitrailer").mass
    assert change > 0
    assert weighed.unit("semitrailer").sprung.mass == pytest.approx(empty.unit("semitrailer").sprung.mass + change)


def test_slips_that_do_not_fit_are_refused():
    text = catalogue.text("cheng_cebon_2011")
    with pytest.raises(VehicleError, match=r"payload\.mass: expected above 0 kg, got -\d+ kg from slip; check it"):
        weigh_by_slip(Slip(laden={"tractor.front": 5700, "tractor.drive": 4500, "semitrailer": 7000}), text)
    single = Vehicle(name="truck", units=TRUCK.units[:1]).to_toml()
    with pytest.raises(VehicleError, match="expected a tractor with two axle groups and a trailer with one"):
        weigh_by_slip(Slip(laden=SLIP), single)
