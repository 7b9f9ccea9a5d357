"""Make the tables of Rust and of recordings from registers.toml (`make registers`).

Usage: python tools/registers.py [ROOT]. Python reads Rust's table. A test compares the files with what this script makes.
"""

from __future__ import annotations

import ast
import json
import subprocess
import sys
from pathlib import Path

from registers_source import OPERATOR, Table, parsed, read

HEAD = "Made from registers.toml by tools/registers.py (`make registers`): edit that."
OPPOSITE = {ast.LtE: ">", ast.Lt: ">=", ast.GtE: "<", ast.Gt: "<=", ast.Eq: "!=", ast.NotEq: "=="}
#: Names that a rule may use besides the fields, and their units.
OF_THE_ARRAY = {"steps": "number", "driven_lines": "number", "sense_lines": "number"}


def rust_type(field: Table) -> str:
    """Return the smallest type that holds a field."""
    if field["unit"] == "flag":
        return "bool"
    return next(f"u{bits}" for bits in (8, 16, 32) if field["greatest"] < 2**bits)


def value(node: ast.expr) -> str:
    """Write arithmetic as Rust reads it."""
    match node:
        case ast.Name(id=name):
            return name
        case ast.Constant(value=number):
            return str(number)
        case ast.BinOp(left=left, op=op, right=right):
            low = isinstance(op, ast.Mult)
            sides = [value(side) for side in (left, right)]
            sides = [f"({s})" if low and " " in s else s for s in sides]
            return f"{sides[0]} {OPERATOR[type(op)]} {sides[1]}"
    raise ValueError(f"registers.toml: {ast.unparse(node)} is no arithmetic")


def broken(node: ast.expr, *, inner: bool = False) -> str:
    """Write the condition under which a rule is broken: its negation, without needless brackets."""
    match node:
        case ast.BoolOp(op=op, values=values):
            word = " || " if isinstance(op, ast.And) else " && "
            condition = word.join(broken(part, inner=True) for part in values)
            return f"({condition})" if inner else condition
        case ast.Compare(left=left, ops=[op], comparators=[right]):
            sign = OPPOSITE[type(op)]
            return f"{value(left)} {sign} {value(right)}"
    raise ValueError(f"registers.toml: {ast.unparse(node)} is no comparison")


def names(text: str) -> set[str]:
    """Return the names in an expression."""
    return {node.id for node in ast.walk(parsed(text)) if isinstance(node, ast.Name)}


def template(text: str, units: dict[str, str]) -> list[tuple[str, str, str]]:
    """Cut a text into (words before, expression, unit)."""
    pieces = []
    while "{" in text:
        before, _, rest = text.partition("{")
        inside, _, text = rest.partition("}")
        expression, _, unit = inside.partition(":")
        pieces.append((before, expression, unit or units[expression]))
    return [*pieces, (text, "", "")]


def formatted(expression: str, unit: str) -> tuple[str, str]:
    """Return a function's name that writes a value in its unit, and the words behind it."""
    written = value(parsed(expression))
    return {"10 ns": f"us({written})", "ticks": written, "number": written}[unit], {
        "10 ns": " us",
        "ticks": " ticks",
        "number": "",
    }[unit]


def rust_value(field: Table, number: int) -> str:
    """Write a field's value."""
    return str(bool(number)).lower() if field["unit"] == "flag" else str(number)


def rust_preset(source: Table, preset: Table) -> str:
    """Write a preset on a line: what differs from the values at reset."""
    fields = {field["name"]: field for field in source["field"]}
    values = ", ".join(f"{name} {rust_value(fields[name], number)}" for name, number in preset["values"].items())
    return f'    "{preset["name"]}", {preset["sense_lines"]}: {values};'


def rust_rule(source: Table, rule: Table) -> str:
    """Write a rule on two lines: its number and when it is broken; its text."""
    units = {field["name"]: field["unit"] for field in source["field"]} | OF_THE_ARRAY
    shown, arguments = "", ""
    for before, expression, unit in template(rule["text"], units):
        shown += before
        if expression:
            written, words = formatted(expression, unit)
            shown += (f"{{{written}}}" if written.isidentifier() else "{}") + words
            arguments += "" if written.isidentifier() else f", {written}"
    text = f'"{shown} (rule {rule["number"]})"'
    return f"    {rule['number']}, {broken(parsed(rule['holds']))} =>\n        {text}{arguments};"


def used(source: Table, *, warns: bool) -> list[str]:
    """Return the names that these rules use, in the fields' order."""
    rules = [rule for rule in source["rule"] if rule["warns"] == warns]
    units = {field["name"]: field["unit"] for field in source["field"]} | OF_THE_ARRAY
    expressions = [rule["holds"] for rule in rules]
    expressions += [e for rule in rules for _, e, _ in template(rule["text"], units) if e]
    occurring = set().union(*(names(e) for e in expressions))
    return [name for name in units if name in occurring]


def rust_rules(source: Table, *, warns: bool) -> str:
    """Write the rules that refuse, or those that warn, behind the names that they use."""
    fields = {field["name"] for field in source["field"]}
    occurring = used(source, warns=warns)
    of_registers = " ".join(name for name in occurring if name in fields)
    of_array = " ".join(name for name in occurring if name not in fields)
    arguments = [f"        registers: Registers [{of_registers}]"]
    arguments += [f"        scanned: Scanned [{of_array}]"] if of_array else []
    name = "warnings" if warns else "refusals"
    about = "probably mistakes" if warns else "not allowed"
    rules = [rust_rule(source, rule) for rule in source["rule"] if rule["warns"] == warns]
    return "\n".join(
        [
            f"    /// The rules by which values are {about}, with their numbers.",
            f"    fn {name}(",
            ",\n".join(arguments),
            "    );",
            *rules,
        ]
    )


def rust_field(f: Table) -> str:
    """Write a field on a line: a macro makes the struct, its words and the list of fields of these lines."""
    # A field with an offset: the manual's value is less by it, so the manual's name is no alias for ours.
    alias = "" if f["manual"] == f["name"] or f["offset"] else f'alias = "{f["manual"]}"'
    serde = ", ".join(filter(None, [alias, "default" if f.get("later") else ""]))
    attribute = f"#[serde({serde})] " if serde else ""
    place = f"{f['register']}, {f['low']}, {2 ** f['bits'] - 1:#x}, {f['offset']}, {f['least']}, {f['greatest']}"
    place += f", {rust_value(f, f['default'])}"
    return f'    /// {f["text"]}\n    {attribute}{f["name"]}: {rust_type(f)}, "{f["manual"]}", "{f["unit"]}", {place};'


def as_formatted(text: str) -> str:
    """Return Rust code as rustfmt formats it."""
    command = ["rustfmt", "--edition", "2024", "--config-path", str(Path(__file__).parents[1])]
    return subprocess.run(command, input=f"//! {HEAD}\n\n{text}", capture_output=True, text=True, check=True).stdout


def rust_table(source: Table) -> str:
    """Write the struct that holds the registers, and where each field lies in them."""
    rows = [rust_field(f) for f in source["field"] if "register" in f]
    build = [f for f in source["field"] if "register" not in f]
    rest = [f"    /// {f['text']}\n    {f['name']}: {rust_type(f)}, {f['default']};" for f in build]
    newline = "\n"
    return as_formatted(f"""super::field::registers! {{
    // The field: its type, the manual's name, unit; register, lowest bit, mask, offset, least and greatest value, that at
    // reset.
{newline.join(rows)}
    ; // Of the board's build:
{newline.join(rest)}
}}
""")


def rust_presets(source: Table) -> str:
    """Write the presets."""
    newline = "\n"
    return as_formatted(f"""use super::table::{{AT_RESET, Registers}};

super::field::presets! {{
    // The preset's name, the sense lines of the boards for which it is made, and what differs from the values at reset.
{newline.join(rust_preset(source, preset) for preset in source["preset"])}
}}
""")


def rust_checks(source: Table) -> str:
    """Write the rules that refuse and those that warn."""
    return as_formatted(f"""use super::field::{{Scanned, rules, us}};
use super::table::Registers;

rules! {{
{rust_rules(source, warns=False)}
}}

rules! {{
{rust_rules(source, warns=True)}
}}
""")


def rust_power_law(source: Table) -> str:
    """Write the power law as the logic looks it up."""
    law = source["power_law"]
    return as_formatted(f"""use std::sync::LazyLock;

/// Number of fractional bits of [`POWER_LAW`].
pub const POWER_LAW_FRACTION: u32 = {law["fraction_bits"]};

/// Ticks to the power of {law["exponent"]} (5.1), in fixed point: the lookup table of the logic.
pub static POWER_LAW: LazyLock<[u32; {law["entries"]}]> = LazyLock::new(|| {{
    std::array::from_fn(|tick| (libm::pow(tick as f64, {law["exponent"]}) * f64::from(1 << POWER_LAW_FRACTION)).round() as u32)
}});
""")


def schema(source: Table) -> str:
    """Write the schema that recordings carry."""
    properties = {}
    for f in source["field"]:
        kind: Table = {"type": "boolean"} if f["unit"] == "flag" else {"type": "integer", "minimum": f["least"]}
        unit = "" if f["unit"] in ("flag", "lines", "channels", "version") else f" In units of {f['unit']}."
        properties[f["name"]] = kind | {"description": f["text"] + unit}
    title = {"title": "taxel.Registers", "description": "What the board's registers hold", "type": "object"}
    return json.dumps(title | {"properties": properties}, indent=2) + "\n"


MADE = {
    "crates/taxel-core/src/wire/registers/table.rs": rust_table,
    "crates/taxel-core/src/wire/registers/presets.rs": rust_presets,
    "crates/taxel-core/src/wire/registers/rules.rs": rust_checks,
    "crates/taxel-core/src/wire/registers/power_law.rs": rust_power_law,
    "crates/taxel-live/src/recording/schemas/Registers.json": schema,
}


def main() -> None:
    """Write every file."""
    root = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parents[1]
    source = read(root / "registers.toml")
    for name, make in MADE.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(make(source))


if __name__ == "__main__":
    main()
