"""Plant faults in code, one at a time, and keep which test of its room catches each: `python tools/faults.py REVISION`.

With `--seed` faults are drawn; else those of `tools/faults.json` are planted again where their lines still stand. Rust is
compiled once, with all faults in it, and a variable of the environment chooses one.
"""

import argparse
import ast
import functools
import json
import os
import random
import re
import resource
import shutil
import signal
import subprocess
import sys
import time
import tomllib
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
GONE = "the line is gone"
KEPT = ROOT / "tools" / "faults.json"
ROOMS = tomllib.loads((ROOT / "tools" / "faults.toml").read_text(encoding="utf-8"))
CORE = "crates/taxel-core/src"
#: The longest that the tests of a room may take in Python and in Rust, s, and the most memory, bytes.
PYTEST_S, CARGO_S, MEMORY = 180, 60, 8 << 30
SWITCH = """//! Which fault is planted.
use std::sync::OnceLock;
static PLANTED: OnceLock<usize> = OnceLock::new();
/// Whether this fault is planted.
pub fn planted(number: usize) -> bool {
    let chosen = || std::env::var("TAXEL_FAULT").ok().and_then(|text| text.parse().ok()).unwrap_or(0);
    *PLANTED.get_or_init(chosen) == number
}
"""
#: What a fault replaces, and by what; beside these, numbers grow by one, arguments change places, conditions turn round.
PAIRS = "< >=, <= <, > <=, >= >, == !=, != ==, + -, - +, * /, / *, += -=, -= +=, && ||, || &&, and or, or and"
PAIRS = f"{PAIRS}, true false, false true, True False, False True, min max, max min"
CHANGES = [
    *(
        (rf"\b{a}\b", b) if a.isalpha() else (re.escape(f" {a} "), f" {b} ")
        for a, b in map(str.split, PAIRS.split(", "))
    ),
    (r"(?<![\w.])(\d+)\b", lambda found: str(int(found[1]) + 1)),
    (r"\((\w+), (\w+)\)", r"(\2, \1)"),
    (r"\bnot ", ""),
]
#: What stands before and after the code of a line that a fault may change: conditions, values, statements, tails.
FORMS = {
    ".rs": (
        r"(\s*(?:\} else )?(?:if|while) )(?!let )(.+)( \{)",
        r"(\s*let [^=]+ = )(.+)(;)",
        r"(\s*return )(.+)(;)",
        r"(\s*\w+: )([^=]+)(,)",
        r"(\s*[^=]+ => )(.+)(,)",
        r"(\s*)((?:self|\*|\w).*)(;)",
        r"(\s*)([\w(!*-].*[\w)\]?])()",
    ),
    ".py": (
        r"(\s*(?:el)?(?:if|while) )(.+)(:)",
        r"(\s*(?:return|yield) |\s*[^=(]+ [-+*/|&]?= )(.+)()",
        r"(\s*)(.+)()",
    ),
}
DECLARES = re.compile(
    r"\s*(?:[#/.]|(?:pub|use|fn|const|static|type|mod|impl|struct|enum|trait|where|for|match|unsafe|loop|break|continue)\b)"
)


@dataclass(frozen=True)
class Fault:
    """A line, the same line with a fault, and what caught it, by revision: a test, nothing, or that the line is gone."""

    room: str
    file: str
    line: int
    was: str
    now: str
    caught: dict[str, str | None] = field(default_factory=dict, compare=False)


def parts(file: Path, line: str) -> tuple[str, str, str] | None:
    """Split a line into what stands before its code, the code, and what stands after it."""
    if '"' in line or "$" in line or (file.suffix == ".rs" and DECLARES.match(line)):
        return None
    found = next(filter(None, (re.fullmatch(form, line) for form in FORMS[file.suffix])), None)
    balanced = found and all(found[2].count(a) == found[2].count(b) for a, b in ("()", "[]", "{}"))
    return (found[1], found[2], found[3]) if found and balanced else None


def lines_of_code(file: Path) -> list[int]:
    """Return the indices of the lines that may hold a fault: of Python, simple statements and conditions of functions."""
    text = file.read_text(encoding="utf-8")
    if file.suffix == ".rs":
        return list(range(text.split("#[cfg(test)]", maxsplit=1)[0].count("\n")))
    functions = [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.FunctionDef)]
    held = [node for function in functions for node in ast.walk(function) if isinstance(node, ast.stmt)]
    whole = [node for node in held if getattr(node, "test", node).end_lineno == node.lineno and not is_text(node)]
    return sorted({node.lineno - 1 for node in whole if not isinstance(node, ast.Import | ast.ImportFrom | ast.Pass)})


def is_text(node: ast.stmt) -> bool:
    """Whether a statement is a docstring."""
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)


def changed(file: Path, line: str, draws: random.Random) -> str | None:
    """Return a line with a fault in it; `None` where none can be drawn."""
    split = parts(file, line)
    if split is None:
        return None
    before, code, after = split
    drawn = []
    for pattern, by in CHANGES:
        if places := list(re.finditer(pattern, code)):
            place = draws.choice(places)
            drawn.append(code[: place.start()] + re.sub(pattern, by, place[0]) + code[place.end() :])
    if before.strip().endswith(("if", "while")):
        drawn.append(f"!({code})" if file.suffix == ".rs" else f"not ({code})")
    elif not before.strip() and (after or file.suffix == ".py") and not code.startswith(("return", "raise")):
        drawn.append("()" if after else "pass")
    drawn = [text for text in drawn if text != code]
    return before + draws.choice(drawn) + after if drawn else None


def switched(file: Path, fault: Fault, number: int) -> str:
    """Return a line of Rust that is faulty where its fault is chosen."""
    before, code, after = parts(file, fault.was) or ("", "", "")
    other = fault.now[len(before) : len(fault.now) - len(after)]
    end = after if not before.strip() else ""
    crate = "crate" if CORE in str(file) else "taxel_core"
    chosen = f"if {crate}::faults::planted({number}) {{ {other}{end} }} else {{ {code}{end} }}"
    return before + chosen + ("" if end else after)


def draw(clone: Path, seed: int) -> list[Fault]:
    """Return more faults than are wanted, in the order in which they are drawn."""
    found = []
    for name, room in ROOMS.items():
        draws = random.Random(f"{seed} {name}")
        files = sorted({file for glob in room["sources"] for file in clone.glob(glob) if file.name != "tests.rs"})
        places = [(file, line) for file in files for line in lines_of_code(file)]
        draws.shuffle(places)
        for file, line in places:
            was = file.read_text(encoding="utf-8").splitlines()[line]
            if faulty := changed(file, was, draws):
                found.append(Fault(name, str(file.relative_to(clone)), line + 1, was, faulty))
    return found


@functools.cache
def committed(clone: Path, name: str) -> list[str]:
    """Return the lines of a file as they were committed; none where it is gone."""
    command = ["git", "show", f"HEAD:{name}"]
    return subprocess.run(command, cwd=clone, capture_output=True, text=True, check=False).stdout.splitlines()


def standing(clone: Path, fault: Fault) -> Fault | None:
    """Return a fault where its line stands now, nearest to where it stood."""
    lines = committed(clone, fault.file)
    places = [number for number, line in enumerate(lines, 1) if line.strip() == fault.was.strip()]
    if not places:
        return None
    line = min(places, key=lambda number: abs(number - fault.line))
    was = lines[line - 1]
    return replace(fault, line=line, was=was, now=was[: len(was) - len(was.lstrip())] + fault.now.lstrip())


def put(file: Path, lines: list[str]) -> None:
    """Write a file, unless it has these lines: what is not written is not compiled again."""
    text = "\n".join(lines) + "\n"
    if not file.exists() or file.read_text(encoding="utf-8") != text:
        file.write_text(text, encoding="utf-8")


def build(clone: Path, faults: dict[int, Fault], target: Path) -> tuple[dict[str, str], set[int]]:
    """Compile Rust with all faults in it; return the programs by name, and the faults that do not compile."""
    put(clone / CORE / "faults.rs", SWITCH.splitlines())
    put(clone / CORE / "lib.rs", [*committed(clone, f"{CORE}/lib.rs"), "", "pub mod faults;"])
    for name in {fault.file for fault in faults.values() if fault.file.endswith(".rs")}:
        lines = [*committed(clone, name)]
        for number, fault in faults.items():
            if fault.file == name:
                lines[fault.line - 1] = switched(clone / name, fault, number)
        put(clone / name, lines)
    programs: dict[str, str] = {}
    how = ["--release", "--message-format=json", "--config", "profile.release.debug=false", "--target-dir", str(target)]
    extensions = ["build", "-p", "taxel-python", "-p", "taxel-rules", "--features", "taxel-python/test-hooks"]
    for command in (extensions, ["test", "-p", "taxel-core", "--no-run"]):
        done = subprocess.run(["cargo", *command, *how], cwd=clone, capture_output=True, text=True, check=False)
        said = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]
        errors = [m["message"] for m in said if m["reason"] == "compiler-message" and m["message"]["level"] == "error"]
        if done.returncode:
            spans = {(at["file_name"], at["line_start"]) for error in errors for at in error["spans"]}
            refused = {number for number, fault in faults.items() if (fault.file, fault.line) in spans}
            return {}, refused or sys.exit("\n".join(e["rendered"] for e in errors) or done.stderr)
        for built in said:
            if built["reason"] == "compiler-artifact" and (built["executable"] or "cdylib" in built["target"]["kind"]):
                programs[built["target"]["name"]] = built["executable"] or built["filenames"][0]
    shutil.copy(programs["_core"], clone / "python/taxel/_core.abi3.so")
    shutil.copy(programs["_rules"], clone / "rules/taxel_rules/_rules.abi3.so")
    return programs, set()


def run(clone: Path, fault: Fault, number: int, command: list[str], limit_s: float) -> tuple[str, int]:
    """Return what a command prints and returns with a fault planted, or without it where its number is 0."""
    if fault.file.endswith(".py"):
        lines = [*committed(clone, fault.file)]
        lines[fault.line - 1] = fault.now if number else fault.was
        put(clone / fault.file, lines)
    shutil.rmtree(clone / ".hypothesis", ignore_errors=True)  # examples that another fault failed
    done = subprocess.run(
        ["timeout", "--signal=KILL", str(max(1.0, limit_s)), *command],
        cwd=clone if command[0] == sys.executable else clone / "crates/taxel-core",
        env={**os.environ, "TAXEL_FAULT": str(number), "PYTHONPATH": f"{clone / 'python'}:{clone / 'rules'}"},
        capture_output=True,
        text=True,
        errors="replace",
        check=False,
    )
    return f"{done.stdout}\n{done.stderr}", done.returncode


def catching(clone: Path, programs: dict[str, str], fault: Fault, number: int) -> str | None:
    """Return the first test of the room that fails by the fault, and passes without it."""
    room = ROOMS[fault.room]
    for program, _, beginning in (test.partition(":") for test in room["rust"] if fault.file.endswith(".rs")):
        if program not in programs:
            continue
        (said, code), (sound, _) = (run(clone, fault, n, [programs[program], beginning], CARGO_S) for n in (number, 0))
        failed, left_out = (re.findall(r"^test (\S+) .*FAILED", text, re.MULTILINE) for text in (said, sound))
        found = [test for test in failed if test not in left_out]
        if found or (code and not failed):
            return f"{program}: {found[0] if found else f'returned {code}'}"
    pytest = [
        sys.executable,
        *["-m", "pytest", "-q", "-p", "no:cacheprovider", "--timeout", "100", "-x", "-m"],
        "not slow",
    ]
    for test in filter(None, fault.caught.values()):  # what caught it in another revision, before the whole room
        if "::test_" in test and [run(clone, fault, n, [*pytest, test], PYTEST_S)[1] for n in (number, 0)] == [1, 0]:
            return test
    end = time.monotonic() + PYTEST_S
    while True:
        tests = [name for name in room["python"] if "::" in name or name.startswith("-") or (clone / name).exists()]
        said, code = run(clone, fault, number, [*pytest, *tests], end - time.monotonic())
        failed = re.search(r"^(?:FAILED|ERROR) (.+?)(?: - |$)", said, re.MULTILINE)
        if code in (0, -signal.SIGKILL) or not failed:
            return f"pytest returned {code}" if code not in (0, -signal.SIGKILL) else None
        if not run(clone, fault, 0, [*pytest, failed[1]], PYTEST_S)[1]:
            return failed[1]
        room["python"] += ["--deselect", failed[1]]


def main() -> None:
    """Plant the faults in a clone of a revision, run the tests of their rooms, and keep what they catch."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("revision", help="the commit in which faults are planted")
    parser.add_argument("--seed", type=int, help="draw faults anew, by this seed")
    asked = parser.parse_args()
    scratch = ROOT / "target" / "faults"
    clone = scratch / asked.revision
    if not clone.exists():
        subprocess.run(["git", "clone", "-q", "--shared", "--no-checkout", str(ROOT), str(clone)], check=True)
        subprocess.run(["git", "checkout", "-q", "--detach", asked.revision], cwd=clone, check=True)
    kept = json.loads(KEPT.read_text(encoding="utf-8")) if asked.seed is None else []
    faults = [Fault(**fault) for fault in kept] or draw(clone, asked.seed)
    refused: set[Fault] = set()
    while True:
        wanted = [fault for fault in faults if kept or fault not in refused]
        chosen = [f for name, room in ROOMS.items() for f in [f for f in wanted if f.room == name][: room["faults"]]]
        here = {faults.index(fault) + 1: standing(clone, fault) for fault in chosen if fault not in refused}
        planted = {number: fault for number, fault in here.items() if fault}
        programs, worse = build(clone, planted, scratch / "target")
        if not worse:
            break
        print(f"{len(worse)} of {len(planted)} do not compile", flush=True)
        refused |= {faults[number - 1] for number in worse}
        for number in worse:
            put(clone / planted[number].file, committed(clone, planted[number].file))
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))  # of the tests: some faults take all
    for fault in chosen:
        if asked.revision in fault.caught:
            continue
        number = faults.index(fault) + 1
        now = planted.get(number)
        fault.caught[asked.revision] = catching(clone, programs, now, number) if now else GONE
        if now and fault.file.endswith(".py"):
            put(clone / fault.file, committed(clone, fault.file))
        print(f"{fault.room} {fault.file}:{fault.line} {fault.caught[asked.revision]}", flush=True)
        KEPT.write_text(json.dumps([asdict(fault) for fault in chosen], indent=1) + "\n", encoding="utf-8")
    for name in ROOMS:
        said = [fault.caught[asked.revision] for fault in chosen if fault.room == name]
        print(f"{name:13} {len(said)} faults, {said.count(GONE)} gone, {said.count(None)} not caught")
    newly = [
        f for f in chosen if f.caught[asked.revision] is None and any(v not in (None, GONE) for v in f.caught.values())
    ]
    sys.exit("\n".join(f"caught before: {f.file}:{f.line} {f.now.strip()}" for f in newly) or None)


if __name__ == "__main__":
    main()
