"""MATLAB files: written by scipy and h5py, and by hand what neither writes."""

import struct
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.io import savemat

from fifthwheel.base.errors import SignalError
from fifthwheel.data.logs.readers import mat
from fifthwheel.data.logs.readers import open_log as open_isolated_log
from fifthwheel.data.logs.readers.mat import open_log
from tests.data.logs.readers.reading import read

T = np.arange(50) / 10


def structs(*items: dict[str, Any]) -> NDArray[Any]:
    """A struct array of MATLAB."""
    array = np.zeros((1, len(items)), dtype=[(name, "O") for name in items[0]])
    for k, item in enumerate(items):
        array[0, k] = tuple(item.values())
    return array


def save5(path: Path, variables: dict[str, Any]) -> Path:
    savemat(path, variables, do_compression=path.stem.endswith("z"))
    return path


def save7(path: Path, variables: dict[str, Any]) -> Path:
    """As MATLAB writes version 7.3: transposed, structs as groups, struct arrays as lists of references."""
    with h5py.File(path, "w", userblock_size=512) as file:
        refs = file.create_group("#refs#")
        for name, value in variables.items():
            put(file, refs, name, value)
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file, Platform: TEST".ljust(124) + b"\0\2IM")
    return path


def put(group: Any, refs: Any, name: str, value: Any) -> Any:
    if isinstance(value, np.ndarray) and value.dtype.names and value.size == 1:
        value = dict(zip(value.dtype.names, value.ravel()[0], strict=True))
    if isinstance(value, dict):
        item = group.create_group(name)
        for field, part in value.items():
            put(item, refs, field, part)
        kind = "struct"
    elif isinstance(value, np.ndarray) and value.dtype.names:
        item = group.create_group(name)
        for field in value.dtype.names:
            places = [put(refs, refs, f"{len(refs)}", one[field]).ref for k, one in enumerate(value.ravel())]
            item.create_dataset(field, data=np.array(places, dtype=h5py.ref_dtype).reshape(-1, 1))
        kind = "struct"
    elif isinstance(value, str):
        item = group.create_dataset(name, data=np.array([[ord(c)] for c in value], dtype="u2"))
        kind = "char"
    else:
        array = np.atleast_2d(np.asarray(value))
        item = group.create_dataset(name, data=array.astype("u1" if array.dtype == bool else array.dtype).T)
        kind = "double"
    item.attrs["MATLAB_class"] = np.bytes_(kind)
    return item


@pytest.fixture(params=["old", "oldz", "new"])
def save(request: pytest.FixtureRequest, tmp_path: Path) -> Any:
    """Saves variables in version 5, the same compressed, or 7.3."""
    writer = save7 if request.param == "new" else save5
    return lambda variables: writer(tmp_path / f"{request.param}.mat", variables)


def test_vectors_beside_a_time(save: Any) -> None:
    M = np.arange(150.0).reshape(50, 3)
    variables = {"t": T, "speed": T * 2, "braking": T > 1, "gear": np.arange(50, dtype="i2").reshape(-1, 1)}
    variables |= {"mass": 40000.0, "M": M, "wide": np.arange(150.0).reshape(3, 50), "other": np.arange(7.0)}
    with open_log(save(variables | {"remark": "abc"})) as log:
        matrices = {f"{m}({k})" for m in ("M", "wide") for k in (1, 2, 3)}
        assert set(log.columns) == {"speed", "braking", "gear", *matrices}
        found = read(log)
        for name, expected in {"speed": T * 2, "braking": T > 1, "gear": np.arange(50), "M(2)": M[:, 1]}.items():
            np.testing.assert_array_equal(found[name][1], expected)
            np.testing.assert_array_equal(found[name][0], T)
        np.testing.assert_array_equal(found["wide(3)"][1], np.arange(100, 150))
        assert log.notes == ["1 vectors left out, no time of their length: other"]
        with pytest.raises(SignalError, match="no column 'sped'"):
            list(log.chunks(["sped"]))


def test_structs(save: Any) -> None:
    inner = {"rate": T * 3, "acc": T}
    imu = {"time": T, "yaw": inner, "x": T + 1, "units": {"x": "m"}}
    gps = {"t": T[:9], "data": T[:9] * 2, "unit": "deg/s"}
    with open_log(save({"imu": imu, "gps": gps})) as log:
        columns = {name: (column.unit, column.clock) for name, column in log.columns.items()}
        assert columns == {
            "imu.yaw.rate": (None, "imu"),
            "imu.yaw.acc": (None, "imu"),
            "imu.x": ("m", "imu"),
            "gps": ("deg/s", "gps"),
        }
        found = read(log)
        np.testing.assert_array_equal(found["imu.yaw.rate"], [T, T * 3])
        np.testing.assert_array_equal(found["gps"], [T[:9], T[:9] * 2])


def test_structures_of_simulink_and_dspace(save: Any) -> None:
    """And an array of signals. A name that occurs twice has the place in it."""
    both = np.stack([T, -T], axis=1)
    signals = structs(
        {"values": T.reshape(-1, 1), "dimensions": 1.0, "label": "yaw"},
        {"values": both, "dimensions": 2.0, "label": "pos"},
    )
    with open_log(save({"simout": {"time": T.reshape(-1, 1), "signals": signals, "blockName": "m/out"}})) as log:
        assert list(log.columns) == ["simout.yaw", "simout.pos(1)", "simout.pos(2)"]
        np.testing.assert_array_equal(read(log)["simout.pos(2)"], [T, -T])
    x = structs({"Name": "time", "Data": T, "Raster": "10ms"}, {"Name": "time", "Data": T[:20] + 1, "Raster": "1ms"})
    y = structs(
        {"Name": "Model Root/yaw", "Data": T * 2, "Unit": "rad/s", "XIndex": 1.0},
        {"Name": "Model Root/v", "Data": T[:20] * 3, "Unit": "m/s", "XIndex": 2.0},
    )
    with open_log(save({"rec001": {"X": x, "Y": y, "Description": {"General": "none"}}})) as log:
        assert {n: c.unit for n, c in log.columns.items()} == {"Model Root/yaw": "rad/s", "Model Root/v": "m/s"}
        np.testing.assert_array_equal(read(log)["Model Root/v"], [T[:20] + 1, T[:20] * 3])
    items = [{"name": name, "time": T, "data": T * k, "unit": "rad"} for k, name in enumerate(("a", "b"))]
    with open_log(save({"s": structs(*items)})) as log:
        assert {n: c.unit for n, c in log.columns.items()} == {"s.a": "rad", "s.b": "rad"}
        np.testing.assert_array_equal(read(log)["s.b"][1], T)
    y = structs(*({"Name": "v", "Data": T * k, "Unit": "m"} for k in (1, 2)))
    with open_log(save({name: {"X": {"Data": T}, "Y": y} for name in ("r1", "r2")})) as log:
        assert sorted(log.columns) == ["v@r1.X", "v@r1.X'", "v@r2.X", "v@r2.X'"]


def test_times(save: Any) -> None:
    """Several; days, which become seconds."""
    with open_log(save({"time": T, "a": T, "time_gps": T[:9], "speed_gps": T[:9], "t_oil": T * 0})) as log:
        clocks = {name: column.clock for name, column in log.columns.items()}
        assert clocks == {"a": "time", "speed_gps": "time_gps", "t_oil": "time"}
    days = 719529 + 10 + T / 86400
    with open_log(save({"time": days, "a": T, "s": {"time": T + 700000, "a": T}})) as log:
        np.testing.assert_allclose(read(log)["a"][0], 864000 + T, atol=2e-5)
        np.testing.assert_array_equal(read(log)["s.a"][0], T + 700000)


def test_no_time(save: Any) -> None:
    with pytest.raises(
        SignalError, match=r"no time vector: 2 vectors of 50 values \(a, b\).*save a vector named 'time'"
    ):
        open_log(save({"a": T, "b": T}))
    with pytest.raises(SignalError, match="no vectors of numbers"):
        open_log(save({"a": 1.0}))


def opaque(name: str, kind: str) -> bytes:
    """A variable of MATLAB's newer objects, in version 5."""

    def element(code: int, data: bytes) -> bytes:
        return struct.pack("<II", code, len(data)) + data + bytes(-len(data) % 8)

    inner = element(6, struct.pack("<II", 13, 0)) + element(5, struct.pack("<ii", 1, 1)) + element(1, b"")
    inner = element(14, inner + element(6, struct.pack("<I", 0)))
    flags = element(6, struct.pack("<II", 17, 0))
    return element(14, flags + b"".join(element(1, text.encode()) for text in (name, "MCOS", kind)) + inner)


def test_objects_complex_numbers_and_text_are_left_out(tmp_path: Path) -> None:
    cells = np.array([["a", T]], dtype=object)
    old = save5(tmp_path / "a.mat", {"t": T, "a": T, "c": T + 1j, "x": cells, "f": np.array(["ab", "cd"])})
    with old.open("ab") as file:
        file.write(opaque("run", "timeseries"))
    new = save7(tmp_path / "b.mat", {"t": T, "a": T, "run": np.arange(6)})
    with h5py.File(new, "r+") as file:
        file["run"].attrs["MATLAB_class"] = np.bytes_("timetable")
        file["run"].attrs["MATLAB_object_decode"] = 3
    for path, columns in ((old, ["a", "x(2)"]), (new, ["a"])):
        with open_log(path) as log:
            assert list(log.columns) == columns
            assert log.notes[0].startswith("1 objects left out, only MATLAB reads them; save them as structs")
    old.write_bytes(old.read_bytes()[:128] + opaque("run", "timetable"))
    with pytest.raises(SignalError, match=r"1 objects that only MATLAB reads: run \(timetable\); save them as structs"):
        open_log(old)


def test_chunks_are_bounded(save: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mat, "_CHUNK_ROWS", 20)
    with open_log(save({"t": np.r_[T[:-1], T[-2]], "a": T})) as log:
        chunks = list(log.chunks(["a"]))
        assert [chunk.values["a"].size for chunk in chunks] == [20, 20, 9]
        assert [chunk.done for chunk in chunks] == [0.4, 0.8, 1.0]
        assert log.notes == ["1 sample of 't' left out: timestamps must increase"]


def test_a_vector_that_is_a_little_shorter_than_its_time(save: Any) -> None:
    variables = {"t": T, "a": T[:-6] * 2, "M": np.stack([T[1:], -T[1:]], axis=1), "b": T[:40], "s": {"x": T[:-1]}}
    with open_log(save(variables)) as log:
        found = read(log)
        assert set(found) == {"a", "M(1)", "M(2)", "s.x"}
        for name, values in {"a": T[:-6] * 2, "M(2)": -T[1:], "s.x": T[:-1]}.items():
            np.testing.assert_array_equal(found[name][0], T)
            np.testing.assert_array_equal(found[name][1], np.r_[values, np.full(50 - values.size, np.nan)])
        assert sorted(note.partition(":")[0] for note in log.notes) == [
            "1 vectors left out, no time of their length",
            "3 vectors are up to 6 samples shorter than their time vector, the last samples set to NaN",
        ]


def test_version_4(tmp_path: Path) -> None:
    """With the order of bytes of other machines; cut short."""
    path = tmp_path / "a.mat"
    arrays = {b"t\0": T.astype(">f8"), b"a\0": T.astype(">f4"), b"x\0": (2 * T).astype(">f8")}
    heads = [struct.pack(">5i", {8: 1000, 4: 1010}[a.itemsize], a.size, 1, 0, 2) for a in arrays.values()]
    path.write_bytes(b"".join(head + n + a.tobytes() for head, (n, a) in zip(heads, arrays.items(), strict=True)))
    other = tmp_path / "b.mat"
    savemat(other, {"t": T, "a": T.astype("f4"), "x": 2 * T, "name": "run"}, format="4")
    for written in (path, other):
        with open_isolated_log(written) as log:
            found = read(log)
            assert list(log.columns) == ["a", "x"]
            np.testing.assert_allclose(found["a"], [T, T], atol=1e-6)
            np.testing.assert_array_equal(found["x"], [T, 2 * T])
            assert not log.notes
        written.write_bytes(written.read_bytes()[:700])
        with open_isolated_log(written) as log:
            assert list(log.columns) == ["a"]
            assert log.notes[0].startswith("broken after 2 variables, at byte ")


def test_cut_short_or_damaged(tmp_path: Path) -> None:
    path = save5(tmp_path / "a.mat", {"t": T, "a": T, "b": T})
    path.write_bytes(path.read_bytes()[:-50])
    with open_log(path) as log:
        assert list(log.columns) == ["a"]
        assert log.notes[0].startswith("broken after 2 variables, at byte ")
    path = save7(tmp_path / "b.mat", {"t": T, "a": T})
    path.write_bytes(path.read_bytes()[:-50])
    error = r"b\.mat: cannot be read as MATLAB \(OSError: .*truncated file.*copy it again"
    with pytest.raises(SignalError, match=error):
        open_isolated_log(path)
    path = save5(tmp_path / "az.mat", {"t": T, "a": T, "b": T})
    data = bytearray(path.read_bytes())
    length = struct.unpack("<I", data[132:136])[0]
    data[136 + length + 30] ^= 0xFF  # within the second of three
    path.write_bytes(data)
    with open_isolated_log(path) as log:
        np.testing.assert_array_equal(read(log)["b"], [T, T])
        assert log.notes[0].startswith("broken: 1 variables cannot be read, the first at byte ")


def test_no_other_file_is_read(tmp_path: Path) -> None:
    (tmp_path / "secret").write_bytes(T.tobytes())
    with h5py.File(tmp_path / "other.h5", "w") as other:
        other["y"] = T
    layout = h5py.VirtualLayout(shape=(50,), dtype="f8")
    layout[:] = h5py.VirtualSource(tmp_path / "other.h5", "y", shape=(50,))
    with h5py.File(tmp_path / "a.mat", "w") as file:
        file["t"], file["a"] = T, T
        file.create_dataset("external", (50,), "f8", external=[(str(tmp_path / "secret"), 0, 400)])
        file.create_virtual_dataset("virtual", layout)
        file["link"] = h5py.ExternalLink(tmp_path / "other.h5", "y")
        file["other"], file["soft"] = h5py.ExternalLink(tmp_path / "other.h5", "/"), h5py.SoftLink("/other/y")
        assert all((file[name][()] == T).all() for name in ("external", "virtual", "link", "soft"))
    with open_log(tmp_path / "a.mat") as log:
        assert list(log.columns) == ["a"]
        assert log.notes == ["4 variables left out, their data is in other files: external, link, other, virtual"]


def test_objects_that_contain_themselves_end(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.mat", "w") as file:
        file["t"], file["a"] = T, T
        file["s/x"] = T
        for name in ("p", "q", "r"):
            file[f"s/{name}"] = file["s"]  # hard links
        cell = file.create_dataset("cell", (9,), dtype=h5py.ref_dtype)
        cell[:] = [cell.ref] * 9
        one, two = (file.create_dataset(name, (9,), dtype=h5py.ref_dtype) for name in ("one", "two"))
        one[:], two[:] = [two.ref] * 9, [one.ref] * 8 + [file["a"].ref]
    with open_isolated_log(tmp_path / "a.mat") as log:
        found = read(log)
        assert {"a", "s.x"} <= set(found)
        assert len(found) < 100
