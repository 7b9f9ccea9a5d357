"""What the compiled part returns: JSON only as the text of a file, and no long tuple, whose parts have no names."""

import ast
from collections.abc import Iterator
from pathlib import Path

import taxel

STUB = (Path(taxel.__file__).parent / "_core.pyi").read_text(encoding="utf-8")

#: What returns JSON as text: that of a file, which is saved or read as it is, and the schemas of the page's messages.
JSON = {
    "check_encoder", "check_plain_rule", "check_readout", "check_tare", "make_plain_rule",
    "make_readout", "message_schemas", "pad_tare", "tare_of_events", "tare_of_frames", "Live.tare", "Ended.tare",
}  # fmt: skip
#: What returns another text: names and places, and lines for people.
TEXTS = {
    "clock_doubt", "instructions", "numbered_path", "ConeXCertificate.text", "ConeXFit.reason",
    "Error.argument", "Error.hint", "Live.place",
    "Panel.token", "Panel.url", "Tally.label", "WireBoard.command", "WireBoard.faults",
    "WireBoard.greeting",
}  # fmt: skip
#: The parts of a noun, which its `_parts()` gives and its `_from_parts()` takes.
PARTS = {"_Array", "_Detections", "_Events", "_Frames", "_Spikes"}
MOST = 3


def returned(stub: ast.Module) -> Iterator[tuple[str, ast.expr]]:
    """Yield the names of functions, methods and attributes with the type of their values.

    What Python passes to the compiled part is left out: protocols, and dictionaries, which have names.
    """
    for node in stub.body:
        if isinstance(node, ast.FunctionDef) and node.returns is not None:
            yield node.name, node.returns
        if isinstance(node, ast.ClassDef) and not any(
            ast.unparse(one) == "type_check_only" for one in node.decorator_list
        ):
            for member in node.body:
                if isinstance(member, ast.FunctionDef) and member.returns is not None:
                    yield f"{node.name}.{member.name}", member.returns
                elif isinstance(member, ast.AnnAssign):
                    kind = member.annotation
                    of = kind.slice if isinstance(kind, ast.Subscript) and ast.unparse(kind.value) == "Final" else kind
                    yield f"{node.name}.{ast.unparse(member.target)}", of


def of_text(stub: str) -> set[str]:
    """Return the names of what returns a text, or None in its place."""
    return {name for name, kind in returned(ast.parse(stub)) if ast.unparse(kind) in {"str", "str | None"}}


def long_tuples(stub: str) -> set[str]:
    """Return the names of what returns a tuple of more than `MOST`, alone or inside another type."""
    tree = ast.parse(stub)
    named = {ast.unparse(one.targets[0]): one.value for one in tree.body if isinstance(one, ast.Assign)}

    def is_long(kind: ast.expr) -> bool:
        for node in ast.walk(kind):
            if isinstance(node, ast.Name) and node.id in named and node.id not in PARTS and is_long(named[node.id]):
                return True
            of = node.slice if isinstance(node, ast.Subscript) and ast.unparse(node.value) == "tuple" else None
            if isinstance(of, ast.Tuple) and len(of.elts) > MOST:
                return True
        return False

    return {name for name, kind in returned(tree) if is_long(kind)}


def test_json_comes_only_as_the_text_of_a_file() -> None:
    assert of_text(STUB) == JSON | TEXTS
    assert of_text(STUB + "def added() -> str | None: ...\n") - JSON - TEXTS == {"added"}


def test_no_tuple_is_long() -> None:
    assert not long_tuples(STUB)
    added = "_Long = tuple[int, int, int, int]\nclass Added:\n    def one(self) -> list[_Long] | None: ...\n"
    assert long_tuples(STUB + added) == {"Added.one"}
