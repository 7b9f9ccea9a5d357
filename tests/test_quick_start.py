"""`import taxel` and its commands are quick, and silent: what loads slowly waits until it is asked for."""

import subprocess
import sys

#: Modules that take a tenth of a second or more to import, or most of the memory.
SLOW = {"cyclopts", "dask", "h5py", "jinja2", "joblib", "matplotlib", "pandas", "ray", "rich", "scipy", "sklearn"}


def test_import_loads_nothing_slow_and_says_nothing():
    program = "import sys, taxel; taxel.Neuron; print(*{name.partition('.')[0] for name in sys.modules})"
    ran = subprocess.run([sys.executable, "-W", "error", "-c", program], capture_output=True, text=True, check=True)
    assert ran.stderr == ""
    assert "taxel" in ran.stdout
    assert SLOW & set(ran.stdout.split()) == set()


def test_a_command_loads_what_it_needs_and_no_other_command():
    program = (
        "import sys; from taxel.cli import main\n"
        "try: main(['info', '--help'])\n"
        "except SystemExit: print(*(name for name in sys.modules if name.startswith('taxel.')))"
    )
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    loaded = set(ran.stdout.splitlines()[-1].split())
    assert "taxel.cli.info" in loaded
    rooms = {"detect", "learn", "live", "demo", "information", "simulate", "plot", "report"}
    assert not loaded & {f"taxel.{room}" for room in rooms}
    commands = {name for name in loaded if name.startswith("taxel.cli.") and "._" not in name}
    assert commands == {"taxel.cli.app", "taxel.cli.info"}


def test_a_misspelt_command_is_answered_with_the_nearest_of_all():
    ran = subprocess.run([sys.executable, "-m", "taxel", "devic"], capture_output=True, text=True, check=False)
    assert ran.stderr == "taxel: No such command 'devic'. Did you mean 'device'?; see taxel --help\n"
    assert ran.returncode == 2
