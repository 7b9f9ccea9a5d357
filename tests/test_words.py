"""`tools/words.py` finds words that the house no longer uses, where people read them, and nothing else."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest

TOOL = runpy.run_path(str(Path(__file__).parents[1] / "tools" / "words.py"))
#: A sentence for each pattern, in the order of the patterns.
EXAMPLES = (
    "Of a board nothing is known.",
    "What a file lacks is an error.",
    "No loss is told.",
    "The board was heard.",
    "The loss is said.",
    "The time lies before the start.",
    "The command goes to the board.",
    "The text is read anew.",
    "The file is no recording.",
    "The data at hand are few.",
    "A layout comes along with the file.",
    "An empty list is used in the place of none.",
    "It runs in a process of its own.",
    "The board sends this one.",
    "Events count from 0 on.",
    "The name stands in the first line.",
    "Training brings nothing.",
    "No unit is to be had.",
    "All is read but for the last line.",
    "Commas and the like are refused.",
    "The file and the lines thereof.",
    "The rate is 40 mb/event.",
)
CLEAN = """\
From now on there is no sensor; there are no more frames, it is no better, and v stands for a version,
so that one of them is each one of the two. What is this recording? What happens next?
Read the options. The frames of a board begin at 0.
"""


def found(path: Path, written: str) -> list[str]:
    path.write_text(written)
    return list(TOOL["findings"](path))


@pytest.mark.parametrize(("pattern", "example"), [*zip(TOOL["WORDS"], EXAMPLES, strict=True)])
def test_each_pattern_finds_its_example(tmp_path: Path, pattern: str, example: str) -> None:
    for name, written in ("a.md", f"Clean.\n{example}\n"), ("a.py", f'"""Clean.\n\n{example}\n"""\n'):
        lines = found(tmp_path / name, written)
        assert any(line.endswith(f"write: {TOOL['WORDS'][pattern]}") for line in lines), (name, lines)


def test_a_clean_sentence_passes(tmp_path: Path) -> None:
    assert not found(tmp_path / "a.md", CLEAN)


def test_code_is_skipped(tmp_path: Path) -> None:
    """Blocks and words of code are skipped in pages, and names and comments in programs."""
    bad = EXAMPLES[0]
    assert not found(tmp_path / "a.md", f"```text\n{bad}\n```\n\nThe line `{bad}` is quoted.\n")
    assert not found(tmp_path / "a.py", f"anew = 1  # {bad}\n")
    [line] = found(tmp_path / "b.md", f"```text\n{bad}\n```\n{bad}\n")
    assert ":4: " in line


def test_texts_of_rust_are_read_over_several_lines(tmp_path: Path) -> None:
    """Without what is computed in them, and without characters that look like the beginning of a text."""
    [line] = found(
        tmp_path / "a.rs",
        f'// {EXAMPLES[7]}\nlet a = (\'"\', r#"{EXAMPLES[7]}"#);\nlet b = "{{told}}: it is \\\n    {EXAMPLES[7]}";\n',
    )
    assert ":3: " in line


def test_texts_of_the_page_are_read(tmp_path: Path) -> None:
    assert len(found(tmp_path / "a.js", f'// {EXAMPLES[0]}\nconst told = "{EXAMPLES[7]}";\n')) == 1
    assert len(found(tmp_path / "b.js", f"const text = `\n${{told}} is the\n{EXAMPLES[7]}`;\n")) == 1
    assert len(found(tmp_path / "a.html", f'<p title="anew thing">{EXAMPLES[7]}</p>\n')) == 1
