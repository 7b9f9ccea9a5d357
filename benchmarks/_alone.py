"""Run a benchmark in a process of its own, and print its result as JSON: ``python _alone.py NAME quick|whole``.

Benchmarks of one command do not share libraries, threads and memory then, and no peer pays for the command line's stack
of calls (ContactMechanics looks through the stack in each step, which made it up to five times slower).
"""

import importlib
import json
import sys

from taxel import Error

if __name__ == "__main__":
    name, size = sys.argv[1:]
    try:
        print(json.dumps(importlib.import_module(name).run(quick=size == "quick")))
    except Error as error:
        sys.exit(f"{name}: {error}")
