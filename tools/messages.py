"""Make the types of the page's messages, and the options of `Live`, from the structs in Rust (`make messages`).

Usage: python tools/messages.py [--check]. The built extension gives their schemas (crates/taxel-panel/src/protocol/messages.rs and
request.rs, crates/taxel-live/src/pipeline/options.rs). With --check no file is written, and the status is 1 where one differs (`make lint`).
"""

from __future__ import annotations

import json
import re
import sys
import textwrap
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from taxel import _core

ROOT = Path(__file__).resolve().parents[1]
HEAD = "Made from the structs of crates/taxel-panel by tools/messages.py (`make messages`): edit those."
PAGE = "crates/taxel-panel/web/messages.d.ts"
STRUCT = "crates/taxel-live/src/pipeline/options.rs"
OPTIONS, LIVE = "python/taxel/live/_stated_options.py", "python/taxel/live/live.py"
Schema = dict[str, Any]


class Language:
    """Types of a language: the words for those of JSON, and how they are combined."""

    def __init__(
        self,
        words: dict[str, str],
        either: str,
        listed: Callable[[str], str],
        pair: Callable[[list[str]], str],
        by_name: Callable[[str], str],
        literals: Callable[[list[str]], str],
    ) -> None:
        self.words, self.either, self.listed, self.pair = words, either, listed, pair
        self.by_name, self.literals = by_name, literals

    def type(self, schema: Schema | bool) -> str:  # noqa: PLR0911  a line for each kind of schema
        """Return the type of a schema."""
        if isinstance(schema, bool):
            return self.words["anything"]
        match schema:
            case {"$ref": name}:
                return self.words["reference"].format(name.rpartition("/")[2])
            case {"const": word}:
                return self.literals([word])
            case {"enum": words}:
                kinds = [self.literals([word for word in words if word is not None])]
                return self.either.join(kinds + [self.words["null"]] * (None in words))
            case {"oneOf": schemas} if not any("type" in one and one["type"] == "object" for one in schemas):
                return self.literals([word for one in schemas for word in one.get("enum", [one.get("const")])])
            case {"anyOf": schemas}:
                return self.either.join(dict.fromkeys(self.type(one) for one in schemas))
            case {"type": [*kinds]}:
                return self.either.join(dict.fromkeys(self.type(schema | {"type": kind}) for kind in kinds))
            case {"type": "array", "prefixItems": items}:
                return self.pair([self.type(item) for item in items])
            case {"type": "array", "items": items}:
                return self.listed(self.type(items))
            case {"type": "object", "additionalProperties": dict() | True as values}:
                return self.by_name(self.type(values))
            case {"type": kind}:
                return self.words[kind]
        return self.words["anything"]


TYPESCRIPT = Language(
    {"integer": "number", "number": "number", "string": "string", "boolean": "boolean", "null": "null"}
    | {"anything": "unknown", "reference": "{}"},
    " | ",
    lambda item: f"({item})[]" if "|" in item else f"{item}[]",
    lambda items: f"[{', '.join(items)}]",
    lambda value: f"Record<string, {value}>",
    lambda words: " | ".join(json.dumps(word) for word in words),
)
PYTHON = Language(
    {"integer": "int", "number": "float", "string": "str", "boolean": "bool", "null": "None"}
    | {"anything": "Any", "reference": "{}"},
    " | ",
    lambda item: f"list[{item}]",
    lambda items: f"list[{' | '.join(dict.fromkeys(items))}]",
    lambda value: f"dict[str, {value}]",
    lambda words: f"Literal[{', '.join(json.dumps(word) for word in words)}]",
)


def named(word: str) -> str:
    """Return the name of a message's type."""
    return "".join(part.capitalize() for part in word.split("_"))


def variants(schema: Schema) -> dict[str, Schema]:
    """Return the schemas of requests or messages by their `type`."""
    return {one["properties"]["type"]["const"]: one for one in schema["oneOf"]}


def keys(schema: Schema) -> Iterator[tuple[str, Schema, bool]]:
    """Yield name, schema, and whether it is required, of each key but `type`; those that are required first."""
    required = [name for name in schema.get("required", ()) if name != "type"]
    others = [name for name in schema["properties"] if name != "type" and name not in required]
    for name in (*required, *others):
        yield name, schema["properties"][name], name in required


def comment(schema: Schema) -> str:
    """Return what a schema says of itself, in one line."""
    return " ".join(schema.get("description", "").split())


def interface(name: str, schema: Schema) -> str:
    """Write an object as an interface of TypeScript."""
    kind = schema["properties"].get("type", {}).get("const")
    lines = [f'  type: "{kind}";'] if kind else []
    if name.endswith("Request"):
        lines.append("  id?: number;")
    for key, one, required in keys(schema):
        text = f"  /** {comment(one)} */\n" if comment(one) else ""
        lines.append(f"{text}  {key}{'' if required else '?'}: {TYPESCRIPT.type(one)};")
    about = f"/** {comment(schema)} */\n" if comment(schema) else ""
    return f"{about}export interface {name} {{\n" + "\n".join(lines) + "\n}\n"


def page(requests: Schema, messages: Schema) -> str:
    """Write the types of the page."""
    parts = requests["$defs"] | messages["$defs"]
    written = [interface(name, one) for name, one in parts.items()]
    written += [interface(named(kind), one) for kind, one in variants(messages).items()]
    written += [interface(named(kind) + "Request", one) for kind, one in variants(requests).items()]
    every = [
        f"export type {union} =\n  | " + "\n  | ".join(named(kind) + ending for kind in variants(schema)) + ";\n"
        for union, ending, schema in (("Message", "", messages), ("Request", "Request", requests))
    ]
    return f"// {HEAD}\n\n" + "\n".join(written + every)


def between(text: str, begin: str, end: str, made: str) -> str:
    """Return a text with another part between two marks."""
    before, _, rest = text.partition(begin)
    return f"{before}{begin}{made}{end}{rest.partition(end)[2]}"


def in_order(schema: Schema) -> list[tuple[str, Schema]]:
    """Return the options by name, in the order of the struct, which a schema has not."""
    order = re.findall(r"^        (\w+): .* = ", (ROOT / STRUCT).read_text("utf-8"), re.MULTILINE)
    return sorted(schema["properties"].items(), key=lambda one: order.index(one[0]) if one[0] in order else len(order))


def in_python(schema: Schema) -> str:
    """Return the type of an option in Python."""
    return schema.get("python") or PYTHON.type(schema)


def stated(name: str, schema: Schema) -> str:
    """Write an option as a field: type, default, help, range, and what the command line reads."""
    kind, default = in_python(schema), schema.get("default")
    default = None if "None" in kind else () if default == [] else default
    # The first paragraph is the help.
    parts = textwrap.wrap(" ".join(schema["description"].split("\n\n")[0].split()), 109, drop_whitespace=False)
    lines = [repr(default) if not isinstance(default, str) else json.dumps(default)]
    lines += ["\n        ".join(repr(part) if '"' in part else json.dumps(part) for part in parts)]
    lines += [f"{key}={schema[word]:_}" for key, word in (("least", "minimum"), ("most", "maximum")) if word in schema]
    words = ("commands", "flag", "metavar", "typed")
    lines += [f"{key}={json.dumps(schema[key])}" for key in words if key in schema]
    # As ruff breaks lines.
    head, inside = f"    {name}: {kind} = option(", ", ".join(lines)
    if len(parts) > 1 or len(inside) > 112:
        inside = "".join(f"\n        {line}," for line in lines) + "\n    "
    elif len(head) + len(inside) > 119:
        inside = f"\n        {inside}\n    "
    return f"{head}{inside})\n"


def options(schema: Schema) -> str:
    """Write the options of `Live` as a dataclass; the first is positional too."""
    first, *others = [stated(name, one) for name, one in in_order(schema)]
    return f'''"""The options of a `Live` that Rust reads too.

{HEAD.replace("taxel-panel", "taxel-live")}
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass

from taxel._base.options import option
from taxel.array import Array
from taxel.detect import PlainRule, Readout
from taxel.tare import Tare
from taxel.wire import Registers

__all__ = ["StatedOptions"]


@dataclass(frozen=True)
class StatedOptions:
    """Hold the options of a `Live`, which documents each, with their defaults."""

{first}    _: KW_ONLY
{"".join(others)}'''


#: The words of docstrings for types of Python.
DOCUMENTED = {
    "str | os.PathLike[str]": "path",
    "str | Sequence[str]": "str or sequence of str",
    "Mapping[str, str]": "mapping of str to str",
    " | ": " or ",
}


def documented(name: str, schema: Schema) -> str:
    """Write an option as an entry of a docstring."""
    kind, least, most = in_python(schema), schema.get("minimum"), schema.get("maximum")
    optional = ", optional" * kind.endswith(" | None")
    kind = kind.removesuffix(" | None")
    for written, word in DOCUMENTED.items():
        kind = kind.replace(written, word)
    within = "" if least is None else f", {least} or more" if most is None else f", {least} to {most}"
    about = textwrap.fill(comment(schema), 120, initial_indent=" " * 8, subsequent_indent=" " * 8)
    return f"    {name} : {kind}{within}{optional}\n{about}\n"


def live(schema: Schema, root: Path = ROOT) -> str:
    """Return the module of `Live` with its docstring's parameters made anew."""
    text, end = (root / LIVE).read_text("utf-8"), "    say : callable, optional\n"
    entries = "".join(documented(name, one) for name, one in in_order(schema))
    return between(text, "    Parameters\n    ----------\n", end, entries)


def made(schemas: dict[str, Schema], root: Path = ROOT) -> dict[Path, str]:
    """Return the text of each file that is made."""
    both, of_live = (schemas["requests"], schemas["messages"]), schemas["options"]
    texts = {PAGE: page(*both), OPTIONS: options(of_live), LIVE: live(of_live, root)}
    return {root / name: text for name, text in texts.items()}


def main() -> int:
    """Write every file, or compare."""
    texts = made(json.loads(_core.message_schemas()))
    if "--check" not in sys.argv[1:]:
        for path, text in texts.items():
            path.write_text(text, "utf-8")
        return 0
    old = [
        path.relative_to(ROOT) for path, text in texts.items() if not path.exists() or path.read_text("utf-8") != text
    ]
    for path in old:
        print(f"{path}: is not what the structs in Rust give; run make messages")
    return int(bool(old))


if __name__ == "__main__":
    sys.exit(main())
