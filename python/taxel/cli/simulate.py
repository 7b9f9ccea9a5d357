"""``taxel simulate``: a scene from a file, or random scenes, as a recording."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

import taxel
from taxel._base.files import write_whole
from taxel._base.messages import counted, plain
from taxel._core import ProblemError
from taxel.cli.app import App, Flat, Limits
from taxel.cli.task import OutOption, Output, progress
from taxel.demo.script import TRAINING_SEED, script
from taxel.reading import Facts, InMemory, Marks
from taxel.simulate import Scene, SceneFile
from taxel.simulate.board import fitting

app = App(name="simulate")


@app.default
def simulate(
    scene: Path | None = None,
    /,
    *,
    scenes: Annotated[int | None, Parameter(validator=Limits(1))] = None,
    out: OutOption = None,
    labels: Annotated[Path | None, Parameter(name="--truth")] = None,
    seed: Annotated[int | None, Parameter(validator=Limits(0, TRAINING_SEED - 1))] = None,
    output: Flat[Output] = Output(),
) -> None:
    """Simulate a scene, or random ones, on the emulated board, as fast as possible; without -o only check them.

    Example: taxel simulate scene.toml -o touch.mcap --truth touch.csv
    Example: taxel simulate --scenes 100 --seed 1 -o touches.mcap --truth touches.csv

    Parameters
    ----------
    scene
        A scene: a .toml, as the page *Scenes* of the documentation describes it.
    scenes
        Number of random scenes, those that taxel emulate plays with this seed, instead of a file.
    out
        Write the recording that a host would make: .mcap, .lsa, .npz, .csv or .h5.
    labels
        Write the true times of the touches to this CSV, label,t_us.
    seed
        Seed of random scenes, taxels and noise. Default: as in the scene's file, or 0.
    """
    if (scene is None) == (scenes is None):
        raise ProblemError("SCENE or --scenes: give one of them")
    with progress(quiet=True):
        scene_file = SceneFile(Scene({})) if scene is None else SceneFile.open(scene)
    seed = scene_file.seed if seed is None else seed
    acts = scene_file.acts() if scenes is None else script(seed, scenes, tare_ms=scene_file.tare_ms)
    named = str(scene) if scenes is None else counted(scenes, "scene")
    targets = [path for path in (out, labels) if path is not None]
    if len({path.resolve() for path in targets}) < len(targets):
        raise ProblemError("--out and --truth: must be different files")
    output.check(*targets)
    contacts, force = taxel.simulate.truth(acts, preset=scene_file.preset, array=scene_file.array)
    about: dict[str, Any] = {"scene": named, "seed": seed, "contacts": [contact._asdict() for contact in contacts]}
    about["peak_n"] = float(force.max())
    lines = [f"{named}: {counted(len(contacts), 'touch', 'touches')}, at most {plain(force.max(), 3)} N"]
    if out is not None:
        with progress(output.json) as show:
            played = taxel.simulate.play(
                acts,
                seed=seed,
                watch=lambda share: show("playing", round(100 * share), 100),
                **scene_file.options,
            )
        about["events"] = len(played.events)
        registers = fitting(scene_file.preset, played.events.array)
        made = InMemory(Facts(array=played.events.array), played.events, Marks(registers=registers))
        lost = taxel.convert(taxel.Recording.of(made), out, overwrite=output.overwrite)
        lines.append(f"{counted(len(played.events), 'event')} written to {out}")
        lines += [f"  lost: {loss}" for loss in lost]
    if labels is not None:
        with_ends = sorted([(c.start_us, "contact") for c in contacts] + [(c.stop_us, "lift") for c in contacts])
        rows = "".join(f"{label},{round(t)}\n" for t, label in with_ends)
        write_whole(labels, lambda file: file.write(f"label,t_us\n{rows}".encode()), overwrite=output.overwrite)
        lines.append(f"truth written to {labels}")
    about["written"] = [str(path) for path in targets]
    output.say(about, *lines)
