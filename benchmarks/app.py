"""The workbench with a large log: time to read it, to the first plot, and of each zoom, in a browser.

    python benchmarks/app.py                # needs the test extra and Chromium, and 7 GB of disk
    python benchmarks/app.py --size 200     # MB; 2000 by default

The log is an MF4 file of 18 channels at 1 kHz. "first plot" is from the end of reading to the drawn plot of four
channels; a zoom is from the click to the plot with the samples of the new window. Everything is deleted at the end.
"""

import argparse
import shutil
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.reading import write_mf4
from tests.apps.app.served import chromium, served, tab

POINTS = "document.querySelector('.js-plotly-plot[role=img]')?.data?.[0]?.x"
DRAWN = f"(({POINTS})?.length ?? 0) > 100 && document.querySelectorAll('.scatterlayer .js-line').length >= 4"
CHANGE = f"""async ([low, high]) => {{
  const before = {POINTS};
  const button = [...document.querySelectorAll('button')].find(b => b.innerText.trim() === 'Show');
  const start = performance.now();
  button.click();
  while ({POINTS} === before) await new Promise(resolve => requestAnimationFrame(resolve));
  return (performance.now() - start) / 1000;
}}"""


def measure(size: int, folder: Path) -> None:
    """Print the times of a log of a size, MB."""
    workspace = folder / "workspace"
    (workspace / "logs").mkdir(parents=True)
    log = workspace / "logs" / "large.mf4"
    write_mf4(log, size)
    print(f"MF4 of {log.stat().st_size / 1e6:.0f} MB")
    with served(workspace) as address, chromium() as browser:
        start = time.perf_counter()
        with tab(browser, address) as page:
            page.set_default_timeout(1_800_000)
            stored = workspace / ".workbench" / "logs"
            while not [path for path in stored.glob("large.mf4-*") if path.suffix != ".part"]:
                time.sleep(0.05)
            read = time.perf_counter()
            page.wait_for_function(DRAWN)
            drawn = time.perf_counter()
            print(f"reading {read - start:.1f} s, first plot {drawn - read:.2f} s after it")
            length = float(page.get_by_label("To, s").input_value())
            times = []
            for fraction in (0.5, 0.1, 0.01, 0.001, 1e-4, 0.3):
                window = (0.4 * length, (0.4 + 0.6 * fraction) * length)
                for label, value in zip(("From, s", "To, s"), window, strict=True):
                    page.get_by_label(label).fill(f"{value:.3f}")
                page.wait_for_timeout(1000)
                times.append(page.evaluate(CHANGE, window))
                print(f"zoom to {window[1] - window[0]:.3g} s: {times[-1]:.2f} s")
            print(f"largest {max(times):.2f} s")
            start = time.perf_counter()
            page.get_by_role("link", name="2 Signals").click()
            page.get_by_label("Delay of speed").wait_for()
            page.get_by_role("status", name="Computing").wait_for(state="hidden")
            print(f"signals proposed and compared {time.perf_counter() - start:.1f} s")
        page_size = sum(path.stat().st_size for path in stored.rglob("*") if path.is_file())
        print(f"stored samples {page_size / 1e6:.0f} MB")


def main() -> None:
    """Read the arguments and measure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", type=int, default=2000, help="MB of the log")
    parser.add_argument("--folder", type=Path, default=None, help="for the files, which are deleted")
    arguments = parser.parse_args()
    folder = Path(tempfile.mkdtemp(prefix="workbench-", dir=arguments.folder))
    try:
        measure(arguments.size, folder)
    finally:
        shutil.rmtree(folder)


if __name__ == "__main__":
    main()
