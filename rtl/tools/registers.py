"""Write what the RTL has of registers.toml: the package of registers, and the table of FA-1's power law.

Usage: python rtl/tools/registers.py [FOLDER]. A test compares the files with what this makes.
"""

from __future__ import annotations

import ast
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
sys.path.append(str(ROOT / "tools"))

from registers_source import OPERATOR, Table, parsed, power_law, read  # noqa: E402

HEAD = "// Made from registers.toml by rtl/tools/registers.py (`make rtl-registers`): edit that.\n"
#: Bits of the arithmetic in rules: 8 steps of 16 bits, and counts of 32 bits, fit.
WIDTH = 40
COMPARED = {ast.LtE: "<=", ast.Lt: "<", ast.GtE: ">=", ast.Gt: ">", ast.Eq: "==", ast.NotEq: "!="}


def held(source: Table) -> list[Table]:
    """Return the fields that lie in a register."""
    return [field for field in source["field"] if "register" in field]


def arithmetic(node: ast.expr, fields: dict[str, Table]) -> str:
    """Write an expression of a rule in `WIDTH` bits."""
    match node:
        case ast.Name(id=name) if name in fields:
            offset = fields[name]["offset"]
            wide = f"{WIDTH}'(r.{name})"
            return f"({wide} + {WIDTH}'d{offset})" if offset else wide
        case ast.Name(id=name):
            return f"{WIDTH}'({name})"
        case ast.Constant(value=int(number)):
            return f"{WIDTH}'d{number}"
        case ast.BinOp(left=ast.Constant(value=int(number)), op=ast.Mult(), right=right):
            # Shifts and a sum, as a multiplier was the longest path of the logic.
            factor = arithmetic(right, fields)
            places = [k for k in range(number.bit_length()) if number >> k & 1]
            return "(" + " + ".join(f"({factor} << {k})" if k else factor for k in places) + ")"
        case ast.BinOp(left=left, op=op, right=right):
            return f"({arithmetic(left, fields)} {OPERATOR[type(op)]} {arithmetic(right, fields)})"
    raise ValueError(f"registers.toml: {ast.unparse(node)} is no arithmetic")


def condition(node: ast.expr, fields: dict[str, Table]) -> str:
    """Write what a rule demands."""
    match node:
        case ast.BoolOp(op=op, values=values):
            word = " && " if isinstance(op, ast.And) else " || "
            return "(" + word.join(condition(part, fields) for part in values) + ")"
        case ast.Compare(left=left, ops=[op], comparators=[right]):
            return f"({arithmetic(left, fields)} {COMPARED[type(op)]} {arithmetic(right, fields)})"
    raise ValueError(f"registers.toml: {ast.unparse(node)} is no comparison")


def struct(source: Table) -> str:
    """Write the struct: what the bits of each field hold."""
    rows = []
    for field in held(source):
        kind = "logic" if field["bits"] == 1 else f"logic [{field['bits'] - 1}:0]"
        text = field["text"] + (f" The bits hold {field['offset']} less." if field["offset"] else "")
        rows.append(f"    // {text}\n    {kind} {field['name']};")
    return "  typedef struct packed {\n" + "\n".join(rows) + "\n  } registers_t;\n"


def words(source: Table) -> str:
    """Write how fields lie in the eight words."""
    reads, masks, stores = [], [], []
    for n in range(8):
        here = [field for field in held(source) if field["register"] == n]
        if not here:
            continue
        parts = []
        for f in here:
            high, low, name = f["low"] + f["bits"] - 1, f["low"], f["name"]
            parts.append(f"(32'(r.{name}) << {low})" if low else f"32'(r.{name})")
            where = f"[{low}]" if f["bits"] == 1 else f"[{high}:{low}]"
            stores.append((n, f"{name} = value{where};"))
        mask = sum((2 ** f["bits"] - 1) << f["low"] for f in here)
        reads.append(f"      3'd{n}: return {' | '.join(parts)};")
        masks.append(f"      3'd{n}: return 32'h{mask:08X};")
    blocks = []
    for n in sorted({n for n, _ in stores}):
        rows = "\n".join(f"        changed.{row}" for m, row in stores if m == n)
        blocks.append(f"      3'd{n}: begin\n{rows}\n      end")
    newline = "\n"
    return f"""
  // What register n holds; 0 where there is no such field.
  function automatic logic [31:0] word(registers_t r, logic [2:0] n);
    case (n)
{newline.join(reads)}
      default: return 32'd0;
    endcase
  endfunction

  // Which bits register n has; the others are reserved and must be 0.
  function automatic logic [31:0] mask(logic [2:0] n);
    case (n)
{newline.join(masks)}
      default: return 32'd0;
    endcase
  endfunction

  // The registers with one of them set, whatever the rules say.
  function automatic registers_t store(registers_t r, logic [2:0] n, logic [31:0] value);
    registers_t changed;
    changed = r;
    case (n)
{newline.join(blocks)}
      default: ;
    endcase
    return changed;
  endfunction
"""


def rules(source: Table) -> str:
    """Write the rules that refuse: which of them are broken, and the number of the first."""
    fields = {field["name"]: field for field in held(source)}
    kinds = []
    for name, f in fields.items():
        if f["least"] > f["offset"]:
            kinds.append((4, f"{arithmetic(ast.Name(name), fields)} < {WIDTH}'d{f['least']}"))
        if f["greatest"] < 2 ** f["bits"] - 1 + f["offset"]:
            kinds.append((4, f"{arithmetic(ast.Name(name), fields)} > {WIDTH}'d{f['greatest']}"))
    for rule in source["rule"]:
        if not rule["warns"]:
            demanded = condition(parsed(rule["holds"]), fields)
            kinds.append((rule["number"], f"!{demanded}"))
    conditions = "\n".join(f"    which[{k}] = {broken};" for k, (_, broken) in enumerate(kinds))
    numbers = "\n".join(f"    if (which[{k}]) return 4'd{number};" for k, (number, _) in enumerate(kinds))
    return f"""
  localparam int RULES = {len(kinds)};

  // Which rules refuse these registers, in their order.
  function automatic logic [RULES-1:0] broken(
      registers_t r, int steps, int driven_lines, int sense_lines, int channels
  );
    logic [RULES-1:0] which;
{conditions}
    return which;
  endfunction

  // The number of the first of them; 0: none.
  function automatic logic [3:0] refused(logic [RULES-1:0] which);
{numbers}
    return 4'd0;
  endfunction
"""


def at_reset(source: Table) -> str:
    """Write what a build holds at reset: the first preset of its size and channels."""
    cases = []
    for large in (True, False):
        for channels in (16, 64):
            fitting = [
                p["values"]
                for p in source["preset"]
                if (p["sense_lines"] > 64) == large and p["values"].get("channels", 16) == channels
            ]
            values = []
            for f in held(source):
                value = fitting[0].get(f["name"], f["default"])
                values.append(f"{f['name']}: {f['bits']}'d{value - f['offset']}")
            chosen = ("is_large" if large else "!is_large") + f" && channels == {channels}"
            body = ",\n          ".join(values)
            cases.append(f"    if ({chosen})\n      r = '{{\n          {body}}};")
    newline = "\n"
    lines = next(f for f in held(source) if f["name"] == "lines")
    return f"""
  // What a build holds at reset; beyond 64 lines the lines' times are fitted to its steps.
  function automatic registers_t at_reset(int steps, int driven_lines, int sense_lines, int channels);
    registers_t r;
    logic is_large;
    is_large = driven_lines > 64 || sense_lines > 64;
    r = '0;
{newline.join(cases)}
    r.lines = {lines["bits"]}'(driven_lines - {lines["offset"]});
    if (is_large) begin
      if (r.line_read < 32'(steps) * 32'(r.step_period)) r.line_read = 32'(steps) * 32'(r.step_period);
      if (r.line_period < r.line_read) r.line_period = r.line_read;
    end
    return r;
  endfunction
"""


def package(source: Table) -> str:
    """Write the whole package."""
    return (
        f"{HEAD}// What the board's registers hold, how they lie in words, and the rules that they obey.\n"
        f"package taxel_registers;\n\n{struct(source)}{words(source)}{rules(source)}{at_reset(source)}\nendpackage\n"
    )


def compression(source: Table) -> str:
    """Write the module that looks up the power law."""
    law = power_law(source)
    bits, places = max(law).bit_length(), (len(law) - 1).bit_length()
    if len(law) != 1 << places:
        raise ValueError(
            f"registers.toml: power_law has {len(law)} entries, the logic's table must have a power of two"
        )
    entries = [f"{bits}'d{entry}" for entry in law]
    rows = ",\n".join("    " + ", ".join(entries[k : k + 8]) for k in range(0, len(entries), 8))
    return f"""{HEAD}// Ticks to the power of {source["power_law"]["exponent"]} (5.1).
//
// Throughput: a value a clock.
// Latency: a clock.
// Loses nothing: ticks beyond the table use its last entry.
module taxel_power_law (
    input  logic        clk,
    input  logic [15:0] ticks,
    output logic [{bits - 1}:0] pressure
);

  localparam logic [0:{len(law) - 1}][{bits - 1}:0] ENTRIES = {{
{rows}
  }};

  logic [{bits - 1}:0] entries[{len(law)}];
  initial for (int k = 0; k < {len(law)}; k++) entries[k] = ENTRIES[k];

  always_ff @(posedge clk) pressure <= entries[ticks > 16'd{len(law) - 1} ? {places}'d{len(law) - 1} : ticks[{places - 1}:0]];

endmodule
"""


MADE = {"taxel_registers.sv": package, "taxel_power_law.sv": compression}


def main() -> None:
    """Write every file."""
    to = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "rtl" / "src"
    source = read(ROOT / "registers.toml")
    for name, make in MADE.items():
        (to / name).write_text(make(source))


if __name__ == "__main__":
    main()
