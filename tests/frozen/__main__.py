"""Show that a change of the structure changes no result: `python -m tests.frozen --write` before it, and without after.

It stores the results of all cases in .frozen, and compares them bit for bit; the exit code is 1 if one differs.
"""

import argparse
import sys
import time

from tests.frozen.cases import CASES
from tests.frozen.stored import available, differences, store


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("cases", nargs="*", metavar="CASE", help=", ".join(CASES))
    parser.add_argument("--write", action="store_true", help="replace the stored results")
    parser.add_argument("--tolerance", type=float, default=0.0, help="relative, of numbers; texts are not compared")
    arguments = parser.parse_args()
    different = 0
    for name in arguments.cases or CASES:
        if not available(name):
            print(f"{name}: skipped, its logs are not present")
            continue
        begin = time.process_time()
        if arguments.write:
            store(name)
            found = []
        else:
            found = differences(name, arguments.tolerance)
        different += bool(found)
        print(f"{name}: {len(found)} differences, {time.process_time() - begin:.1f} s", flush=True)
        for line in found[:10]:
            print(f"  {line}")
    return 1 if different else 0


sys.exit(main())
