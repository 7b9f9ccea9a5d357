"""TOML and JSON that a stranger brings: one line that names file and place, at once, whatever they hold."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from refusal import refused_saying as refused

import taxel
from taxel import FormatError, formats
from taxel._base.documents import BY_HAND, BY_TAXEL, memory_of_json, of_json, of_toml, read_json, read_toml
from taxel.cli._recordings import assignments
from taxel.detect import PlainRule, recipes
from taxel.simulate import SceneFile

#: Every reader of a file of TOML, and of JSON.
TOML: dict[str, Callable[[Path], Any]] = {
    "layout": formats.layout.Layout.read,
    "recipe": recipes.read,
    "scene": SceneFile.open,
    "any": read_toml,
}
JSON: dict[str, Callable[[Path], Any]] = {
    "readout": taxel.Readout.load,
    "rule": PlainRule.load,
    "tare": taxel.Tare.load,
    "calibration": taxel.Calibration.load,
    "recipe": recipes.read,
    "any": read_json,
}
BAD_TOML = {
    "dots": ("a" + ".a" * 200_000 + " = 1", "line 1: a key with 200000 dots; must have at most 100"),
    "quoted dots": ("\n'a'" + '."a"' * 101 + " = 1", "line 2: a key with 101 dots"),
    "a table of dots": ("[a" + ".a" * 101 + "]", "line 1: a key with 101 dots"),
    "numbers with dots": ("1" + ".1" * 101 + " = 1", "line 1: a key with 101 dots"),
    "inline": ("b = {a" + ".a" * 101 + " = 1}", "line 1: a key with 101 dots"),
    "behind a text": ('b = """\n\\"""\n"""\na' + ".a" * 101 + " = 1", "line 4: a key with 101 dots"),
    "lists": ("a = " + "[" * 100_000, "nested too deeply"),
    "closed lists": ("a = " + "[" * 70 + "]" * 70, "nested too deeply; must have at most 64"),
    "tables": ("a = " + "{b = " * 5000, "nested too deeply"),
    "digits": ("a = " + "9" * 5000, "not TOML: .*4300"),
    "long": ("# " + "x" * BY_HAND, "more than 1048576 bytes|must have at most 1048576"),
    "twice": ("a = 1\na = 2", "not TOML"),
    "nothing": ("a = ", "not TOML"),
}
BAD_JSON = {
    "bare lists": ("[" * 100_000, "nested too deeply|not a JSON object: begins with '\\['"),
    "lists": ('{"a": ' + "[" * 100_000, "nested too deeply"),
    "closed lists": ('{"a": ' + "[" * 70 + "]" * 70 + "}", "nested too deeply; must have at most 64"),
    "objects": ('{"a": ' * 100_000, "nested too deeply"),
    "digits": ('{"a": ' + "9" * 5000 + "}", "not JSON: .*4300"),
    "nan": ('{"a": NaN}', "not JSON: NaN is not a number"),
    "infinity": ('{"a": -Infinity}', "not JSON: -Infinity is not a number"),
    "twice": ('{"b": 1, "a": {"c": 1, "c": 2}}', "not JSON: 'c' appears twice"),
    "half": ('{"a": 1', "not JSON"),
    "empty": ("", "not (a )?JSON"),
}


@pytest.mark.timeout(60)
@pytest.mark.parametrize("reader", TOML)
@pytest.mark.parametrize("fault", BAD_TOML)
def test_bad_toml_is_one_line_with_the_file(reader: str, fault: str, tmp_path: Path) -> None:
    text, said = BAD_TOML[fault]
    (path := tmp_path / "a.toml").write_text(text)
    with refused(said, FormatError) as caught:
        TOML[reader](path)
    assert str(caught.value).startswith(str(path))


@pytest.mark.timeout(60)
@pytest.mark.parametrize("reader", JSON)
@pytest.mark.parametrize("fault", BAD_JSON)
def test_bad_json_is_one_line_with_the_file(reader: str, fault: str, tmp_path: Path) -> None:
    text, said = BAD_JSON[fault]
    (path := tmp_path / "a.json").write_text(text)
    with refused(said, FormatError) as caught:
        JSON[reader](path)
    assert str(caught.value).startswith(str(path))


@pytest.mark.parametrize(("reader", "ending"), [(one, "toml") for one in TOML] + [(one, "json") for one in JSON])
def test_what_is_not_utf_8_names_the_byte(reader: str, ending: str, tmp_path: Path) -> None:
    (path := tmp_path / f"a.{ending}").write_bytes(b"# \xff")
    with refused("byte 2: not text in UTF-8", FormatError):
        (TOML if ending == "toml" else JSON)[reader](path)


def test_what_is_too_long_is_refused_by_what_it_is(tmp_path: Path) -> None:
    (path := tmp_path / "a.json").write_text('{"a": "' + "x" * BY_HAND + '"}')
    with refused("more than 1048576 bytes", FormatError):
        recipes.read(path)
    with refused("not JSON|is missing|tare", FormatError) as caught:
        taxel.Tare.load(path)
    assert "bytes" not in str(caught.value)
    with path.open("wb") as file:
        file.truncate(BY_TAXEL + 1)
    for read in (taxel.Tare.load, taxel.Calibration.load, taxel.Readout.load):
        with refused(f"more than {BY_TAXEL} bytes", FormatError):
            read(path)


@pytest.mark.parametrize("kind", [taxel.Tare, taxel.Calibration, taxel.Readout])
def test_what_taxel_did_not_write_is_refused_before_it_is_parsed(
    kind: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: Any, **__: Any) -> None:
        raise AssertionError("parsed")

    path = tmp_path / "a.json"
    monkeypatch.setattr("taxel._base.documents.json.loads", fail)
    for text, why in {
        "[" + "1," * 1000 + "1]": "not a JSON object: begins with '\\['",
        " \n\t7": "not a JSON object: begins with '7'",
        "": "not a JSON object: empty",
        '{"a":[' + "1," * 42_000_000 + "1]}": r"would take \d+ bytes of memory; at most 2147483648 are read",
    }.items():
        path.write_text(text)
        with refused(why, FormatError):
            kind.load(path)


def test_a_setting_is_read_as_a_file_is() -> None:
    assert assignments(["a.b=[1.5, 2.5]", "c=plain text", "d='x'"]) == {"a.b": [1.5, 2.5], "c": "plain text", "d": "x"}
    with refused("--set a: nested too deeply", FormatError):
        assignments(["a=" + "[" * 70 + "]" * 70])
    with refused("--set a, line 1: a key with 101 dots", FormatError):
        assignments(["a={b" + ".b" * 101 + "=1}"])
    with refused("--set a: .* characters", FormatError):
        assignments(["a='" + "x" * BY_HAND + "'"])


def test_a_line_of_many_numbers_or_texts_with_dots_is_no_key(tmp_path: Path) -> None:
    x = [k + 0.5 for k in range(4096)]
    path = tmp_path / "a.layout.toml"
    path.write_text(f"# {'.' * 500}\nrows = 64\ncolumns = 64\nunit = '{'.' * 300}'\n[places]\nx = {x}\ny = {x[::-1]}\n")
    assert formats.layout.Layout.read(path).places.x.tolist() == x


def test_what_taxel_writes_for_four_million_taxels_loads(tmp_path: Path) -> None:
    """A tare holds the rest and the noise of each taxel: the largest sensor of a file has 2048 x 2048."""
    one = json.dumps([1 / 3] * 1000)
    assert 2 * (1 << 22) * (len(one) / 1000) < BY_TAXEL
    assert 3 * (1 << 22) * (memory_of_json(one) / 1000) < 1 << 31
    rng = np.random.default_rng(1)
    tare = taxel.Tare.take(taxel.Frames(rng.random((3, 300, 300)), [0, 100, 200]))
    assert tare.save(tmp_path / "tare.json").stat().st_size > BY_HAND
    assert taxel.Tare.load(tmp_path / "tare.json") == tare


KEYS = st.text("ab_-1", min_size=1, max_size=3)
VALUES = st.recursive(
    st.one_of(st.integers(-(2**63), 2**63 - 1), st.floats(allow_nan=False, allow_infinity=False), st.text(max_size=5)),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(KEYS, inner, max_size=3),
    max_leaves=10,
)


@given(st.dictionaries(KEYS, VALUES, max_size=4))
def test_json_is_read_as_python_reads_it(values: dict[str, Any]) -> None:
    text = json.dumps(values)
    assert of_json("a", text) == json.loads(text)


@given(st.text("abc.=[]{}'\"#\n\\ 1,-", max_size=60))
def test_toml_is_read_as_python_reads_it_or_refused_as_python_does(text: str) -> None:
    try:
        expected = tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        with pytest.raises(FormatError, match="not TOML"):
            of_toml("a", text)
    else:
        assert of_toml("a", text) == expected
