"""Data sets of LeRobot: episodes are trials, touch features are sources, and detections join with the tables.

``data`` was written by lerobot-dataset 0.4.4 (version 3.0; without its statistics, and with a
stand-in for torch, which its writer imports alone). That of version 2.1 is written here by its documented form.
"""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from refusal import refused
from shell import call
from tests.panel.protocol import Client

import taxel
from taxel import FormatError, ProblemError
from taxel._base.errors import Place
from taxel.panel import Panel

WRITTEN = Path(__file__).parent / "data"
DATA = pd.read_parquet(WRITTEN / "data" / "chunk-000" / "file-000.parquet")


def of_version_2(folder: Path, features: dict[str, Any] | None = None, **columns: list[Any]) -> Path:
    """Write the same episodes, each in its own file, with other features or columns."""
    info = json.loads((WRITTEN / "meta" / "info.json").read_text())
    place = "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet"
    info |= {"codebase_version": "v2.1", "data_path": place, "chunks_size": 4}
    info["features"] |= features or {}
    (folder / "meta").mkdir(parents=True)
    (folder / "meta" / "info.json").write_text(json.dumps(info))
    tasks = ({"task_index": k, "task": text} for k, text in enumerate(("press", "grasp")))
    (folder / "meta" / "tasks.jsonl").write_text("".join(f"{json.dumps(row)}\n" for row in tasks))
    for k, table in DATA.groupby("episode_index"):
        file = folder / place.format(episode_chunk=k // 4, episode_index=k)
        file.parent.mkdir(parents=True, exist_ok=True)
        table.assign(**{name: cells[: len(table)] for name, cells in columns.items()}).to_parquet(file)
    return folder


def three() -> dict[str, Any]:
    return {"dtype": "float32", "shape": [3], "names": ["thumb_x", "thumb_y", "thumb_z"]}


@pytest.mark.parametrize("version", [2, 3])
def test_episodes_are_trials_and_touch_is_their_source(version: int, tmp_path: Path) -> None:
    path = WRITTEN if version == 3 else of_version_2(tmp_path / "touch")
    found = taxel.open_all(path, label_column="next.success")
    assert [each.name for each in found] == [f"episode_{k:06d}" for k in range(6)]
    for k, recording in enumerate(found):
        rows = DATA[DATA["episode_index"] == k]
        frames = recording.frames()
        np.testing.assert_array_equal(
            frames.values, np.stack([np.stack(cell) for cell in rows["observation.tactile.palm"]])
        )
        np.testing.assert_array_equal(frames.t, np.rint(rows["timestamp"].astype(np.float64) * 1e6))
        assert [(note.text, note.t) for note in recording.notes] == [("next.success", 20_000 * (40 + 3 * k))]
        assert "observation.state" in recording.lost[0]
    tasks = [[note.text for note in each.notes] for each in taxel.open_all(path, label_column="task")]
    assert tasks == 3 * [["press"], ["grasp"]]


def test_detections_join_with_the_frames_of_the_data_set(tmp_path: Path, capsys) -> None:
    path, rule, out = tmp_path / "touch", tmp_path / "rule.json", tmp_path / "found.parquet"
    shutil.copytree(WRITTEN, path)
    taxel.detect.PlainRule("area", 2, noise_floor=40.0).save(rule)
    for place in (out, out.with_suffix(".csv")):
        assert call(capsys, "detect", path, "--readout", rule, "-o", place)[0] == 0
    found = pd.read_parquet(out)
    assert list(found) == ["episode_index", "frame_index", "label", "t_s", "known_s"]
    pd.testing.assert_frame_equal(found, pd.read_csv(out.with_suffix(".csv")), check_dtype=False)
    joined = found.merge(DATA, on=["episode_index", "frame_index"])
    assert len(joined) == len(found) >= 6
    assert ((joined["timestamp"] <= joined["known_s"] + 1e-6) & (joined["known_s"] < joined["timestamp"] + 0.02)).all()
    before = sorted(path.rglob("*"))
    for folder in ("data", "meta/episodes"):
        code, _, error = call(capsys, "detect", path, "--readout", rule, "-o", path / folder / "found.csv")
        assert (code, "among the tables of a data set" in error) == (2, True)
    assert sorted(path.rglob("*")) == before
    taxel.convert(taxel.Frames(np.zeros((9, 1, 1)), 1000 * np.arange(9)), tmp_path / "a.npz")
    code, _, error = call(capsys, "detect", path, tmp_path / "a.npz", "--readout", rule, "-o", tmp_path / "b.parquet")
    assert (code, "write a .csv" in error) == (2, True)


def test_axes_and_features_of_other_names_are_asked(tmp_path: Path) -> None:
    values = [np.array([k, 0, 2 * k], np.float32) for k in range(200)]
    path = of_version_2(tmp_path / "a", {"finger.force": three()}, **{"finger.force": values})
    layout = tmp_path / "a.layout.toml"
    with pytest.raises(FormatError, match="axes x, y and z"):
        taxel.open_all(path)
    layout.write_text('axis = "z"\n')
    sources = taxel.open_all(path)[0].sources
    assert [*sources] == ["tactile_palm", "finger_force"]
    assert sources["finger_force"].array.names == ("thumb",)
    np.testing.assert_array_equal(sources["finger_force"].frames().values.ravel(), 2.0 * np.arange(90))
    layout.write_text('[data]\narray = "observation.state"\n')
    [only] = taxel.open_all(path)[0].sources.values()
    assert only.array.names == ("a", "b")


@pytest.mark.parametrize("shape", [(), (5,), (2, 4), (2, 3, 4), (6, 3), (3, 5, 3)])
def test_a_shape_says_sensors_rows_columns_and_axes(shape: tuple[int, ...], tmp_path: Path) -> None:
    values = np.random.default_rng(1).random((90, *shape)).astype(np.float32)
    feature = {"dtype": "float32", "shape": list(shape) or [1], "names": None}
    path = of_version_2(tmp_path / "a", {"skin.pressure": feature}, **{"skin.pressure": values.tolist()})
    (tmp_path / "a.layout.toml").write_text('axis = "y"\n[data]\narray = "skin.pressure"\n')
    found = [each.frames().values for each in taxel.open_all(path)[0].sources.values()]
    whole = values[..., 1] if shape[-1:] == (3,) else values
    parts = [whole] if whole.ndim < 4 else list(whole.swapaxes(0, 1))
    assert len(found) == len(parts)
    for mine, part in zip(found, parts, strict=True):
        np.testing.assert_array_equal(mine, part.reshape(90, *[1] * (3 - part.ndim), *part.shape[1:]))


@pytest.mark.parametrize("cell", [[1.0], [1.0, 2.0, 3.0], None])
def test_cells_of_another_shape_than_is_stated_are_refused(cell: list[float] | None, tmp_path: Path) -> None:
    feature = {"dtype": "float32", "shape": [2], "names": None}
    path = of_version_2(tmp_path / "a", {"touch": feature}, touch=[*[[1.0, 2.0]] * 50, cell, *[[1.0, 2.0]] * 50])
    with pytest.raises(FormatError, match="touch of episode_000000 is not of shape"):
        taxel.open_all(path)


def test_a_data_set_that_is_none_is_refused(tmp_path: Path) -> None:
    path = of_version_2(tmp_path / "a")
    with refused(ProblemError, "label_column"):
        taxel.open_all(path, label_column="next.done")
    file, info = path / "meta" / "info.json", json.loads((path / "meta" / "info.json").read_text())
    wrong = [{}, info | {"data_path": "../{episode_index}.parquet"}, info | {"features": {"a": {}}}, None, []]
    for each in wrong:
        file.write_text(json.dumps(each))
        with refused(FormatError, place=Place("info.json")):
            taxel.open_all(path)


def test_a_data_set_is_shown_by_the_page_and_its_features_are_chosen(tmp_path: Path) -> None:
    values = [np.array([k, 0, 2 * k], np.float32) for k in range(200)]
    path = of_version_2(tmp_path / "a", {"finger.force": three()}, **{"finger.force": values})
    with Panel(tmp_path) as panel, Client(panel) as page:
        assert page.ask("open", name="a")["field"] == "roles"
        page.ask("look", name="a")
        said = page.since_asked("look", name="a")
        [question] = said["questions"]
        assert {"label": question["why"], "value": None, "choices": question["choices"]} in said["fields"]
        page.ask("look", name="a", text=said["text"], changes=next(iter(question["choices"].values())))
        of_z = page.since_asked("look", name="a")
        assert {role["name"]: role["role"] for role in of_z["roles"]}["finger.force"] == "frames"
        frames = next(role["menu"] for role in of_z["roles"] if role["name"] == "observation.state")["frames"]
        page.ask("look", name="a", text=of_z["text"], changes=frames)
        assert page.ask("lay", name="a", text=page.since_asked("look", name="a")["text"])["type"] == "done"
        assert page.ask("open", name="a")["type"] == "done"
        opened = page.since_asked("opened")
        assert (opened["frames"]["trials"][:2], opened["array"]["columns"]) == (["episode_000000", "episode_000001"], 2)
    assert [each.array.names for each in taxel.open_all(path)] == 6 * [("a", "b")]
