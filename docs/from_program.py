"""Parts of the documentation that are made from the program: claims, figures, options, keys, requests, causes, names.

A page asks for them by directives: ``.. claims::``, ``.. studies::``, ``.. commands::``, ``.. keys::``,
``.. requests::``, ``.. causes::``, ``.. registers:: TABLE`` and ``.. names:: MODULE``.
"""

from __future__ import annotations

import importlib
import inspect
import json
import re
import tomllib
from pathlib import Path
from types import ModuleType
from typing import Any

import msgspec.inspect
from docutils import nodes
from docutils.parsers.rst import Directive
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from sphinx.pycode import ModuleAnalyzer

from taxel._core import causes, registers_fields, registers_preset
from taxel.cli._commands import OWN, plugins
from taxel.cli._commands import command as imported
from taxel.cli.app import about, own_commands, rows
from taxel.panel import requests
from taxel.wire import PRESETS
from taxel_studies import STUDIES
from taxel_studies.claims import CLAIMS, ERRATA, Verdict, summed, verdicts

ROOT = Path(__file__).resolve().parents[1]
READINGS = ROOT / "docs" / "readings.md"
FIGURES = ROOT / "benchmarks" / "results" / "figures"
KEYS = ROOT / "python" / "taxel" / "panel" / "web" / "keys.js"
REGISTERS = ROOT / "registers.toml"
KEY = r'shown: "([^"]+)", text: "([^"]+)"'
#: Characters; the values of longer constants are not shown.
LONGEST_VALUE = 80
VERDICTS = {True: "holds", False: "**does not hold**", None: "not judged"}


class FromProgram(Directive):
    """Parse the lines that a subclass makes, sections and all."""

    def lines(self) -> list[str]:
        """Return reStructuredText."""
        raise NotImplementedError

    def run(self) -> list[nodes.Node]:
        """Give what the lines say."""
        node = nodes.section()
        node.document = self.state.document
        content = StringList(self.lines(), source="made by the program")
        self.state.nested_parse(content, self.content_offset, node, match_titles=1)
        return node.children


class Claims(FromProgram):
    """Every claim of the thesis with its judgements, chapter by chapter; what contradicts the thesis itself."""

    def lines(self) -> list[str]:
        """Return a section a chapter."""
        self.state.document.settings.env.note_dependency(str(FIGURES))
        self.state.document.settings.env.note_dependency(str(READINGS))
        found = verdicts(one for section in sections() for one in section["judgements"])
        refuse(found, READINGS.read_text())
        lines = [f"Of the claims of the thesis {summed(found)}.", ""]
        chapters = dict.fromkeys(one.claim.at[0] for one in found)
        parts = {f"Chapter {n}": [v for v in found if v.claim.at[0] == n and not v.claim.source] for n in chapters}
        for title, here in {**parts, "Claims of other papers, and ours": [v for v in found if v.claim.source]}.items():
            head = ["", "claim", "main reading", "others", "ours", "why"]
            lines += [*heading(title), *table(head, [row(one) for one in here], "5 27 13 7 28 20")]
        rows = [[f"{one['at']}, T{one['line']}", one["prints"], one["instead"]] for one in ERRATA]
        return [*lines, *heading("Errata of the thesis"), *table(["where", "prints", "instead"], rows, "20 40 40")]


def refuse(found: list[Verdict], readings: str) -> None:
    """Stop the build at a claim that no study judges, and at a line that fixes a main reading but is no reading."""
    unjudged = [one.claim.number for one in found if not (one.main or one.others)]
    stated = {int(line) for line in re.findall(r"\bT(\d+)", readings)}
    unstated = sorted({line for claim in CLAIMS.values() for line in claim.fixed} - stated)
    if unjudged or unstated:
        raise ValueError(f"claims without a judgement: {unjudged}; lines that docs/readings.md lacks: {unstated}")


def row(one: Verdict) -> list[str]:
    """Return a claim's row: number, claim, verdict in the main reading, in how many others it holds, ours, why."""
    claim, shown = one.claim, [one.main] if one.main else one.others
    says = f"{claim.says} ({claim.where}{f'; {claim.value}' if claim.value else ''})"
    verdict = "no line fixes one" if claim.open else VERDICTS[one.main["holds"]] if one.main else "not run"
    main = verdict + (f": {claim.main} ({', '.join(f'T{line}' for line in claim.fixed)})" if claim.main else "")
    ours = [f"{j['reading']}: {j['ours']}" if j["reading"] and j is not one.main else j["ours"] for j in shown]
    why = [claim.open, *dict.fromkeys(j["why"] for j in shown)]
    return [str(claim.number), says, main, one.beside, "; ".join(ours), "; ".join(filter(None, why))]


class Studies(FromProgram):
    """Every study that was kept: pictures, judgements, the command, the numbers."""

    def lines(self) -> list[str]:
        """Return a section a study."""
        self.state.document.settings.env.note_dependency(str(FIGURES))
        kept = sections()
        return [*times(kept), *(line for section in kept for line in study(section))]


def sections() -> list[dict[str, Any]]:
    """Return what was kept of each study."""
    files = [FIGURES / f"{name}.json" for name in STUDIES]
    return [json.loads(file.read_text()) for file in files if file.exists()]


def times(kept: list[dict[str, Any]]) -> list[str]:
    """Return what the studies took, added up by the chapter that each is of or stands beside."""
    chapters: dict[str, list[dict[str, Any]]] = {}
    for section in kept:
        stated = re.search(r"\b(\d)\.\d", section["where"])
        chapters.setdefault(stated[1] if stated else "none", []).append(section)
    rows = []
    for title, here in [*sorted(chapters.items()), ("all", kept)]:
        other = [
            f"{one['name']} ({', '.join([one['size']] * (one['size'] != 'full') + one['changed'])})"
            for one in here
            if one["size"] != "full" or one["changed"]
        ]
        minutes = sum(one["cpu_seconds"] for one in here) / 60
        rows.append([title, str(len(here)), f"{minutes:.1f}", ", ".join(other) if title != "all" else ""])
    head = ["chapter", "studies", "CPU minutes", "not at full size, or with other parameters"]
    return [*heading("What they took"), *table(head, rows, "10 10 15 65")]


def study(section: dict[str, Any]) -> list[str]:
    """Return a study's section."""
    name, title = section["name"], f"{section['title'][0].upper()}{section['title'][1:]}"
    where = "../benchmarks/results/figures"
    made = (
        f"({section['date']}, commit {section['commit']}, {section['machine']}, {section['cpu_seconds']:.0f} s of CPU)"
    )
    options = "" if section["size"] == "full" else f" --size {section['size']}"
    options += "".join(f" --set {name}={json.dumps(section['parameters'][name])}" for name in section["changed"])
    lines = [
        *heading(f"{name}: {title}"),
        f"*{section['where']}.* Made by ``taxel study {name}{options} --report figures`` {made};",
        f"numbers: :download:`{name}.json <{where}/{name}.json>`.",
    ]
    for picture in section["pictures"]:
        lines += ["", f".. image:: {where}/{picture}", f"   :alt: {name}: {section['title']}", "   :width: 100%", ""]
    rows = [[str(j["claim"]), j["reading"], VERDICTS[j["holds"]], j["ours"], j["why"]] for j in section["judgements"]]
    if rows:
        lines += table(["claim", "reading", "", "ours", "why"], rows, "6 24 10 35 25")
    if (fits := section.get("fits", {})).get("open"):
        lines += [
            "",
            f"**{fits['open']} of {fits['count']} fits did not close**: gaps up to {fits['largest_gap']:.1e}.",
        ]
    return [*lines, "", f"**Protocol.** {literal(section['protocol'])}", ""]


class Names(FromProgram):
    """What a module makes public: a table of classes and functions with their first lines, and some constants.

    That is what its ``__all__`` names, else what it defines without an underscore.

    The directive ``automodule`` shows the rest, but no constant that was imported from another module.
    """

    required_arguments = 1

    def lines(self) -> list[str]:
        """Return table and constants; modules have pages of their own."""
        module = importlib.import_module(self.arguments[0])
        defined = [n for n, what in vars(module).items() if n[0] != "_" and inspect.getmodule(what) is module]
        held = {name: getattr(module, name) for name in getattr(module, "__all__", defined)}
        names = [name for name, what in held.items() if callable(what)]
        own = {name for _, name in ModuleAnalyzer.for_module(module.__name__).find_attr_docs()}
        constants = [
            n for n, what in held.items() if not callable(what) and not isinstance(what, ModuleType) and n not in own
        ]
        # Without a current module, else a second table of a page warns that it names that of the first.
        head = [".. py:currentmodule:: None", "", ".. autosummary::", ""]
        table = [*head, *(f"   ~{module.__name__}.{name}" for name in names), ""]
        for name in constants:
            long = ["   :no-value:"] if len(repr(held[name])) > LONGEST_VALUE else []
            # Of a value of Python's own types autodata would show the type's docstring.
            plain = type(held[name]).__module__ == "builtins"
            value = [f"   :value: {held[name]!r}"] if plain and not long else []
            table += [
                f".. {'py:data' if plain else 'autodata'}:: {module.__name__}.{name}",
                *value,
                *([] if plain else long),
                "",
            ]
        return table


class Commands(FromProgram):
    """Every command: what it does, its arguments and options."""

    def lines(self) -> list[str]:
        """Return a section a command."""
        return [line for name in sorted([*OWN, *plugins()]) for line in command(f"taxel {name}", imported(name))]


class Keys(FromProgram):
    """Every key of the panel's page, and what it does."""

    def lines(self) -> list[str]:
        """Return a table, a row a key."""
        self.state.document.settings.env.note_dependency(str(KEYS))
        return table(["key", ""], [[f"``{key}``", text] for key, text in keys()], "10 90")


def keys() -> list[tuple[str, str]]:
    """Return each key of the page as it is shown, and what it does."""
    return re.findall(KEY, KEYS.read_text())


class Requests(FromProgram):
    """Every request of the page to its server: the keys with their types, and what it asks for."""

    def lines(self) -> list[str]:
        """Return a table, a row a request."""
        rows = []
        for name, request in requests.Requests.requests.items():
            keys = [
                f"``{key.name}`` {described(key.type)}{'' if key.required else ', may be left out'}"
                for key in msgspec.inspect.type_info(request.keys).fields
            ]
            about = " ".join((request.method.__doc__ or "").split())
            rows.append([f"``{name}``", ". ".join(keys), about])
        return table(["request", "keys", ""], rows, "12 38 50")


class Causes(FromProgram):
    """Every cause in a verdict: its words, its key by kind, and what it means."""

    def lines(self) -> list[str]:
        """Return a table, a row a cause."""
        recorded = [(key, kind, words[1], meaning) for key, kind, words, meaning in causes() if kind != "live"]
        rows = [[words, kind, f"``{key}``", meaning.replace("`", "")] for key, kind, words, meaning in recorded]
        return table(["words", "kind", "key", "meaning"], rows, "30 10 25 35")


class Registers(FromProgram):
    """The board's registers: ``fields``, ``rules`` or ``presets``."""

    required_arguments = 1

    def lines(self) -> list[str]:
        """Return a table, a row a field, rule or preset."""
        self.state.document.settings.env.note_dependency(str(REGISTERS))
        return {"fields": fields, "rules": rules, "presets": presets}[self.arguments[0]]()


def fields() -> list[str]:
    """Return the fields of the registers: where, in which unit, and what they are at reset."""
    reset = registers_preset(PRESETS[0])
    rows = []
    for field in registers_fields():
        low, offset = field["shift"], field["offset"]
        high = low + field["mask"].bit_length() - 1
        bits = f"REG{field['register']}[{low if high == low else f'{high}:{low}'}]"
        cells = [field["name"], field["manual"], f"{bits}{f', less {offset}' * bool(offset)}", field["unit"]]
        least, greatest = field["least"], field["greatest"]
        rows.append([*cells, str(int(reset[field["name"]])), f"{least} to {greatest}", field["text"]])
    head = ["field", "the manual's name", "where", "unit", "at reset", "range", "what it is"]
    return table(head, [[f"``{name}``", *cells] for name, *cells in rows], "15 15 12 9 7 12 30")


def rules() -> list[str]:
    """Return what the registers must hold."""
    stated = sorted(tomllib.loads(REGISTERS.read_text())["rule"], key=lambda rule: rule["number"])
    rows = [[str(r["number"]), "warns" if r.get("warns") else "refuses", f"``{r['holds']}``"] for r in stated]
    return table(["rule", "if broken", "what must hold"], rows, "10 15 75")


def presets() -> list[str]:
    """Return the presets: values, version of the wire, and frames a second."""
    keys = ["line_period", "line_read", "step_period", "step_read", "ramp", "noise_floor", "lines", "channels"]
    rows = []
    for name in PRESETS:
        values = registers_preset(name)
        rate = 1e8 / (values["lines"] * values["line_period"])
        rows.append([name, *(str(values[key]) for key in [*keys, "wire_version"]), f"{rate:.2f}"])
    return table(["preset", *keys, "wire", "frames/s"], rows, "20 8 8 8 8 8 8 8 8 8 8")


def described(kind: Any) -> str:  # noqa: PLR0911  a line for each kind
    """Return a type of a key in words."""
    match kind:
        case msgspec.inspect.Metadata(type=inner, extra_json_schema=schema):
            return schema.get("description") or described(inner)
        case msgspec.inspect.UnionType(types=types):
            return ", or ".join(
                "null" if isinstance(one, msgspec.inspect.NoneType) else described(one) for one in types
            )
        case msgspec.inspect.LiteralType(values=values):
            return " or ".join(f"`{one}`" for one in values)
        case msgspec.inspect.IntType(ge=least, le=most):
            return f"whole number, {least} to {most}"
        case msgspec.inspect.FloatType(ge=least, le=most):
            return "number" if least is None else f"number, {least:g} to {most:g}"
        case msgspec.inspect.StrType(min_length=least, max_length=most):
            return f"text, {least} to {most} characters"
        case msgspec.inspect.ListType(item_type=one, min_length=least, max_length=most):
            return f"{least} to {most} of: {described(one)}"
        case msgspec.inspect.TupleType(item_types=types):
            return f"[{', '.join(map(described, types))}]"
        case msgspec.inspect.StructType(fields=fields):
            return "{" + "; ".join(f"`{one.name}` {described(one.type)}" for one in fields) + "}"
    return "true or false" if isinstance(kind, msgspec.inspect.BoolType) else "object"


def command(name: str, app: Any) -> list[str]:
    """Return a command's section, and those of its own commands; studies alike are shown once."""
    lines = [*heading(name), *paragraphs(about(app)), ""]
    cells = [[", ".join(f"``{word}``" for word in row.names), row.about] for row in rows(app)]
    lines += table(["", ""], cells, "30 70") if cells else []
    seen: list[list[Any]] = []
    own = {inner: (each, rows(each)) for inner, each in own_commands(app).items()}
    for inner, (each, options) in own.items():
        if options not in seen:
            seen.append(options)
            alike = [other for other, (_, its) in own.items() if its == options]
            lines += command(f"{name} {inner}" if len(alike) == 1 else f"{name} NAME", each)
            if len(alike) > 1:
                lines += ["", f"NAME is one of {', '.join(f'``{other}``' for other in alike)}.", ""]
    return lines


def heading(text: str) -> list[str]:
    """Return a section's title."""
    return ["", text, "-" * len(text), ""]


def paragraphs(parts: list[str]) -> list[str]:
    """Return a help text; its examples as code."""
    lines: list[str] = []
    for part in parts:
        if part.startswith("Example: "):
            lines += ["::", "", *(f"   {line.removeprefix('Example: ')}" for line in part.splitlines()), ""]
        else:
            lines += [literal(part), ""]
    return lines


def literal(text: str) -> str:
    """Return text in which no character means anything to reStructuredText."""
    return "".join(f"\\{c}" if c in "*_`|\\" else c for c in text)


def table(head: list[str], rows: list[list[str]], widths: str) -> list[str]:
    """Return a list table; a cell that begins with ``` `` ``` or ``**`` is markup of ours."""
    lines = ["", ".. list-table::", f"   :widths: {widths}", *(["   :header-rows: 1"] if any(head) else []), ""]
    for row in [head, *rows] if any(head) else rows:
        for k, cell in enumerate(row):
            text = " ".join(cell.split())
            said = text if text.startswith(("``", "**")) else literal(text)
            lines.append(f"   {'*' if k == 0 else ' '} - {said}")
    return [*lines, ""]


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directives."""
    app.add_directive("claims", Claims)
    app.add_directive("studies", Studies)
    app.add_directive("commands", Commands)
    app.add_directive("keys", Keys)
    app.add_directive("requests", Requests)
    app.add_directive("causes", Causes)
    app.add_directive("registers", Registers)
    app.add_directive("names", Names)
    return {"parallel_read_safe": True}
