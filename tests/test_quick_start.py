"""`import taxel` is quick, and silent: what loads slowly waits until it is asked for."""

import subprocess
import sys

#: Modules that take a tenth of a second or more to import, or most of the memory.
SLOW = {"dask", "h5py", "jinja2", "joblib", "matplotlib", "pandas", "ray", "rich", "scipy", "sklearn", "typer"}


def test_import_loads_nothing_slow_and_says_nothing():
    program = "import sys, taxel; taxel.Neuron; print(*{name.partition('.')[0] for name in sys.modules})"
    ran = subprocess.run([sys.executable, "-W", "error", "-c", program], capture_output=True, text=True, check=True)
    assert ran.stderr == ""
    assert "taxel" in ran.stdout
    assert SLOW & set(ran.stdout.split()) == set()
