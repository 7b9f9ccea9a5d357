"""Run a benchmark in a process of its own, and print its result as JSON.

``python -m taxel_benchmarks._alone NAME quick|whole``

Benchmarks of one command do not share libraries, threads and memory then, and no peer pays for the command line's stack
of calls (ContactMechanics looks through the stack in each step, which made it up to five times slower).
"""

import json
import sys
from importlib import import_module

from taxel import Error

if __name__ == "__main__":
    name, size = sys.argv[1:]
    try:
        print(json.dumps(import_module(f"taxel_benchmarks.{name}").run(quick=size == "quick")))
    except Error as error:
        sys.exit(f"{name}: {error}")
