"""What it takes to run it again."""

import hashlib

from fifthwheel.report import gather, of_run, provenance, tables
from fifthwheel.vehicle import catalogue


def test_files_are_told_by_size_and_hash(tmp_path):
    log = tmp_path / "a log.csv"
    log.write_bytes(b"time,speed\n" * 200_000)
    folder = tmp_path / "bag"
    folder.mkdir()
    (folder / "part 0").write_bytes(b"x")
    told = gather([log, folder, tmp_path / "missing"])
    assert [one.path for one in told.files] == [str(log), str(folder / "part 0")]
    assert told.files[0].size == log.stat().st_size
    assert told.files[0].sha256 == hashlib.sha256(log.read_bytes()).hexdigest()


def test_the_command_can_be_pasted(tmp_path):
    signals = tmp_path / "signals.toml"
    signals.write_text('[signals]\nspeed = "v <m/s>"\n')
    told = of_run([], "cheng_cebon_2011", signals, None, command=["identify", "a log.csv", "-o", "out"])
    assert told.command == "fifthwheel identify 'a log.csv' -o out"
    assert list(told.texts.values()) == [catalogue.text("cheng_cebon_2011"), signals.read_text()]
    assert told.time.endswith(" UTC")
    assert {"fifthwheel", "Python", "numpy", "casadi", "llvmlite", "platform"} <= told.versions.keys()
    html = tables.provenance(told)
    assert "v &lt;m/s&gt;" in html
    assert told.files[0].sha256 in html
    assert told.as_dict()["files"][0]["size"] == signals.stat().st_size


def test_nothing_is_needed():
    assert "With " in tables.provenance(provenance.Provenance(versions={"Python": "3"}))
