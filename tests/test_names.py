"""Names are nouns: no preposition, determiner or pronoun names a value, and a class name stands for one class."""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
REFUSED = ("of", "one", "own", "other", "every", "whole", "mine", "theirs", "its", "what", "which")
MODULES = {
    str(file.relative_to(ROOT)): ast.parse(file.read_text())
    for file in sorted((ROOT / "python" / "taxel").glob("**/*.py"))
}
PAGE = sorted((ROOT / "crates" / "taxel-panel" / "web").glob("*.js"))

_NAME = rf"(?:{'|'.join(REFUSED)})\b"
_COMMENT = re.compile(r"/\*.*?\*/|(?<=\s)//[^\n]*|^//[^\n]*", re.DOTALL | re.MULTILINE)
#: A variable or function, a parameter or part of one, a method, an attribute.
_DECLARED = re.compile(
    rf"\b(?:const|let|var|function|class|get|set|static)\s+#?({_NAME})"
    rf"|[({{,\[]\s*(?:\.\.\.)?({_NAME})\s*(?:=(?!=)|[,)}}\]:]|=>)"
    rf"|:\s*({_NAME})\s*[,}}]"
    rf"|^\s*(?:async\s+)?#?({_NAME})\s*\([^)\n]*\)\s*\{{"
    rf"|\bthis\.#?({_NAME})\s*=(?!=)"
    rf"|(?<![.\w])({_NAME})\s*=>",
    re.MULTILINE,
)


def python_names(tree: ast.AST) -> Iterator[tuple[str, int]]:
    """Yield the names that a module gives to values, functions and attributes, each with its line.

    Python itself calls the second operand of an operator `other`.
    """
    operands = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            yield node.name, node.lineno
            if isinstance(node, ast.FunctionDef) and node.name.startswith("__"):
                operands |= {id(argument) for argument in node.args.args if argument.arg == "other"}
        elif isinstance(node, ast.arg) and id(node) not in operands:
            yield node.arg, node.lineno
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.id, node.lineno
        elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
            yield node.attr, node.lineno
        elif isinstance(node, ast.Import | ast.ImportFrom):
            yield from ((alias.asname, node.lineno) for alias in node.names if alias.asname)
        elif isinstance(node, ast.ExceptHandler | ast.MatchAs | ast.MatchStar) and node.name:
            yield node.name, node.lineno


def page_names(text: str) -> Iterator[tuple[str, int]]:
    """Yield the refused names that a module of the page declares, each with its line."""
    code = _COMMENT.sub(lambda comment: "\n" * comment[0].count("\n"), text)
    for match in _DECLARED.finditer(code):
        yield next(filter(None, match.groups())), code.count("\n", 0, match.end()) + 1


@pytest.mark.parametrize("module", MODULES)
def test_a_name_in_python_is_a_noun(module: str) -> None:
    found = [f"line {line}: {name}" for name, line in python_names(MODULES[module]) if name in REFUSED]
    assert not found, f"{module}: {', '.join(found)}"


@pytest.mark.parametrize("file", PAGE, ids=lambda file: file.name)
def test_a_name_on_the_page_is_a_noun(file: Path) -> None:
    found = [f"line {line}: {name}" for name, line in page_names(file.read_text())]
    assert not found, f"{file.name}: {', '.join(found)}"


@pytest.mark.parametrize(
    "line",
    [
        "const mine = 1;", "let [a, its] = pair;", "const { kind: what } = item;", "for (const own of all) {}",
        "f((one) => one + 1);", "f(every => every + 1);", "this.whole = 1;", "  other(a, b) {", "function which(a) {}",
        "draw(timeline, { raster: what, spikes }) {", "const of = 1;",
    ],
)  # fmt: skip
def test_the_page_is_searched_for_each_kind_of_declaration(line: str) -> None:
    assert list(page_names(line))


def test_a_class_name_is_defined_once() -> None:
    defined = defaultdict(list)
    for module, tree in MODULES.items():
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef):
                defined[node.name].append(f"{module}, line {node.lineno}")
    twice = {name: where for name, where in defined.items() if len(where) > 1}
    assert not twice, twice
