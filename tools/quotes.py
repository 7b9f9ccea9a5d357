"""Refuses tests that quote the sentence of an error: `pytest.raises(..., match=)`, and comparisons with `str(error)`.

Tests assert class, argument and place (tests/refusal.py); a sentence stands once, in tests/messages.
"""

import ast
import builtins
import re
import sys
from collections.abc import Iterator
from pathlib import Path

TESTS = Path(__file__).parents[1] / "tests"
#: Rooms whose tests quote sentences yet.
YET = {"detect", "formats", "live", "panel", "recording", "tasks"}
ERROR = re.compile(r"\bstr\((error|\w+\.value)\)")


def quotes(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Yield where a sentence is quoted, and how."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Assert) and ERROR.search(ast.unparse(node)):
            texts = [part.value for part in ast.walk(node) if isinstance(part, ast.Constant)]
            if any(re.search(r"\w", str(text)) for text in texts if isinstance(text, str)):
                yield node.lineno, "compares the sentence of an error"
        if isinstance(node, ast.Call) and ast.unparse(node.func) == "pytest.raises":
            is_of_python = isinstance(node.args[0], ast.Name) and hasattr(builtins, node.args[0].id)
            if not is_of_python and any(keyword.arg == "match" for keyword in node.keywords):
                yield node.lineno, "matches the sentence of an error"


def main() -> None:
    """Print each place, and end with 1 if there is one."""
    found = []
    for path in sorted(TESTS.rglob("*.py")):
        name = path.relative_to(TESTS)
        if name.parts[0] not in YET | {"messages", "refusal.py", "test_errors.py"}:
            found += [f"tests/{name}:{line}: {how}" for line, how in quotes(ast.parse(path.read_text()))]
    for place in found:
        print(f"{place}; assert class, argument and place by tests/refusal.py, the sentence in tests/messages")
    sys.exit(bool(found))


if __name__ == "__main__":
    main()
