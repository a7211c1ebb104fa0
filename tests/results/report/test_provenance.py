"""The origin of a result."""

import hashlib

from fifthwheel.base.pages.html import blocks
from fifthwheel.results.report import provenance
from fifthwheel.results.report.provenance import gather_provenance, provenance_of_run
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


def test_everything_is_optional():
    assert "With " in blocks(provenance.Provenance(versions={"Python": "3"}).blocks())
