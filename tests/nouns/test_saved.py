"""What is saved as JSON: files give the same back, others differ, and another kind of file is refused by its name."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from refusal import refused

from taxel import Calibration, FormatError, Readout, Tare
from taxel._base.errors import Place
from taxel.detect import PlainRule

BEFORE = Path(__file__).parents[1] / "data" / "before"
#: Each class, a file of it, a number in it, and another number.
KINDS: list[tuple[Any, str, str, str]] = [
    (Tare, "tare.json", "20.5", "20.25"),
    (Calibration, "table.calibration.json", '"floor": 0.0', '"floor": 0.5'),
    (Readout, "touch.json", '"tau": 2.0', '"tau": 2.5'),
    (PlainRule, "rule.json", '"level": 30.0', '"level": 31.0'),
]


@pytest.mark.parametrize(("kind", "name", "number", "another"), KINDS)
def test_a_saved_file_gives_the_same_back_and_a_changed_one_another(
    kind: Any, name: str, number: str, another: str, tmp_path: Path
) -> None:
    held = kind.load(BEFORE / name)
    again = kind.load(held.save(tmp_path / name))
    assert again == held
    assert json.loads((tmp_path / name).read_text()) == json.loads(held.to_json())
    with pytest.raises(FileExistsError):
        held.save(tmp_path / name)
    text = (tmp_path / name).read_text()
    (tmp_path / name).write_text(text.replace(number, another, 1))
    other = kind.load(tmp_path / name)
    assert other != held
    assert held.save(tmp_path / name, overwrite=True).read_text() == text
    assert held != held.to_json()
    with pytest.raises(TypeError, match="unhashable"):
        hash(held)


@pytest.mark.parametrize(("kind", "name", "number", "another"), KINDS)
def test_no_json_and_another_kind_of_file_are_named(
    kind: Any, name: str, number: str, another: str, tmp_path: Path
) -> None:
    (tmp_path / "a.json").write_text("nonsense")
    with refused(FormatError, place=Place("a.json", line=1)):
        kind.load(tmp_path / "a.json")
    wrong = next(file for of, file, *_ in KINDS if of is not kind)
    with refused(FormatError, place=Place(wrong)):
        kind.load(BEFORE / wrong)
    with pytest.raises(FileNotFoundError):
        kind.load(tmp_path / "none.json")
