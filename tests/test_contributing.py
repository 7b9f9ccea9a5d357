"""The examples of CONTRIBUTING work: put where it says they do what it says."""

from __future__ import annotations

import re
from importlib import invalidate_caches
from pathlib import Path

import numpy as np
import pytest
from refusal import refused

import taxel
import taxel_studies
from taxel.recording import kinds
from taxel_studies.claims import CLAIMS, Claim

ROOT = Path(__file__).resolve().parents[1]
EXAMPLES = ROOT / "tests" / "contributing"
#: Lines of the longest example.
LONGEST = 60


def test_an_example_is_short_and_named_in_contributing() -> None:
    page = (ROOT / "CONTRIBUTING.md").read_text()
    for example in EXAMPLES.glob("*.*"):
        assert f"`tests/contributing/{example.name}`" in page
        assert len(example.read_text().splitlines()) <= LONGEST, example


def test_what_contributing_says_of_a_format_is_enough(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = (ROOT / "CONTRIBUTING.md").read_text()
    found = re.search(r'\[project\.entry-points\."(taxel\.formats)"\]\n(\w+) = "(\w+)"\n', page)
    assert found is not None
    group, name, module = found.groups()
    (tmp_path / f"{module}.py").write_text((EXAMPLES / "channel.py").read_text())
    about = tmp_path / f"{module}-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {module}\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text(f"[{group}]\n{name} = {module}\n")
    monkeypatch.syspath_prepend(tmp_path)
    invalidate_caches()
    kinds._from_elsewhere.cache_clear()
    try:
        path = tmp_path / "walk.channel"
        path.write_text("t_us force_n\n" + "".join(f"{2000 * k} {k % 7}\n" for k in range(100)))
        recording = taxel.open(path)
        assert (recording.kind, recording.frames().values[3, 0, 0]) == (name, 3.0)
        path.write_text("t_us force_n\n0 four\n")
        with refused(taxel.FormatError):
            taxel.open(path)
    finally:
        kinds._from_elsewhere.cache_clear()


def test_what_contributing_says_of_a_study_is_enough(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(taxel_studies.STUDIES, "quiet", "how many inputs an untrained neuron needs until it fires")
    monkeypatch.setattr(taxel_studies, "__path__", [*taxel_studies.__path__, str(EXAMPLES)])
    monkeypatch.setitem(CLAIMS, 300, Claim(300, "6.2", "Few weak inputs do not reach the threshold.", source="ours"))
    section = taxel_studies.load("quiet").run(tmp_path, size="toy", quiet=True)
    assert [judged["holds"] for judged in section["judgements"]] == [True]
    assert (tmp_path / "quiet" / "figure.svg").exists()


def test_what_contributing_says_of_a_recipe_is_enough() -> None:
    values = np.zeros((600, 1, 1))
    begins = range(100, 500, 100)
    for k in begins:
        values[k : k + 20] = 9.0
    frames = taxel.Frames(values, 1000 * np.arange(600), unit="N")
    recipe = taxel.detect.Recipe.load(EXAMPLES / "threshold.toml", labels=["press"])
    readout = taxel.detect.fit([taxel.detect.Example(frames, {"press": [1000 * k for k in begins]})], recipe)
    assert taxel.detect.run(readout, frames).t.tolist() == [1000 * k for k in begins]
