"""Find words and openings that the house no longer uses, in docs, messages, docstrings and texts of the page (`make lint`).

Usage: python tools/words.py [PATH...]. Each finding is a line: place, words, and what to write instead; the status is 1 if there are any.
Code blocks of docs are not checked, nor the protected pages: the readings, the specifications of the wires, and generated pages.
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PROTECTED = {"readings.md", "wire.md", "wire-v2.md", "registers.md", "terms.md", "measured.md", "CHANGELOG.md"}
SOURCES = (
    "*.md",
    "docs/*.md",
    "python/**/*.py",
    "python/**/*.j2",
    "crates/*/src/**/*.rs",
    "crates/taxel-panel/web/*.js",
    "crates/taxel-panel/web/*.html",
)
#: Comments, characters and texts of Rust and of the page's modules, of which the texts are read.
RUST = re.compile(
    r"""//[^\n]*|/\*.*?\*/|'(?:\\.|[^'\\])'|r(?P<hashes>\#+)".*?"(?P=hashes)|"(?P<text>(?:[^"\\]|\\.)*)\"""", re.DOTALL
)
SCRIPT = re.compile(
    r"""//[^\n]*|/\*.*?\*/|(?P<quote>["`])(?P<text>(?:(?!(?P=quote))[^\\]|\\.)*)(?P=quote)""", re.DOTALL
)
#: The beginning of a sentence.
BEGIN = r"(?:^|(?<=[.:;] ))"
#: Patterns that the house no longer uses, each with what to write instead.
WORDS = {
    rf"{BEGIN}Of (?:an?|the|each|what|which|its|two|several|all|such|those|every)\b": "begin with the subject",
    rf"{BEGIN}What (?!is this|does\b|do\b|happens\b)[^?]*$": "begin with the name of the thing",
    r"\btold\b": "reported, printed; distinguished",
    r"\bheard\b": "received, detected",
    r"\b(?:is|are|be|was|were|as|which) said\b": "printed, reported, stated",
    r"\blies?\b": "is, are",
    r"\b(?:goes|went) (?:on|by|into|to|with|away)\b": "continues, is sent, is used",
    r"\banew\b": "again",
    r"\b(?<![Tt]here )(?:is|are|was|were) no (?!more|longer|less|later|earlier|better|worse|larger|smaller)\w": "is not a",
    r"\bat hand\b": "available",
    r"\bcomes? along\b": "is included",
    r"\bin the place of\b": "instead of",
    r"\bof (?:its|their|his|an) own\b|\bown one\b": "separate; its",
    r"\b(?:other|another|this|(?<!so )that|each) one\b(?! of)": "name the thing",
    r"\bfrom (?!(?:now|then) on)[\w.]+(?: \w+)? on\b": "after, since, ... or later",
    r"\bstands?\b(?! for)": "is",
    r"\bbrings?\b": "gives, adds",
    r"\bto be had\b|\bbe had\b": "available",
    r"\bbut for\b": "except",
    r"\b(?:and|or) the like\b": "and similar",
    r"\b(?:thereof|therein|thereby|hence|whereby)\b": "name the thing",
    r"\bmb/event\b": "millibits per event",
}


def texts(path: Path) -> Iterator[tuple[int, str]]:
    """Yield the texts of a file that people read, with the number of the line where each begins."""
    written = path.read_text("utf-8")
    if path.suffix == ".md":
        prose = re.sub(r"^```.*?^```|`[^`\n]*`", lambda code: "\n" * code[0].count("\n"), written, flags=re.M | re.S)
        yield 1, prose
    elif path.suffix == ".py":
        for node in ast.walk(ast.parse(written)):
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and " " in node.value:
                yield node.lineno, re.sub(r"`[^`\n]*`", "", node.value)
    elif path.suffix in (".html", ".j2"):
        yield 1, re.sub(r"\{[{%].*?[}%]\}|<[^>]*>", lambda code: "\n" * code[0].count("\n"), written)
    else:
        for found in (SCRIPT if path.suffix == ".js" else RUST).finditer(written):
            if " " in (text := found["text"] or ""):
                # What is computed in a text, and a line of Rust that continues on the next.
                text = re.sub(r"\$?\{[^{}]*\}", "", re.sub(r"\\\n *", "", text))
                yield written.count("\n", 0, found.start()) + 1, text


def findings(path: Path) -> Iterator[str]:
    """Yield the findings of a file, a line each."""
    place = path.relative_to(ROOT) if path.is_relative_to(ROOT) else path
    for begin, text in texts(path):
        for number, line in enumerate(text.splitlines(), begin):
            for pattern, better in WORDS.items():
                for found in re.finditer(pattern, line):
                    yield f"{place}:{number}: {found[0][:40]!r}: write: {better}"


def main() -> int:
    """Print the findings."""
    named = [Path(name).resolve() for name in sys.argv[1:]]
    paths = named or sorted(path for pattern in SOURCES for path in ROOT.glob(pattern) if path.name not in PROTECTED)
    found = [line for path in paths for line in findings(path)]
    print("\n".join(found))
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
