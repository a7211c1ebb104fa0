"""A vehicle file from a brochure and slips: complete, with sources, and right where the brochure is."""

import re
import tomllib

import pytest

from fifthwheel.apps.workflow.new_vehicle import QUESTIONS, new_vehicle
from fifthwheel.base.errors import VehicleError
from fifthwheel.base.options import TruckOptions
from fifthwheel.base.units import STANDARD_GRAVITY
from fifthwheel.truck import Vehicle, changes
from tests.truck.test_slip import LADEN, SOLO, TRUCK

ANSWERS = {
    "tractor": "tractor_4x2",
    "trailer": "semitrailer_3",
    "wheelbase": "3.7 m +- 1 cm",
    "trailer_wheelbase": "8 m",
    "trailer_spread": "1.3 m",
    "laden": " ".join(f"{load:.1f}" for load in LADEN.values()),
    "solo": ", ".join(f"{load:.1f}kg" for load in SOLO.values()),
    "trailer_tare": "13328 kg",
    "load_height": "1.23 m +- 5 cm",
}


def written(**changed: str | None) -> str:
    answers = {key: answer for key, answer in {**ANSWERS, **changed}.items() if answer is not None}
    return new_vehicle(answers)


def test_the_article_truck_weighed() -> None:
    vehicle, truth = Vehicle.loads(written()), TRUCK.parameters()
    values = vehicle.parameters()
    assert values.keys() == truth.keys()
    for path, value in values.items():
        if path not in vehicle.assumed and not path.endswith("yaw_product"):
            assert value == pytest.approx(truth[path], rel=0.005, abs=0.005), path
        else:
            assert abs(value - truth[path]) <= 3.5 * vehicle.stated.get(path, 3000), (
                path
            )  # the trailer's frame is heavy
    assert vehicle.axle_loads() == pytest.approx({k: v * STANDARD_GRAVITY for k, v in LADEN.items()}, rel=0.003)
    assert vehicle.stated["semitrailer.payload.height"] == 0.05
    assert vehicle.stated["semitrailer.payload.mass"] == pytest.approx((270**2 + (0.03 * 13328) ** 2) ** 0.5, rel=0.02)


def test_every_number_has_a_source_behind_it() -> None:
    keys = {path.rpartition(".")[2] for path in Vehicle.loads(written()).parameters()}
    numbers = [line for line in written().splitlines() if line.removeprefix("# ").partition(" = ")[0] in keys]
    assert len(numbers) > 30
    for line in numbers:
        assert line.count("#") >= 1 + (line[0] == "#"), line


def test_assumed_numbers_are_comments_that_a_measurement_replaces() -> None:
    text = written()
    assert '\n# yaw_inertia = "' in text
    measured = text.replace('\n# yaw_inertia = "', '\nyaw_inertia = "1e5 kg m^2"  # "', 1)
    assert "tractor.yaw_inertia" not in Vehicle.loads(measured).assumed
    every = re.sub(r'^# (\w+ = ")', r"\1", text, flags=re.MULTILINE)
    complete, loaded = Vehicle.loads(every), Vehicle.loads(text)
    assert not complete.assumed
    assert complete.parameters() == pytest.approx(loaded.parameters(), rel=0.06)  # rounded to two digits of sigma
    assert complete.stated == pytest.approx(loaded.stated, rel=0.06)


def test_a_brochure_alone() -> None:
    nothing = dict.fromkeys(("laden", "solo", "load_height"))
    with pytest.raises(VehicleError, match=r"fifth_wheel: expected its distance from the front axle, got none"):
        written(**nothing)
    with pytest.raises(VehicleError, match=r"load_mass: expected a mass, got none; give it or the laden slip"):
        written(**nothing, fifth_wheel="3.1 m")
    laden = Vehicle.loads(written(**nothing, fifth_wheel="3.1 m", load_mass="20 t +- 300 kg", tractor_tare="7.2 t"))
    assert laden.unit("semitrailer").mass == 33330  # rounded to two digits of sigma
    assert laden.unit("tractor").mass == 7200
    unladen = Vehicle.loads(written(**nothing, fifth_wheel="3.1 m", load_mass="0"))
    assert unladen.unit("semitrailer").payload is None
    assert unladen.unit("semitrailer").mass == 13330
    assert "tractor.mass" in unladen.assumed


def test_three_axle_tractors_and_twin_tyres() -> None:
    text = written(
        tractor="tractor_6x4",
        trailer="semitrailer_2_steered",
        wheelbase="3.025 m",
        trailer_tyres="twin",
        load_shape="point",
    )
    vehicle = Vehicle.loads(text)
    assert [axle.position for axle in vehicle.units[0].axles] == [0, -3.025, -4.375]
    assert vehicle.steer_signals() == ("steer.tractor.front", "steer.semitrailer.rear")
    group = tomllib.loads(text)["unit"][1]["axle_group"][0]
    assert group["tyre_roll_stiffness"] == "7000 kN m/rad +- 1100 kN m/rad"
    assert vehicle.tyres() == {"tractor.front": 2, "tractor.drive": 8, "semitrailer": 8}
    assert vehicle.units[1].payload.shape == "point"  # type: ignore[union-attr]


def test_a_solo_slip_alone_gives_mass_and_cog_of_the_tractor() -> None:
    unladen = {"laden": None, "fifth_wheel": "3.1 m", "load_mass": "20 t"}
    alone, with_laden = Vehicle.loads(written(**unladen)), Vehicle.loads(written())
    for path in ("tractor.mass", "tractor.cog"):
        assert alone.parameters()[path] == pytest.approx(with_laden.parameters()[path], rel=1e-3)
        assert alone.stated[path] == pytest.approx(with_laden.stated[path], rel=0.1)
        assert path not in alone.assumed
    with pytest.raises(VehicleError, match=r"^solo: front and drive axle loads seem exchanged; write 5200 kg for"):
        written(**unladen, solo="2000 5200")


ERRORS = (
    ({"tractor": "lorry"}, r"tractor: no such choice 'lorry'; "),
    ({"wheelbase": "3.7 kg"}, r"wheelbase: .*"),
    ({"wheelbase": "-3.7 m"}, r"wheelbase: expected 2 to 8 m, got -3\.7 m; check the number and its unit"),
    ({"wheelbase": "3600"}, r"wheelbase: expected a number with a unit such as '1 m', got '3600'; add its unit"),
    ({"wheelbase": "3600 m"}, r"wheelbase: expected 2 to 8 m, got 3600 m; "),
    ({"wheelbase": "36m"}, r"wheelbase: expected 2 to 8 m, got 36m; "),
    ({"wheelbase": "3,7m"}, r"wheelbase: expected a decimal point, and no separator of thousands, got '3,7m'"),
    ({"load_height": "1.5"}, r"load_height: expected a number with a unit"),
    ({"trailer_tare": "6900 +- 100"}, r"trailer_tare: expected a number with a unit"),
    ({"trailer_tare": "6.9 kg"}, r"trailer_tare: expected 1500 to 25000 kg, got 6\.9 kg; "),
    ({"laden": "6900 11200 215000"}, r"laden\.semitrailer: expected a load of 500 to 40000 kg, got 215000 kg; "),
    ({"laden": "6,900 11,200 21,500"}, r"laden: expected a decimal point, and no separator of thousands, got '6,9"),
    (
        {"solo": "1990 5200"},
        r"solo: front and drive axle loads seem exchanged; write 5200 kg for tractor\.front and 1990 kg for"
        r" tractor\.drive\. As stated, 72% of the tractor's mass are on tractor\.drive \(expected: at most 55%\);"
        r" exchanged, 28% of [^;]*$",
    ),
    (
        {"laden": "11200 6900 21500"},
        r"laden: front and drive axle loads seem exchanged; write 6900 kg for tractor\.front and 11200 kg for"
        r" tractor\.drive\. As stated, the kingpin is 1\.66 m behind the front axle \(expected: 2\.22 to 4\.44 m\);"
        r" exchanged,"
        r" the kingpin is 3\.12 m",
    ),
    (
        {"laden": "11200 6900 21500", "solo": "1990 5200"},
        r"solo and laden: front and drive axle loads seem exchanged; exchange them in each\. As stated, ",
    ),
    (
        {"laden": "11200 6900 21500", "solo": None, "fifth_wheel": "3.1 m", "tractor_tare": "7.2 t"},
        r"laden: front and drive .*, the kingpin is 1\.\d\d m .* \(expected: 3\.10 m\); exchanged, .* 3\.\d\d m",
    ),
    ({"laden": "9000 7500 21500"}, r"laden: expected a kingpin 2\.22 to 4\.44 m behind the front axle, got 2\.19"),
    ({"solo": None}, r"solo: .* is not known; give them \(solo\), or the distance .* \(fifth_wheel\)"),
    (
        {"trailer_tare": "6.9 t", "load_mass": "20 t"},
        r"load_mass: expected 26\d\d\d kg, because the trailer has 33\d\d\d kg by the laden slip and 6900 kg"
        r" without load by trailer_tare, got 20000 kg; correct one of the three",
    ),
    (
        {"empty": "5450 5600 9480", "load_mass": "25 t", "trailer_tare": None},
        r"load_mass: expected 20\d\d\d kg, .* kg without load by the empty slip, got 25000 kg",
    ),
    ({"solo": "1990 5200", "fifth_wheel": "3.1 m"}, r"solo: front and drive axle loads seem exchanged"),
    ({"solo": "2600 4500", "laden": "2800 12500 21500"}, r"solo: expected less on tractor\.drive than on "),
    ({"load_mass": "0", "load_height": None}, r"load_mass: expected 20\d\d\d kg, because .*, got 0 kg"),
    ({"solo": "5,300 kg"}, r"solo: expected a decimal point, and no separator of thousands"),
    ({"wheelbase": None}, r"wheelbase: expected a value, got none; give wheelbase"),
    ({"tractor_tare": "7.2 t"}, "tractor_tare: has no use, because solo gives it; remove it"),
    ({"empty": "5450 5600 9480"}, "trailer_tare: has no use, because empty gives it; remove it"),
    ({"laden": None, "empty": "5450 5600 9480"}, "empty: has no use, because there are no laden loads; remove it"),
    ({"load_mass": "0"}, "load_height: has no use, because load_mass is 0; remove it"),
    ({"tractor_spread": "1.3 m"}, "tractor_spread: has no use, because tractor_4x2 has one axle there; remove it"),
    ({"solo": "5200"}, r"solo: expected 2 loads, of tractor\.front, tractor\.drive, got '5200'; give them in kg"),
    ({"trailer_tare": "24.9 t", "laden": "6000 7000 11000"}, r"payload\.mass: expected above 0 kg, got -\d+ kg"),
)


def test_errors_name_the_answer_and_the_cure() -> None:
    for changed, message in ERRORS:
        with pytest.raises(VehicleError, match=message):
            written(**changed)


def test_a_slip_file_and_loads_or_an_accuracy_are_not_both_given(tmp_path) -> None:
    path = tmp_path / "slip.toml"
    path.write_text("[laden]\n" + "\n".join(f"{key} = {load}" for key, load in LADEN.items()))
    others = {key: answer for key, answer in ANSWERS.items() if key not in ("laden", "solo")}
    for answers, more, message in (
        (ANSWERS, {"slip": path}, r"laden: given, and .*slip\.toml too; keep one"),
        (others, {"slip": path, "accuracy": "1 %"}, r"accuracy: given, and .*slip\.toml too; keep one"),
        (others, {"accuracy": "1 %"}, r"accuracy: expected loads too, got none; give laden"),
    ):
        with pytest.raises(VehicleError, match=message):
            new_vehicle(answers, **more)
    loads = Vehicle.loads(new_vehicle({**others, "fifth_wheel": "3.1 m"}, slip=path)).axle_loads()
    assert loads == pytest.approx({group: load * STANDARD_GRAVITY for group, load in LADEN.items()}, rel=0.01)


def test_a_stated_length_gives_the_positions_their_sigma() -> None:
    """The axles of a group share the error of the length; that of a stated spread adds."""
    of_trailer = [f"semitrailer.{axle}.position" for axle in ("front", "middle", "rear")]
    vehicle = Vehicle.loads(written(trailer_wheelbase="8000 mm +- 1 cm"))
    assert [vehicle.stated[path] for path in of_trailer] == [0.01, 0.01, 0.01]
    (shared,) = [c for c in changes(vehicle) if c.name == "semitrailer.axle_positions"]
    assert shared.slopes == dict.fromkeys(of_trailer, 0.01)
    vehicle = Vehicle.loads(written(trailer_wheelbase="8 m +- 3 cm", trailer_spread="1.3 m +- 4 cm"))
    assert [vehicle.stated[path] for path in of_trailer] == pytest.approx([0.05, 0.03, 0.05])
    vehicle = Vehicle.loads(written(trailer_spread="1.3 m +- 4 cm"))
    assert [vehicle.stated[path] for path in of_trailer] == pytest.approx([0.05, 0.03, 0.05])
    three = {"tractor": "tractor_6x4", "wheelbase": "3.025 m +- 1 cm"}
    vehicle = Vehicle.loads(written(**three))
    assert [vehicle.stated[f"tractor.drive_{k}.position"] for k in (1, 2)] == [0.01, 0.01]
    assert not any(path.endswith(".position") for path in Vehicle.loads(written(wheelbase="3.7 m")).stated)


STATED = {
    "wheelbase": "3.7 m +- 2 cm",
    "fifth_wheel": "3.1 m +- 2 cm",
    "fifth_wheel_height": "1.1 m +- 2 cm",
    "trailer_wheelbase": "8 m +- 2 cm",
    "trailer_spread": "1.3 m +- 2 cm",
    "tractor_tare": "7.2 t +- 1 %",
    "trailer_tare": "13 t +- 1 %",
    "load_mass": "20.2 t +- 1 %",
    "load_height": "1.2 m +- 2 cm",
    "load_width": "2.4 m +- 2 cm",
    "floor_height": "1.2 m +- 2 cm",
    "tractor_spread": "1.3 m +- 2 cm",
}


WEIGHINGS = {
    "none": dict.fromkeys(("laden", "solo")) | {"fifth_wheel": "3.1 m", "load_mass": "20.2 t"},
    "laden": {"solo": None, "fifth_wheel": "3.1 m"},
    "solo": {},
    "solo alone": {"laden": None, "fifth_wheel": "3.1 m", "load_mass": "20.2 t"},
    "empty": {"empty": "5450 5600 9480", "trailer_tare": None},
}


@pytest.mark.parametrize("weighing", WEIGHINGS)
def test_every_stated_sigma_changes_the_file_or_is_refused(weighing: str) -> None:
    for key in (question.key for question in QUESTIONS if question.unit):
        base = {**WEIGHINGS[weighing], "load_height": None, "tractor": "tractor_4x2"}
        if key == "tractor_spread":
            base |= {"tractor": "tractor_6x4", "wheelbase": "3.1 m"}
        value, _, sigma = STATED[key].partition(" +- ")
        try:
            alone = written(**{**base, key: f"{value} +- 5 {sigma.split()[1]}"})
        except VehicleError as error:
            assert str(error).startswith(f"{key}: has no use, because ")  # noqa: PT017
        else:
            assert written(**{**base, key: STATED[key]}) != alone, key


def test_every_question_is_an_option_of_the_front_ends() -> None:
    assert {question.key for question in QUESTIONS} == TruckOptions.__dataclass_fields__.keys()
