"""No code of the current folder, nor of a recording's folder, is run: by any command, nor by any child of one."""

from __future__ import annotations

import os
import subprocess
import sys
from importlib.metadata import packages_distributions
from pathlib import Path

import numpy as np
import pytest
from loopback import free_port
from shell import run

import taxel
from taxel import Array, Frames
from taxel.cli._commands import OWN, plugins
from taxel.live._requests.training import TrainingRequests
from taxel.live._shown_files import Opening, ShownFiles

from .marked import TAXEL

CHECKOUT = Path(__file__).parents[2]
#: Modules that something imports if they are there, beside all that are installed or of Python itself.
OPTIONAL = ("usercustomize", "zenoh", "taxel_zenoh", "pylsl", "serial", "rerun", "__main__", "_opening")
SCENE = """
array = { rows = 8, columns = 8 }
[[bodies]]
shape.sphere.radius_mm = 5
x_mm = 10
y_mm = 10
motion.pressed = { depth_mm = 0.6, speed_mm_s = 50, hold_ms = 5 }
"""


def plant(folder: Path) -> Path:
    """Write a file for every module that could be imported, which says that it ran, and settings of libraries."""
    folder.mkdir()
    ran = folder / "RAN"
    names = {*sys.stdlib_module_names, *packages_distributions(), *OPTIONAL} - {""}
    first = folder / "sitecustomize.py"
    first.write_text(f"with open({str(ran)!r}, 'a') as file:\n    file.write(__name__ + '\\n')\n")
    for name in names - {"sitecustomize"}:
        if name.isidentifier():
            (folder / f"{name}.py").hardlink_to(first)
    program = folder / "x.sh"
    program.write_text(f"#!/bin/sh\necho x.sh >> '{ran}'\n")
    program.chmod(0o755)
    (folder / "ffmpeg").hardlink_to(program)
    (folder / "matplotlibrc").write_text(
        f"animation.ffmpeg_path: ./x.sh\nbackend: module://h5py\ntext.usetex: True\nsavefig.directory: {folder}\n"
    )
    (folder / "a.pth").write_text("import sitecustomize\n")
    points = folder / "strange-1.0.dist-info"
    points.mkdir()
    (points / "METADATA").write_text("Metadata-Version: 2.1\nName: strange\nVersion: 1.0\n")
    (points / "entry_points.txt").write_text("[taxel.commands]\nstudy = sitecustomize:app\n")
    return folder


@pytest.fixture(scope="module")
def beside(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of recordings with strange files in it."""
    folder = plant(tmp_path_factory.mktemp("strange") / "recordings")
    draw, count = np.random.default_rng(1), 1000
    values, labels = draw.random((count, 4, 4)).astype(np.float32) * 0.5, ["label,t_us"]
    for k in range(50, count - 50, 100):
        values[k : k + 40, 1:3, 1:3] += 50
        labels += [f"contact,{10_000 * k}", f"lift,{10_000 * (k + 40)}"]
    frames = Frames(values, np.arange(count) * 10_000, unit="kPa", array=Array(4, 4, pitch_mm=(5, 5)))
    for name in ("a.npz", "a.h5", "b.h5"):
        taxel.convert(frames, folder / name)
        (folder / name).with_suffix(".notes.csv").write_text("\n".join(labels))
    taxel.convert(Frames(frames.values, frames.t, unit="counts", array=frames.array), folder / "counts.h5")
    (folder / "labels.csv").write_text("\n".join(labels))
    done = run("train", folder / "a.npz", "--labels", "notes", "--folds", 0, "-o", folder / "readout.json")
    assert done.returncode == 0, done.stderr
    (folder / "own").write_text("lines.linewidth: 7\n")
    (folder / "scene.toml").write_text(SCENE)
    return folder


@pytest.fixture(scope="module")
def here(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The current folder, with such files too: each command writes files of other names."""
    return plant(tmp_path_factory.mktemp("current") / "here")


def commands(folder: Path) -> dict[str, list[list[object]]]:
    """Return the words of every command, and of each of its ways that starts a child."""
    port = free_port()
    few = ["--window-ms", 50, "--periods", 10, "--taxels", 1, "--draws", 1, "--shuffles", 1, "--folds", 2]
    live = ["--host", "127.0.0.1", "--port", port, "--seconds", 0.3]
    return {
        "demo": [["--scenes", 1, "--seed", 1, "--noise", 1, "--folder", "demo"]],
        "emulate": [["--port", port, "--scenes", 1, "--seed", 1]],
        "simulate": [[folder / "scene.toml", "-o", "touch.mcap", "--movie", "touch.gif", "--slower", 1]],
        "device": [["ports"]],
        "record": [["walk.mcap", *live]],
        "live": [["--panel", *live]],
        "view": [[folder / "a.h5", "--no-open", "--seconds", 0.5]],
        "info": [[folder / "a.h5", "--picture", "a.png"]],
        "calibrate": [[folder / "counts.h5", "--load", 9.81, "--from", 2, "--to", 4, "--tare", 0.4]],
        "convert": [[folder / "a.h5", "c.h5"]],
        "cut": [[folder / "a.h5", "d.h5", "--from", 1, "--to", 3]],
        "merge": [[folder / "a.h5", folder / "b.h5", "-o", "both.h5", "--beside"]],
        "encode": [[folder / "a.h5", "spikes.npz", "--encoder", "contact_area"]],
        "train": [[folder / "a.h5", "--labels", "notes", "--folds", 0, "-o", "r.json", "--report", "train"]],
        "detect": [[folder / "a.h5", "--readout", folder / "readout.json"]],
        "export": [["nir", folder / "readout.json", "graph.nir"]],
        "information": [[folder / "a.h5", "--labels", folder / "labels.csv", "--report", "r.html", *few]],
        "bridge": [live],
        "show": [[folder / "a.h5", "rerun:127.0.0.1:1"]],
        "bench": [["encode_contact_area", "--quick"]],
        "study": [["fig6.2", "--size", "toy", "--jobs", 2, "--report", "study"]],
    }


def test_every_command_is_tried() -> None:
    assert commands(Path()).keys() == {*OWN, *plugins()}


@pytest.mark.parametrize(
    "command",
    [pytest.param(name, marks=pytest.mark.slow if name in ("demo", "bench") else ()) for name in (*OWN, *plugins())],
)
def test_a_command_runs_no_code_of_a_strange_folder(command: str, here: Path, beside: Path) -> None:
    for words in commands(beside)[command]:
        done = subprocess.run(
            [TAXEL, command, *map(str, words)], cwd=here, capture_output=True, text=True, timeout=280, check=False
        )
        # Nothing was received; no viewer runs, or its library is not installed.
        expected = {"record": (3,), "live": (3,), "bridge": (3,), "show": (2, 3)}.get(command, (0,))
        assert done.returncode in expected, done.stderr
        check_nothing_ran(here, beside)


def test_a_training_of_the_page_runs_no_code_of_a_strange_folder(
    here: Path, beside: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(here)
    handler = TrainingRequests(Opening(), ShownFiles())
    assert "contact, neuron: " in handler.train(beside / "a.h5", here / "page.json").text
    check_nothing_ran(here, beside)


def test_settings_of_the_current_folder_do_not_count(here: Path, beside: Path) -> None:
    """Where taxel loads matplotlib: in its plots, films and studies, in this process and in workers."""
    for loads in ("taxel.plot.film", "taxel.report", "taxel_studies.fig6_1"):
        code = f"import {loads}, matplotlib; print(matplotlib.rcParams['animation.ffmpeg_path'])"
        done = subprocess.run([sys.executable, "-P", "-c", code], cwd=here, capture_output=True, text=True, check=True)
        assert done.stdout == "ffmpeg\n"
    named = subprocess.run(
        [sys.executable, "-P", "-c", "import taxel.plot, matplotlib; print(matplotlib.rcParams['lines.linewidth'])"],
        cwd=here, env={**os.environ, "MATPLOTLIBRC": str(beside / "own")}, capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert named.stdout == "7.0\n"
    check_nothing_ran(here, beside)


@pytest.mark.parametrize("entries", [":", "{named}:", ":{named}"])
def test_an_empty_entry_of_pythonpath_is_dropped(tmp_path: Path, entries: str) -> None:
    """Python itself reads such entries before taxel is loaded, so what it loads by then cannot be kept from there."""
    here = tmp_path / "here"
    here.mkdir()
    for name in ("typing", "signal", "numpy", "typer", "h5py", "taxel", "pathlib"):
        (here / f"{name}.py").write_text(f"open({str(here / 'RAN')!r}, 'a').write(__name__)")
    path = entries.format(named=tmp_path)
    done = subprocess.run([TAXEL, "--version"], cwd=here, env={**os.environ, "PYTHONPATH": path}, check=False)
    assert done.returncode == 0
    assert not (here / "RAN").exists()


def check_nothing_ran(*folders: Path) -> None:
    for folder in folders:
        ran = folder / "RAN"
        said = ran.read_text() if ran.exists() else ""
        ran.unlink(missing_ok=True)  # of the next command it says nothing
        assert not said, (folder, said)
