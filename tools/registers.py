"""Make the tables of Rust and the docs from registers.toml (`make registers`).

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


def rust_entries(source: Table, values: Table) -> str:
    """Write values of the registers as entries of a struct."""
    flags = {field["name"] for field in source["field"] if field["unit"] == "flag"}
    return " ".join(f"{name}: {str(bool(v)).lower() if name in flags else v}," for name, v in values.items())


def rust_preset(source: Table, preset: Table) -> str:
    """Write a preset: what differs from the defaults."""
    entries = rust_entries(source, preset["values"])
    registers = f"Registers {{ {entries} ..DEFAULTS }}" if entries else "DEFAULTS"
    return f'Preset {{ name: "{preset["name"]}", sense_lines: {preset["sense_lines"]}, registers: {registers} }},'


def rust_rules(source: Table, *, warns: bool) -> str:
    """Write the rules that refuse, or those that warn."""
    units = {field["name"]: field["unit"] for field in source["field"]} | OF_THE_ARRAY
    lines = []
    for rule in source["rule"]:
        if rule["warns"] != warns:
            continue
        pieces = template(rule["text"], units)
        shown, arguments = "", []
        for before, expression, unit in pieces:
            shown += before
            if expression:
                written, words = formatted(expression, unit)
                shown += "{}" + words
                arguments.append(written)
        text = f'"{shown} (rule {rule["number"]})"'
        broken_rule = (
            f"({rule['number']}, format!(\n            {text},\n            {', '.join(arguments)}\n        ))"
        )
        action = f"warnings.push({broken_rule});" if warns else f"return Some({broken_rule});"
        lines.append(f"    if {broken(parsed(rule['holds']))} {{\n        {action}\n    }}")
    return "\n".join(lines)


def used(source: Table, *, warns: bool) -> list[str]:
    """Return the names that these rules use, in the fields' order."""
    rules = [rule for rule in source["rule"] if rule["warns"] == warns]
    units = {field["name"]: field["unit"] for field in source["field"]} | OF_THE_ARRAY
    expressions = [rule["holds"] for rule in rules]
    expressions += [e for rule in rules for _, e, _ in template(rule["text"], units) if e]
    occurring = set().union(*(names(e) for e in expressions))
    return [name for name in units if name in occurring]


def rust_values(source: Table, *, warns: bool) -> str:
    """Bind the names that the rules use."""
    fields = {field["name"] for field in source["field"]}
    lines = []
    for name in used(source, warns=warns):
        origin = f"registers.{name}" if name in fields else f"scanned.{name}"
        lines.append(f"    let {name} = i64::from({origin});")
    return "\n".join(lines)


def rust_field(f: Table) -> str:
    """Write a field on a line: a macro makes the struct, its words and the list of fields of these lines."""
    # A field with an offset: the manual's value is less by it, so the manual's name is no alias for ours.
    alias = "" if f["manual"] == f["name"] or f["offset"] else f'alias = "{f["manual"]}"'
    serde = ", ".join(filter(None, [alias, "default" if f.get("later") else ""]))
    attribute = f"#[serde({serde})] " if serde else ""
    place = f"{f['register']}, {f['low']}, {2 ** f['bits'] - 1:#x}, {f['offset']}, {f['least']}, {f['greatest']}"
    return f'    /// {f["text"]}\n    {attribute}{f["name"]}: {rust_type(f)}, "{f["manual"]}", "{f["unit"]}", {place};'


def as_formatted(text: str) -> str:
    """Return Rust code as rustfmt formats it."""
    command = ["rustfmt", "--edition", "2024", "--config-path", str(Path(__file__).parents[1])]
    return subprocess.run(command, input=f"//! {HEAD}\n\n{text}", capture_output=True, text=True, check=True).stdout


def rust_table(source: Table) -> str:
    """Write the struct that holds the registers, and where each field lies in them."""
    rows = [rust_field(f) for f in source["field"] if "register" in f]
    build = [f for f in source["field"] if "register" not in f]
    rest = [f"    /// {f['text']}\n    {f['name']}: {rust_type(f)};" for f in build]
    newline = "\n"
    return as_formatted(f"""super::field::registers! {{
    // The field: its type, the manual's name, unit; register, lowest bit, mask, offset, least and greatest value.
{newline.join(rows)}
    ; // Of the board's build:
{newline.join(rest)}
}}
""")


def rust_presets(source: Table) -> str:
    """Write the presets."""
    newline = "\n"
    return as_formatted(f"""use super::table::Registers;

/// A named set of register values.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Preset {{
    /// Name of the preset.
    pub name: &'static str,
    /// Number of sense lines of the boards for which it is made.
    pub sense_lines: u16,
    /// The values of the registers.
    pub registers: Registers,
}}

const DEFAULTS: Registers = Registers {{ {rust_entries(source, {f["name"]: f["default"] for f in source["field"]})} }};

/// The presets, in the order of the reference; a board's registers at reset are the first preset for its array's size.
pub const PRESETS: [Preset; {len(source["preset"])}] = [
{newline.join(rust_preset(source, preset) for preset in source["preset"])}
];
""")


def rust_checks(source: Table) -> str:
    """Write the rules that refuse and those that warn."""
    return as_formatted(f"""use super::field::{{Scanned, us}};
use super::table::Registers;

/// The first rule that refuses these registers, with its numbers.
pub(super) fn first_refusal(registers: &Registers, scanned: &Scanned) -> Option<(u8, String)> {{
{rust_values(source, warns=False)}
{rust_rules(source, warns=False)}
    None
}}

/// Warnings about values that are allowed but probably a mistake.
pub(super) fn warnings(registers: &Registers) -> Vec<(u8, String)> {{
    let mut warnings = vec![];
{rust_values(source, warns=True)}
{rust_rules(source, warns=True)}
    warnings
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


def docs(source: Table) -> str:
    """Write the page of the docs."""
    rows, less = [], []
    for f in source["field"]:
        high = f.get("low", 0) + f["bits"] - 1
        where = f"REG{f['register']}[{high}:{f['low']}]" if "register" in f else "the board's build"
        where = where.replace(f"[{f.get('low')}:{f.get('low')}]", f"[{f.get('low')}]")
        limits = f"{f['least']} to {f['greatest']}" if f["unit"] != "flag" else "off, on"
        default = ("on" if f["default"] else "off") if f["unit"] == "flag" else f["default"]
        held = ""
        if "register" in f:
            held = f"the value less {f['offset']}" if f["offset"] else "the value"
        if f["offset"]:
            less.append(f"`{f['name']}` {f['greatest']} is {f['greatest'] - f['offset']} in {where}")
        rows.append(
            f"| `{f['name']}` | `{f['manual']}` | {where} | {held} | {f['unit']} | {default} | {limits} | {f['text']} |"
        )
    rules = [
        f"| {r['number']} | {'warns' if r['warns'] else 'refuses'} | `{r['holds']}` |"
        for r in sorted(source["rule"], key=lambda r: r["number"])
    ]
    keys = ("line_period", "line_read", "step_period", "step_read", "ramp", "noise_floor", "lines", "channels")
    default = {f["name"]: f["default"] for f in source["field"]}
    presets = []
    for p in source["preset"]:
        values = default | p["values"]
        rate = 1e8 / (values["lines"] * values["line_period"])
        cells = " | ".join(str(values[key]) for key in keys)
        presets.append(f"| {p['name']} | {cells} | {values['wire_version']} | {rate:.2f} |")
    law = source["power_law"]
    newline = "\n"
    return f"""<!-- {HEAD} -->
# Registers

This page lists the board's registers, the rules that their values obey, and the presets. The board has eight 32-bit registers (thesis,
Appendix 1, Table 5.5), each set as a whole by five bytes on the serial line (`taxel.wire.Command`). A *line* is a driven line, the outer
loop of the scan; a *step* is one of the multiplexer, the inner loop. The manual's names are aliases everywhere, in the manual's units.

| field | the manual's name | where | bits hold | unit | at reset | range | what it is |
|---|---|---|---|---|---|---|---|
{newline.join(rows)}

Where the bits hold less than the value, so must a word that is written: {", ".join(less)}.

All other bits are reserved and written 0. REG6 has no value: writing a register's number (0 to 7) to it reads that register back, and
writing 8 makes the board identify itself as at reset. Writing 9 requests its totals ([the wire](wire.md)).

## Rules

The logic, the emulated board and the host check these rules before a write; a write that breaks one changes nothing. `steps` is the number of
multiplexer steps for each line: the array's rows, at least 64, divided by the channels and rounded up; `driven_lines` and `sense_lines` are the
array's columns and rows. Rule 4 also says that every value is within its range and reserved bits are 0. A refusal names the first
broken rule: rule 4 is checked first, the others follow in the order of their numbers.

| rule | if broken | what must hold |
|---|---|---|
{newline.join(rules)}

## Presets

| preset | {" | ".join(f"`{key}`" for key in keys)} | wire | frames/s |
|---|{"---|" * (len(keys) + 2)}
{newline.join(presets)}

A board of up to 64 lines resets to the first preset of as many channels (*5.2 kHz* or *20.8 kHz*), with the lines of its array. A larger
one resets to wire version 2 and *128 x 128, 1 kHz*, or with 16 channels to *128 x 128, 1.3 kHz*, with the lines of its array, and line
times no shorter than its steps. *wire* is the version of a board that starts with the preset. Applying a preset to a running board by
its name (`taxel device apply`, the panel) changes neither its version nor its channels, which are fixed in hardware.

## The pattern

With `pattern` set, values that anyone can compute take the place of the comparators': those of a ball that rolls over the array, so that
everything behind the converter can be checked without a sensor. No comparator counts as a fault meanwhile. All else is as always: a value
makes an event where it differs by more than `noise_floor` from the one sent last, and with `mechanoreceptor` it drives the afferent.

The frames of the pattern are counted: `n` is 0 in the first frame that has it, and the number before plus 1, modulo 65536, in each further
frame. A frame without it ends the count, a reset too; the frame before time 0 never has it. Taxel (`x`, `y`), of driven line `x` and sense
line `y`, reads `v` ticks in frame `n`, in whole numbers, with `//` rounding down and `mod` never negative:

```
C, R = the array's columns and rows, each rounded up to a power of two
p    = (n // 16 - 16 * x) mod (16 * C)        a = min(p, 16 * C - p)
q    = (n // 2  - 16 * y) mod (16 * R)        b = min(q, 16 * R - q)
v    = max(0, min(128, ramp) - max(a, b) - min(a, b) // 2)
```

So positions are in sixteenths of a taxel, the ball's middle is at `n // 16` across the lines and `n // 2` along them, and a ball that
leaves the array on one side comes back on the other. Of 64 x 64 taxels each one has read 64 or more after 16384 frames. Examples for
64 x 64 taxels and a ramp of 150: with `n` = 0 taxel (0, 0) reads 128, (1, 0) 112, (1, 1) 104, (63, 63) 104 and (5, 2) 32; with `n` = 100
(0, 3) reads 121 and (0, 4) 111.

A board may begin with the pattern after a reset: the Colorlight i9 does where its button is held for two seconds or more
([the board's logic](hardware.md)).

## FA-1 on the board

With `mechanoreceptor` set each taxel is the FA-1 afferent of 5.4.2, in whole numbers of 2^-{law["fraction_bits"]}. The compression 5.1
is a table of {law["entries"]} entries, `round(ticks ** {law["exponent"]} * 2 ** {law["fraction_bits"]})`; larger values use the
last entry. theta_0 is `threshold_rest` 1/1024; a spike raises the threshold by `threshold_jump * theta_0 / 256`, a quiet frame lowers
it by `threshold_decay * theta_0 / 1024` while it lies above theta_0, else sets it to theta_0; both are rounded down. The integral is the
compressed value less that at the taxel's last spike; a spike fires where its size exceeds the threshold. A taxel's first
frame in this mode in which its comparator had returned counts as the state at all earlier times, so it has no event. A frame in which it
had not returned changes nothing. An event is a spike: `Pol` is its sign, the intensity word the size of the
integral in 1/1024, 65535 at most. If the queue is full, the spike is dropped and counted, and the afferent is
reset as after any spike.
"""


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
    "docs/registers.md": docs,
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
