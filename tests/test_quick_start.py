"""`import taxel` and its commands are quick, and silent: what loads slowly waits until it is asked for."""

import json
import subprocess
import sys

#: Modules that take a tenth of a second or more to import, or most of the memory.
SLOW = {"cyclopts", "dask", "h5py", "jinja2", "joblib", "matplotlib", "pandas", "ray", "rich", "scipy", "sklearn"}
#: One process, which prints what it has loaded after each step.
PROGRAM = """
import contextlib, io, json, sys, warnings
loaded = {}
import taxel
taxel.Neuron
loaded["import"] = [*sys.modules]
from taxel.cli import main
for words in ("--help", "trian", "info --help"):
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        with contextlib.suppress(SystemExit):
            main(words.split())
    loaded[words] = [*sys.modules]
taxel.learn.ConeX()
loaded["learner"] = [*sys.modules]
warnings.simplefilter("ignore")
taxel.plot.raster
loaded["plot"] = [*sys.modules]
print(json.dumps(loaded))
"""


def test_what_is_asked_for_is_loaded_and_no_more():
    ran = subprocess.run([sys.executable, "-W", "error", "-c", PROGRAM], capture_output=True, text=True, check=True)
    assert ran.stderr == ""
    loaded = {step: set(names) for step, names in json.loads(ran.stdout).items()}
    assert not SLOW & loaded["import"]
    shared = {"taxel.cli.app", "taxel.cli.console"}
    for step, commands in (("--help", set()), ("trian", set()), ("info --help", {"taxel.cli.info", "taxel.cli.task"})):
        found = {name for name in loaded[step] if name.startswith("taxel.cli.") and "._" not in name}
        assert found - shared == commands
        assert not loaded[step] & {"taxel_studies", "taxel_benchmarks", "scipy", "matplotlib"}
    rooms = {"detect", "learn", "live", "demo", "information", "simulate", "plot", "report"}
    assert not loaded["info --help"] & {f"taxel.{room}" for room in rooms}
    assert "sklearn" not in loaded["learner"]
    assert "matplotlib" in loaded["plot"] - loaded["learner"]
