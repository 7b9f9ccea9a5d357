"""The example of CONTRIBUTING works: installed beside taxel it gives a format."""

from __future__ import annotations

import re
from importlib import invalidate_caches
from pathlib import Path

import pytest

import taxel
from taxel.recording import opening

ROOT = Path(__file__).resolve().parents[1]


def test_what_contributing_says_of_a_format_is_enough(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = (ROOT / "CONTRIBUTING.md").read_text()
    found = re.search(r'\[project\.entry-points\."(.*)"\]\n(\w+) = "(\w+)"\n', page)
    assert found is not None
    group, name, module = found.groups()
    (tmp_path / f"{module}.py").write_text((ROOT / "tests" / "contributing" / "channel.py").read_text())
    about = tmp_path / f"{module}-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {module}\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text(f"[{group}]\n{name} = {module}\n")
    monkeypatch.syspath_prepend(tmp_path)
    invalidate_caches()
    opening._from_elsewhere.cache_clear()
    try:
        path = tmp_path / "walk.channel"
        path.write_text("t_us force_n\n" + "".join(f"{2000 * k} {k % 7}\n" for k in range(100)))
        recording = taxel.open(path)
        assert (recording.kind, recording.frames().values[3, 0, 0]) == (name, 3.0)
        path.write_text("t_us force_n\n0 four\n")
        with pytest.raises(taxel.FormatError, match=r"walk\.channel"):
            taxel.open(path)
    finally:
        opening._from_elsewhere.cache_clear()
