"""The origin of a result."""

import hashlib
import json
from pathlib import Path

import pytest

from fifthwheel.base.atomic import result_folder
from fifthwheel.base.errors import FifthwheelError
from fifthwheel.base.pages.html import blocks
from fifthwheel.results.report.provenance import Provenance, gather_provenance, provenance_of_run, verify
from fifthwheel.truck import catalogue


def test_files_have_size_and_hash(tmp_path):
    log = tmp_path / "a log.csv"
    log.write_bytes(b"time,speed\n" * 200_000)
    folder = tmp_path / "bag"
    folder.mkdir()
    (folder / "part 0").write_bytes(b"x")
    origin = gather_provenance([log, folder, tmp_path / "missing"])
    assert [file.path for file in origin.files] == [str(log), str(folder / "part 0")]
    assert origin.files[0].size == log.stat().st_size
    assert origin.files[0].sha256 == hashlib.sha256(log.read_bytes()).hexdigest()


def test_the_command_is_quoted_for_a_shell(tmp_path):
    signals = tmp_path / "signals.toml"
    signals.write_text('[signals]\nspeed = "v <m/s>"\n')
    origin = provenance_of_run([], "cheng_cebon_2011", signals, None, command=["identify", "a log.csv", "-o", "out"])
    assert origin.command == "fifthwheel identify 'a log.csv' -o out"
    assert list(origin.texts.values()) == [catalogue.text("cheng_cebon_2011"), signals.read_text()]
    assert origin.time.endswith(" UTC")
    assert {"fifthwheel", "Python", "numpy", "casadi", "llvmlite", "platform"} <= origin.versions.keys()
    html = blocks(origin.blocks())
    assert "v &lt;m/s&gt;" in html
    assert origin.files[0].sha256 in html
    assert origin.files[0].size == signals.stat().st_size
    assert "With " in blocks(Provenance(versions={"Python": "3"}).blocks())
    (tmp_path / "x.json").write_text(json.dumps({"provenance": origin.as_dict()}))
    assert Provenance.read(tmp_path / "x.json").as_dict() == origin.as_dict()


def run(out, inputs):
    """A result of one file, made from some inputs."""
    with result_folder(out, "identify", [], inputs=[], force=False) as folder:
        contents = {"provenance": gather_provenance(inputs).as_dict()}
        (folder / "identification.json").write_text(json.dumps(contents), encoding="utf-8")
        (folder / "page.html").write_text("page", encoding="utf-8")


@pytest.fixture
def made(tmp_path, monkeypatch):
    """A result of a log."""
    monkeypatch.chdir(tmp_path)
    log = tmp_path / "run.csv"
    log.write_text("1")
    run(tmp_path / "out", [log.relative_to(tmp_path)])
    return tmp_path / "out"


def states(result, *folders):
    return {file.path.rpartition("/")[2]: file.state for file in verify(result, folders).files}


def test_the_same_and_changed_files(made):
    assert states(made) == dict.fromkeys(("identification.json", "page.html", "run.csv"), "same")
    assert verify(made).document().blocks[0].text.endswith("out: 3 files as recorded.")
    assert states(made / "identification.json") == {"identification.json": "same", "run.csv": "same"}
    (made.parent / "run.csv").write_text("2")
    (made / "page.html").write_text("other")
    verification = verify(made)
    assert not verification.is_intact
    assert [file.path for file in verification.failed] == [str(made / "page.html"), "run.csv"]
    assert "run.csv differs" in verification.document().blocks[0].text
    assert states(made)["identification.json"] == "same"


def test_a_missing_file_is_found_in_a_folder_by_name_and_digest(made):
    (made.parent / "logs").mkdir()
    (made.parent / "run.csv").rename(made.parent / "logs" / "run.csv")
    assert states(made)["run.csv"] == "missing"
    assert any("folders" in getattr(block, "text", "") for block in verify(made).document().blocks)
    assert states(made, made.parent / "logs")["run.csv"] == "same"
    (made.parent / "logs" / "run.csv").write_text("2")
    assert states(made, made.parent / "logs")["run.csv"] == "differs"


def test_a_result_of_a_result_has_the_files_of_both(made):
    after = made.with_name("assessed")
    run(after, [made.relative_to(made.parent) / "identification.json"])
    inputs = [(file.path, file.state) for file in verify(after).files][2:]
    assert inputs == [("out/identification.json", "same"), ("run.csv", "same")]


def test_a_result_that_grows_replaces_its_earlier_files(made):
    more = made.with_name("more.csv")
    more.write_text("3")
    run(made, [more.relative_to(made.parent), made.relative_to(made.parent) / "identification.json"])
    verification = verify(made)
    assert verification.is_intact
    states = {"more.csv": "same", "out/identification.json": "replaced", "run.csv": "same"}
    assert {f.path: f.state for f in verification.files[2:]} == states


@pytest.mark.parametrize("damage", [b"", b"[1]", b"\xff\x00", b'{"provenance": {"files": 3}}'])
def test_a_damaged_file_of_a_result_differs(made, damage):
    (made / "identification.json").write_bytes(damage)
    found = verify(made)
    assert [(Path(file.path).name, file.state) for file in found.failed] == [("identification.json", "differs")]
    assert not any("does not record" in getattr(block, "text", "") for block in found.document().blocks)


def test_a_damaged_manifest_and_what_has_no_digests_are_refused(made, tmp_path):
    (made / "run.json").write_text("")
    with pytest.raises(FifthwheelError, match=r"out: run\.json in it is damaged"):
        verify(made)
    with pytest.raises(FifthwheelError, match=r"no run\.json in it; give a result folder"):
        verify(tmp_path)
    other = tmp_path / "other.json"
    with pytest.raises(FifthwheelError, match="cannot be read"):
        verify(other)
    other.write_text("[1]")
    with pytest.raises(FifthwheelError, match="has no digests"):
        verify(other)
    other.write_text('{"provenance": {"files": [{"path": 1}]}}')
    with pytest.raises(FifthwheelError, match=r"other\.json: provenance: damaged .*run its command again"):
        verify(other)
