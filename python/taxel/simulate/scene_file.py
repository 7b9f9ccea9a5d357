"""Scenes that a user writes: a file in TOML with bodies, foam, taxels and seed."""

from __future__ import annotations

import difflib
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from taxel import _core
from taxel._base.arguments import checked_path, integer, number, text
from taxel._base.documents import read_text, read_toml
from taxel._base.errors import placed
from taxel._core import SceneError
from taxel.array import Array
from taxel.simulate.acts import Act, Scene, Silence
from taxel.simulate.board import fitting
from taxel.wire import Registers

__all__ = ["SceneFile"]

#: Keys of a file beside those of a scene.
_OWN = ("seed", "preset", "tare_ms", "array", "taxels")
_SCENE = ("cells_per_pitch", "foam", "bodies", "slant_deg", "downhill_deg", "lead_ms", "tail_ms")
_TAXELS = (
    "v_trans",
    "feedback_kohm",
    "rest_us",
    "touch_us",
    "exponent",
    "side_mm",
    "gain_spread",
    "offset_mv",
    "noise_ticks",
)
#: Silence between the tare and the scene, and after it, ms.
_BEFORE_MS, _AFTER_MS = 250.0, 100.0
#: The longest tare, ms: the limit of a scene's silences.
_LONGEST_MS = 60_000.0


@dataclass(frozen=True)
class SceneFile:
    """The contents of a scene file.

    Attributes
    ----------
    scene : Scene
    seed : int, 0 or more
        Seed of the taxels' spread and noise.
    preset : str or None
        The board's registers, as in `play`.
    tare_ms : float, ms
    array : Array
    sensor : mapping of str to float
        Parameters that differ from the usual taxels, as in `play`.

    Examples
    --------
    >>> import tempfile
    >>> said = '''
    ... seed = 3
    ... [[bodies]]
    ... shape.sphere.radius_mm = 15
    ... x_mm = 80
    ... y_mm = 80
    ... mass_g = 40
    ... motion.dropped.height_mm = 120
    ... '''
    >>> with tempfile.NamedTemporaryFile("w", suffix=".toml") as file:
    ...     _ = file.write(said), file.flush()
    ...     opened = SceneFile.open(file.name)
    >>> opened.scene
    Scene(sphere dropped)
    >>> [round(contact.start_us) for contact in opened.scene.motion().contacts][:1]
    [156409]
    """

    scene: Scene
    seed: int = 0
    preset: str | None = None
    tare_ms: float = 50.0
    array: Array = field(default_factory=Array.thesis)
    sensor: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def open(cls, path: str | os.PathLike[str]) -> SceneFile:
        """Read and check a file.

        Parameters
        ----------
        path : path of a .toml
            The keys of a `Scene`, and also ``seed``, ``preset``, ``tare_ms``, ``array`` (rows, columns,
            pitch_mm) and ``taxels`` (as `sensor` of `play`). The heights of a height map may be a ``file`` beside it:
            rows of numbers in mm, with commas or blanks between them.

        Raises
        ------
        FormatError : not TOML, or longer than 1 MiB; names the file and the place
        SceneError : an unknown key, a value that is invalid; names the file and the place
        OSError : a file that cannot be read

        Warns
        -----
        UserWarning : a touch narrower than its cells resolve, as a `Scene` does
        """
        file = Path(checked_path("path", path))
        document = read_toml(file)
        try:
            return cls._of(document, file.parent)
        except _core.Error as error:
            raise placed(SceneError(str(error)), file) from None

    @classmethod
    def _of(cls, document: Mapping[str, Any], folder: Path) -> SceneFile:
        _known("", document, (*_OWN, *_SCENE))
        size = document.get("array", {})
        _known("array", size, ("rows", "columns", "pitch_mm"))
        thesis = Array.thesis()
        array = thesis
        if size:
            rows, columns = size.get("rows", thesis.rows), size.get("columns", thesis.columns)
            array = Array(rows, columns, pitch_mm=size.get("pitch_mm", thesis.pitch_mm))
        sensor = document.get("taxels", {})
        _known("taxels", sensor, _TAXELS)
        if "bodies" not in document:
            raise SceneError("bodies is missing: write [[bodies]] and describe a body")
        scene = Scene(
            {name: document[name] for name in _SCENE if name in document}
            | {"bodies": _bodies(document["bodies"], folder)}
        )
        # Refuses what is invalid here, instead of when the scene is played.
        _core.check_scene(array, scene._part(), json.dumps(sensor))
        if not np.isfinite(scene.motion(array=array).force_n).all():
            raise SceneError("foam: the force on the foam is too large for a float32; the foam must be softer")
        preset = text("preset", document["preset"]) if "preset" in document else cls.preset
        fitting(preset, array)
        tare_ms = number("tare_ms", document.get("tare_ms", cls.tare_ms))
        if not 0 <= tare_ms <= _LONGEST_MS:
            raise SceneError(f"tare_ms is {tare_ms:g} ms: must be from 0 to {_LONGEST_MS:g}")
        return cls(
            scene,
            integer("seed", document.get("seed", cls.seed), 0),
            preset,
            tare_ms,
            array,
            sensor,
        )

    @property
    def registers(self) -> Registers:
        """The registers of the board that plays it."""
        return fitting(self.preset, self.array)

    def acts(self) -> list[Act]:
        """Return silence for the tare, the scene, and a little silence: as `play` and `emulate` take them."""
        return [Silence(self.tare_ms + _BEFORE_MS), self.scene, Silence(_AFTER_MS)]

    @property
    def options(self) -> dict[str, Any]:
        """Arguments of `play` and `emulate` beside acts and seed."""
        return {"preset": self.preset, "tare_ms": self.tare_ms, "array": self.array, "sensor": self.sensor}


def _known(location: str, table: object, names: tuple[str, ...] | list[str]) -> None:
    """Refuse an unknown key, and name the key that was probably meant."""
    if not isinstance(table, Mapping):
        raise SceneError(f"{location} is {json.dumps(table, default=str)}: must be a table")
    for name in table:
        if name not in names:
            near = difflib.get_close_matches(name, names, 1)
            meant = f" (did you mean {near[0]}?)" if near else ""
            raise SceneError(
                f"{location}{'.' * bool(location)}{name} is not known{meant}: must be one of {', '.join(names)}"
            )


def _bodies(described: Any, folder: Path) -> Any:
    """Return bodies with the height maps that are in files."""
    if not isinstance(described, list):
        raise SceneError(
            f"bodies is {json.dumps(described, default=str)}: must be written [[bodies]], once for each body"
        )
    bodies = []
    for n, body in enumerate(described):
        if isinstance(body, Mapping):
            for part in ("shape", "motion"):
                kinds = body.get(part)
                if isinstance(kinds, Mapping) and len(kinds) > 1:
                    raise SceneError(f"bodies[{n}].{part} is {' and '.join(kinds)}: must be only one of them")
            if "mass_g" in body and "material" in body:
                raise SceneError(f"bodies[{n}] has mass_g and material: must have only one of them")
        shape: Any = body.get("shape") if isinstance(body, Mapping) else None
        relief = shape.get("height_map") if isinstance(shape, Mapping) else None
        if isinstance(relief, Mapping) and "file" in relief:
            where = f"bodies[{n}].shape.height_map"
            if "heights_mm" in relief:
                raise SceneError(f"{where} has heights_mm and a file: must have only one of them")
            file = folder / text(f"{where}.file", relief["file"])
            try:
                rows = read_text(file).replace(",", " ").splitlines()
                heights = np.loadtxt(rows, ndmin=2).tolist()
            except FileNotFoundError:
                raise SceneError(f"{where}.file {file}: no such file") from None
            except ValueError as error:
                raise SceneError(f"{where}.file {file}: {error}") from None
            rest = {name: value for name, value in relief.items() if name != "file"}
            body = {**body, "shape": {**shape, "height_map": {"heights_mm": heights, **rest}}}  # noqa: PLW2901
        bodies.append(body)
    return bodies
