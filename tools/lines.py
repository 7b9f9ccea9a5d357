"""Count the lines of code by room, with the goals of this round: `python tools/lines.py`.

A line counts where it holds code: no comment, no docstring, no blank line. Code that a tool writes counts too; stubs,
declarations and tables (`.pyi`, `.d.ts`, `.toml`), the RTL, tools and documentation do not. The second sum has the
product and the distributions beside it, so that what only moves out of the product does not lower it. Of the
documentation the words by hand are counted, without what is built.
"""

import argparse
import json
import re
import subprocess
import sys
from collections import Counter
from pathlib import Path

from pygments.lexers import get_lexer_for_filename
from pygments.token import Comment, String

ROOT = Path(__file__).parent.parent
#: What the rooms had when they were last kept.
KEPT = ROOT / "tools" / "lines.json"
SUFFIXES = {".rs", ".py", ".js", ".mjs", ".css", ".html", ".j2"}
MODULES = "python/taxel"
#: The rooms: the goal of this round, and folders or modules.
PRODUCT = {
    "taxel-core": (23_500, "crates/taxel-core/src"),
    "taxel-live": (8_300, "crates/taxel-live/src"),
    "taxel-panel": (2_650, "crates/taxel-panel/src"),
    "page": (4_200, "python/taxel/panel/web"),
    "border": (3_450, "crates/taxel-python/src crates/taxel-border/src"),
    "nouns": (1_950, "__init__ array _event_table events frames regions spikes tare calibration clock plot"),
    "labels, wire, neuron": (1_170, "labels detections recorded reading verdict wire neuron"),
    "_base": (1_500, "_base"),
    "formats": (2_950, "formats"),
    "recording": (2_850, "recording"),
    "encode, metrics": (640, "encode metrics"),
    "learn": (1_070, "learn"),
    "detect": (2_900, "detect"),
    "information": (1_580, "information"),
    "simulate": (940, "simulate"),
    "tasks": (1_600, "tasks options"),
    "live, panel": (3_800, "live panel device board_check"),
    "report, demo": (760, "report demo"),
    "command line": (2_600, "cli __main__"),
    "other modules": (0, MODULES),
}
BESIDE = {
    "studies": (8_000, "studies/taxel_studies"),
    "benchmarks": (3_200, "benchmarks/taxel_benchmarks"),
    "rules": (2_000, "rules/src rules/taxel_rules"),
    "viewers": (120, "viewers/taxel_viewers"),
    "bridge": (150, "bridge/taxel_bridge bridge/zenoh"),
    "makers": (850, "makers/taxel_makers"),
    "gait": (3_000, "gait/taxel_gait"),
}
PLACES = {
    place if "/" in place else f"{MODULES}/{place}": room
    for room, (_, places) in (PRODUCT | BESIDE).items()
    for place in places.split()
}
#: The product's is 69 000, and 900 for detections in regions.
GOALS = {"product": 69_900, "with what stands beside it": 86_370, "tests in Python": 25_500, "words by hand": 28_500}
#: Lines that the product may lose before its numbers must be kept anew: larger ones would hide what grows.
STALE = 100
TEST_MODULE = re.compile(r"#\[cfg\(test\)\]\s*(?:pub(?:\(\w+\))?\s+)?mod\s+\w+\s*(;|\{)")
#: Pages that are built, and what is made in others.
BUILT = {"measured.md", "results.md"}
MADE = re.compile(r"<!-- \w+: made .*?<!-- end", re.DOTALL)
#: Folders whose code is of others, or none.
LEFT_OUT = {"vendor", "results", "data", "rtl", "tools", "docs", "fuzz"}


def without_tests(rust: str) -> str:
    """Remove `#[cfg(test)] mod NAME { ... }`; the text has no comments and no strings left."""
    while found := TEST_MODULE.search(rust):
        end, depth = found.end(), int(found[1] == "{")
        while depth:
            depth += {"{": 1, "}": -1}.get(rust[end], 0)
            end += 1
        rust = rust[: found.start()] + rust[end:]
    return rust


def code_lines(file: Path) -> tuple[int, int]:
    """Return the number of lines of one file that hold code, and of tests that stand in a file of Rust."""
    rust = file.suffix == ".rs"
    kept = []
    for kind, text in get_lexer_for_filename(file.name, stripnl=False).get_tokens(file.read_text(encoding="utf-8")):
        comment = (kind in Comment and kind not in Comment.Preproc) or kind in String.Doc
        literal = rust and (kind in String or kind in String.Char)
        kept.append(re.sub(r"[^\n]", "" if comment else "x", text) if comment or literal else text)
    text = "".join(kept)
    lines = [sum(bool(line.strip()) for line in t.splitlines()) for t in (text, without_tests(text) if rust else text)]
    return lines[1], lines[0] - lines[1]


def room_of(file: Path) -> str | None:
    """Return the room of a file: that of the nearest folder, or of the module, that has one."""
    return next((PLACES[str(place)] for place in (file.with_suffix(""), *file.parents) if str(place) in PLACES), None)


def counted() -> tuple[Counter[str], Counter[str]]:
    """Return the lines of each room, and those of the tests in either language, and of the feet's apart."""
    rooms, tests = Counter[str](), Counter[str]()
    listed = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    for name in set(listed.stdout.splitlines()):
        file = Path(name)
        if file.suffix not in SUFFIXES or LEFT_OUT & set(file.parts) or not (ROOT / file).exists():
            continue
        code, inner = code_lines(ROOT / file)
        language = "tests in Rust" if file.suffix == ".rs" else "tests in Python"
        language = "tests of gait" if file.parts[0] == "gait" else language
        if "tests" in file.parts or file.name == "tests.rs":
            tests[language] += code + inner
        elif room := room_of(file):
            rooms[room] += code
            tests[language] += inner
    return rooms, tests


def words(*kinds: str) -> int:
    """Return the number of words of pages that are written by hand."""
    pages = [page for kind in kinds for page in ROOT.glob(kind) if page.name not in BUILT]
    return sum(len(MADE.sub("", page.read_text("utf-8")).split()) for page in pages)


def main() -> None:
    """Print a row for each room and the sums, or the rooms that grew since; end with 1 where they are kept no longer."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--keep", action="store_true", help="keep the numbers in tools/lines.json")
    parser.add_argument(
        "--grown",
        action="store_true",
        help="print only the rooms that grew since they were kept; 1 where what was kept is too large",
    )
    asked = parser.parse_args()
    rooms, tests = counted()
    product, beside = (sum(rooms[name] for name in table) for table in (PRODUCT, BESIDE))
    goals = {name: goal for name, (goal, _) in (PRODUCT | BESIDE).items()} | GOALS
    now = {name: rooms[name] for name in PRODUCT} | {"product": product} | {name: rooms[name] for name in BESIDE}
    now |= {"with what stands beside it": product + beside} | dict(sorted(tests.items()))
    now["words of gait"] = words("gait/*.md", "docs/gait.md")
    now["words by hand"] = words("*.md", "docs/*.md", "*/README.md") - now["words of gait"]
    kept = json.loads(KEPT.read_text(encoding="utf-8"))
    if asked.keep:
        KEPT.write_text(json.dumps(now, indent=1) + "\n", encoding="utf-8")
    elif asked.grown:
        for name in now:
            if now[name] > kept.get(name, 0):
                print(f"tools/lines.py: {name} grew from {kept.get(name, 0)} to {now[name]}")
        if product < kept["product"] - STALE:
            sys.exit(f"tools/lines.py: the product has {product} lines, {kept['product']} kept: run it with --keep")
        return
    print(f"{'':27} {'now':>7} {'kept':>7} {'goal':>7}")
    for name, lines in now.items():
        print(f"{name:27} {lines:7} {kept.get(name, 0):7} {goals.get(name, ''):>7}")


if __name__ == "__main__":
    main()
