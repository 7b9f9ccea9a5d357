"""Run the Python of a page, piece by piece; write what it prints and draws into the page.

    python docs/pieces.py docs/tutorial.md

What a piece prints stands in the fence of text after it, what it draws in `docs/pictures/`, linked after that.
"""

from __future__ import annotations

import contextlib
import io
import re
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import matplotlib as mpl

mpl.use("Agg")

import matplotlib.pyplot as plt
from matplotlib.figure import Figure

DOCS = Path(__file__).resolve().parent
#: A piece, what it prints, the pictures that it draws.
PIECE = re.compile(r"^```python\n(.*?)^```\n(?:\n```text\n(.*?)^```\n)?((?:\n!\[[^\n]*\n)*)", re.MULTILINE | re.DOTALL)


class Done(NamedTuple):
    """What a piece did, beside what the page says of it."""

    number: int
    printed: str
    figures: list[Figure]
    said: str | None
    pictures: list[str]


def run(page: Path) -> Iterator[Done]:
    """Run the pieces of a page in their order, in the folder in which the caller is."""
    names: dict[str, object] = {"__name__": "tutorial"}
    for number, found in enumerate(PIECE.finditer(page.read_text()), 1):
        plt.close("all")
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            exec(compile(found[1], f"{page.name}, piece {number}", "exec"), names)
        figures = [plt.figure(n) for n in plt.get_fignums()]
        yield Done(number, printed.getvalue(), figures, found[2], re.findall(r"\]\(([^)]+)\)", found[3]))
    plt.close("all")


def write(page: Path) -> None:
    """Write what the pieces print and draw into the page and beside it."""
    text, parts, at = page.read_text(), [], 0
    pieces = list(PIECE.finditer(text))
    for found, done in zip(pieces, run(page), strict=True):
        parts += [text[at : found.start()], f"```python\n{found[1]}```\n"]
        parts += [f"\n```text\n{done.printed}```\n"] if done.printed else []
        for k, figure in enumerate(done.figures):
            name = f"pictures/{page.stem}-{done.number}{'' if k == 0 else f'-{k + 1}'}.svg"
            (DOCS / "pictures").mkdir(exist_ok=True)
            with mpl.rc_context({"svg.hashsalt": "taxel", "svg.fonttype": "none"}):
                figure.savefig(DOCS / name, metadata={"Date": None}, bbox_inches="tight", facecolor="white")
            parts.append(f"\n![what piece {done.number} draws]({name})\n")
        at = found.end()
    page.write_text("".join([*parts, text[at:]]))


if __name__ == "__main__":
    for place in [Path(said).resolve() for said in sys.argv[1:]]:
        with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
            write(place)
