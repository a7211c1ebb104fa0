"""Pictures of the pages of the workbench for docs/howto/workbench.md, wide and narrow.

    python benchmarks/app_pages.py                 # needs the test extra, pillow and Chromium
    python benchmarks/app_pages.py signals log     # only these pages

The workspace has examples/lane_changes.csv, examples/truck.toml, and two identifications of it.
"""

import io
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

sys.path.insert(0, str(Path(__file__).parents[1]))

from tests.apps.app.served import chromium, served, tab

from fifthwheel.apps.app.layout import PAGES, address

ROOT = Path(__file__).parents[1]
OUT = ROOT / "docs" / "_static" / "app"
SIZES = {"wide": (1400, 1000), "narrow": (390, 844)}
MAX_SIZE = 150_000
"""Bytes of a picture."""
SHOWN = ".js-plotly-plot[role=img] .plot-container, .fw-table table, .fw-report"
"""A plot, a table or a report, with which a page begins its result."""
SETTLED = 6000
"""ms in which a page is drawn, after the first of these."""
RUNS = {"first": [], "roll stiffness known": ["--set", "roll_stiffness=+- 5 %"]}
"""Options of the identifications."""


RENAME = """([from, to]) => {
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  for (let node; (node = walker.nextNode()); ) node.nodeValue = node.nodeValue.replace(from, to);
}"""
"""The folder of the workspace as a user has it."""


def prepare(workspace: Path) -> None:
    """Fill a workspace by the command line, which uses the same files."""
    (workspace / "logs").mkdir(parents=True)
    shutil.copy(ROOT / "examples" / "lane_changes.csv", workspace / "logs")
    shutil.copy(ROOT / "examples" / "truck.toml", workspace / "vehicle.toml")
    log = ["logs/lane_changes.csv"]
    fifthwheel = [sys.executable, "-m", "fifthwheel"]
    subprocess.run([*fifthwheel, "signals", *log, "--out", "signals.toml"], cwd=workspace, check=True)
    given = ["--signals", "signals.toml", "--vehicle", "vehicle.toml"]
    for name, options in RUNS.items():
        out = ["--out", f"runs/{name}"]
        subprocess.run([*fifthwheel, "identify", *log, *given, *options, *out], cwd=workspace, check=True)


def save(picture: bytes, path: Path) -> None:
    """Write a picture as WebP, with the quality that the limit permits."""
    for quality in (85, 70, 55, 40):
        Image.open(io.BytesIO(picture)).convert("RGB").save(path, quality=quality, method=6)
        if path.stat().st_size < MAX_SIZE:
            return
    raise SystemExit(f"{path}: larger than {MAX_SIZE} bytes")


def main() -> None:
    """Draw the pages whose names are given, or all."""
    names = sys.argv[1:] or PAGES
    OUT.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        workspace = Path(folder) / "workspace"
        prepare(workspace)
        with served(workspace) as start, chromium() as browser:
            for form, (width, height) in SIZES.items():
                with tab(browser, start, width=width, height=height) as page:
                    page.get_by_text("channels").first.wait_for()
                    for name in names:
                        page.goto(start.rstrip("/") + address(name))
                        page.locator(SHOWN).first.wait_for(state="attached", timeout=60_000)  # a narrow page folds some
                        page.wait_for_timeout(SETTLED)
                        page.evaluate(RENAME, [folder, "~"])
                        path = OUT / f"{name}-{form}.webp"
                        save(page.screenshot(), path)
                        print(f"{path.relative_to(ROOT)}: {path.stat().st_size} bytes")


if __name__ == "__main__":
    main()
