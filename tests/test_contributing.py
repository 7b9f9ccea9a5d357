"""The examples of CONTRIBUTING work: added to a copy they give a format, a study, an encoder, a rule, an option ..."""

from __future__ import annotations

import json
import os
import re
import runpy
import shutil
import subprocess
import sys
import zipfile
from functools import partial
from pathlib import Path
from typing import NamedTuple

import pytest

from taxel import _core

ROOT = Path(__file__).resolve().parents[1]
EXAMPLES = ROOT / "tests" / "contributing"
FORMAT, STUDY, ENCODER, RULE, PAGE, OPTION = "format", "study", "encoder", "rule", "page", "option"
#: The tests that check the laws and registries of formats, studies, encoders, learning rules, and parts of the page.
TESTS = {
    FORMAT: ["tests/formats/test_registry.py", "tests/formats/test_channel.py"],
    STUDY: [
        f"studies/tests/{name}.py"
        for name in ("test_study_registry", "test_quiet", "test_studies", "test_public_names")
    ],
    ENCODER: ["tests/encode/test_laws.py", "tests/encode/test_binary.py"],
    RULE: ["rules/tests/test_laws.py", "rules/tests/test_echo.py"],
    PAGE: ["tests/panel/test_page.py", "tests/panel/test_page_clients.py"],
    OPTION: ["tests/test_docstrings.py", "tests/panel/test_page_mounted.py"],
}


class Piece(NamedTuple):
    """A file of an example, or a fenced piece of CONTRIBUTING whose first line names the file and the place in it."""

    path: str
    after: str
    text: str


def lines(page: str) -> list[Piece]:
    """Return the lines that a part of CONTRIBUTING adds to files."""
    found = re.findall(
        r"^```(?:python\n#|(?:rust|js)\n//|html\n<!--) (\S+?), (at the end|after [^\n]+?)(?: -->)?\n(.*?)^```",
        page,
        re.MULTILINE | re.DOTALL,
    )
    return [Piece(*piece) for piece in found]


def of(name: str) -> list[Piece]:
    """Return the pieces of one example: its files, and the lines of the section that names its folder."""
    folder = EXAMPLES / name
    files = sorted(file for file in folder.rglob("*.*") if file.suffix in (".py", ".rs", ".js"))
    sections = (ROOT / "CONTRIBUTING.md").read_text().split("\n## ")
    (section,) = (section for section in sections if f"`tests/contributing/{name}`" in section)
    return [*(Piece(str(file.relative_to(folder)), "", file.read_text()) for file in files), *lines(section)]


def add(root: Path, piece: Piece) -> None:
    """Add a piece as CONTRIBUTING says."""
    file = root / piece.path
    if not piece.after:
        assert not file.exists(), f"{piece.path} is there already"
        file.write_text(piece.text)
        return
    there = file.read_text().splitlines(keepends=True)
    anchor = piece.after.removeprefix("after ").strip('"')
    at = len(there) if piece.after == "at the end" else 1 + next(k for k, line in enumerate(there) if anchor in line)
    gap = "\n\n" if piece.after == "at the end" else ""
    file.write_text("".join([*there[:at], gap, piece.text, *there[at:]]))


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """A copy of the package, its tests and their settings."""
    unneeded = shutil.ignore_patterns("__pycache__", "*.so", ".hypothesis")
    shutil.copytree(ROOT / "python", tmp_path / "python", ignore=unneeded)
    for beside in ("rules", "studies"):
        shutil.copytree(ROOT / beside, tmp_path / beside, ignore=unneeded)
    for package in ("python/taxel", "rules/taxel_rules"):
        for compiled in (ROOT / package).glob("*.so"):
            (tmp_path / package / compiled.name).symlink_to(compiled)
    for room in ("formats", "learn", "recording"):
        shutil.copytree(ROOT / "tests" / room, tmp_path / "tests" / room, ignore=unneeded)
    for shared in (ROOT / "tests").glob("*.py"):
        shutil.copy(shared, tmp_path / "tests")
    for settings in ("pyproject.toml", "conftest.py"):
        shutil.copy(ROOT / settings, tmp_path)
    # Studies refer to pages of the documentation.
    shutil.copytree(ROOT / "docs", tmp_path / "docs", ignore=shutil.ignore_patterns("_build", "pictures"))
    return tmp_path


def tried(root: Path, name: str) -> subprocess.CompletedProcess[str]:
    """Run the tests of one addition, and those of its registry."""
    added = {piece.path for piece in of(name)}
    tests = [test for test in TESTS[name] if (root / test).exists() or test not in added]
    # A missing line may break the imports of one test file; the other files then name it.
    quietly = ["-q", "-p", "no:cacheprovider", "--continue-on-collection-errors"]
    command = [sys.executable, "-m", "pytest", *quietly, *tests]
    about = {STUDY: "quiet or registry or without_weight", RULE: "echo or Echo or nothing_is_left_out"}
    about[FORMAT] = "test_channel or registry"
    about[ENCODER] = "binary or nothing_is_left_out"
    about[OPTION] = "live or option or signature"
    chosen = ["-k", about[name]] if name in about else []
    environment = os.environ | {"PYTHONPATH": ":".join(str(root / name) for name in ("python", "rules", "studies"))}
    return subprocess.run([*command, *chosen], cwd=root, env=environment, capture_output=True, text=True, check=False)


def test_an_example_is_files_and_lines() -> None:
    folder = "crates/taxel-panel"
    assert {name: [(p.path, bool(p.after)) for p in of(name)] for name in TESTS} == {
        FORMAT: [
            ("python/taxel/formats/channel.py", False),
            ("tests/formats/test_channel.py", False),
            ("python/taxel/formats/__init__.py", True),
            ("tests/formats/making.py", True),
        ],
        STUDY: [
            ("studies/taxel_studies/quiet.py", False),
            ("studies/tests/test_quiet.py", False),
            ("studies/taxel_studies/__init__.py", True),
        ],
        ENCODER: [
            ("benchmarks/taxel_benchmarks/encode_binary.py", False),
            ("crates/taxel-core/src/encode/binary.rs", False),
            ("python/taxel/encode/binary.py", False),
            ("tests/encode/test_binary.py", False),
            ("crates/taxel-core/src/encode.rs", True),
            ("python/taxel/encode/__init__.py", True),
        ],
        RULE: [
            ("rules/src/rules/echo.rs", False),
            ("rules/taxel_rules/echo.py", False),
            ("rules/tests/test_echo.py", False),
            ("rules/src/rules.rs", True),
            ("rules/taxel_rules/__init__.py", True),
        ],
        PAGE: [
            (f"{folder}/web/clients.js", False),
            ("tests/panel/test_page_clients.py", False),
            (f"{folder}/web/index.html", True),
            *3 * [(f"{folder}/web/main.js", True)],
            *(
                (f"{folder}/src/{file}.rs", True)
                for file in ("assets", "protocol/request", "requests", "protocol/messages")
            ),
        ],
        OPTION: [
            ("tests/panel/test_page_mounted.py", False),
            ("crates/taxel-live/src/pipeline/options.rs", True),
        ],
    }
    assert sorted(TESTS) == sorted(folder.name for folder in EXAMPLES.iterdir())
    added = [piece for name in TESTS for piece in of(name) if piece.after]
    assert sorted(added) == sorted(lines((ROOT / "CONTRIBUTING.md").read_text()))


@pytest.mark.parametrize("name", [FORMAT, pytest.param(STUDY, marks=pytest.mark.slow)])
def test_what_contributing_says_is_enough(copy: Path, name: str) -> None:
    for piece in of(name):
        add(copy, piece)
    done = tried(copy, name)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-1000:]
    assert " passed" in done.stdout


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "without", "said"),
    [
        (FORMAT, "formats/__init__.py", "FORMATS lacks channel"),
        (FORMAT, "making.py", "write_channel"),
        (FORMAT, "test_channel.py", "add tests/formats/test_channel.py"),
        (FORMAT, "formats/channel.py", "No module named 'taxel.formats.channel'"),
        (STUDY, "taxel_studies/__init__.py", "STUDIES lacks quiet"),
        (STUDY, "test_quiet.py", "no test of studies/tests imports or names quiet"),
        (STUDY, "taxel_studies/quiet.py", "No module named 'taxel_studies.quiet'"),
    ],
)
def test_a_part_that_is_left_out_is_named(copy: Path, name: str, without: str, said: str) -> None:
    left = [piece for piece in of(name) if not piece.path.endswith(without)]
    assert len(left) == len(of(name)) - 1
    for piece in left:
        add(copy, piece)
    done = tried(copy, name)
    assert done.returncode != 0
    assert said in done.stdout + done.stderr, done.stdout[-3000:] + done.stderr[-1000:]


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A whole copy with the pieces of encoder, rule and page, whose extension is built from them."""
    root = tmp_path_factory.mktemp("built")
    tracked = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout.split()
    for name in tracked:
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, root / name)
    for piece in (*of(ENCODER), *of(RULE), *of(PAGE), *of(OPTION)):
        add(root, piece)
    # Dependencies are not built again: the copy uses the checkout's.
    made = ["build", "--release", "--quiet", "--features", "test-hooks"]
    made += ["--target-dir", str(ROOT / "target"), "--out", str(root / "wheel")]
    for manifest, folder in (("crates/taxel-python", "python"), ("rules", "rules")):
        build = [Path(sys.executable).with_name("maturin"), *made, "--manifest-path", f"{manifest}/Cargo.toml"]
        subprocess.run(build, cwd=root, check=True, capture_output=True)
        (wheel,) = (root / "wheel").glob("*.whl")
        with zipfile.ZipFile(wheel) as inside:
            (compiled,) = (name for name in inside.namelist() if name.endswith(".so"))
            inside.extract(compiled, root / folder)
        wheel.unlink()
    return root


@pytest.mark.slow
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("name", [ENCODER, RULE])
def test_what_contributing_says_of_rust_is_enough(built: Path, name: str) -> None:
    done = tried(built, name)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-1000:]
    assert re.search(r"\b([5-9]|\d\d+) passed", done.stdout), done.stdout[-1000:]


@pytest.mark.slow
@pytest.mark.timeout(1800)
@pytest.mark.parametrize(
    ("without", "said"),
    [
        ("rules/taxel_rules/__init__.py", "a line in taxel_rules/__init__.py"),
        ("rules/tests/test_echo.py", "rules/tests/test_echo.py"),
        ("rules/taxel_rules/echo.py", "No module named 'taxel_rules.echo'"),
    ],
)
def test_a_part_of_a_rule_that_is_left_out_is_named(built: Path, without: str, said: str) -> None:
    whole = (built / without).read_text()
    try:
        if without.endswith("__init__.py"):
            shutil.copy(ROOT / without, built / without)
        else:
            (built / without).unlink()
        done = tried(built, RULE)
    finally:
        (built / without).write_text(whole)
    assert done.returncode != 0
    assert said in done.stdout + done.stderr, done.stdout[-3000:] + done.stderr[-1000:]


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_what_contributing_says_of_the_page_is_enough(built: Path) -> None:
    environment = os.environ | {"PYTHONPATH": str(built / "python")}
    for tool in ("messages", "page_types"):
        done = subprocess.run(
            [sys.executable, f"tools/{tool}.py"],
            cwd=built,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stdout + done.stderr
    assert "export interface Clients {" in (built / "crates/taxel-panel/web/messages.d.ts").read_text()
    done = tried(built, PAGE)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-1000:]


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_what_contributing_says_of_an_option_is_enough(built: Path) -> None:
    environment = os.environ | {"PYTHONPATH": str(built / "python")}
    subprocess.run([sys.executable, "tools/messages.py"], cwd=built, env=environment, check=True)
    done = tried(built, OPTION)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-1000:]
    assert " passed" in done.stdout


def test_an_option_in_rust_is_one_of_python_and_of_the_command_line(copy: Path) -> None:
    """Without a build: what Rust hands over, with one more field."""
    made = runpy.run_path(str(ROOT / "tools" / "messages.py"))["made"]
    schemas = json.loads(_core.message_schemas())
    field = {"type": "number", "minimum": 0, "default": 2.5, "description": "How long it rings, s.\n\nOr more."}
    schemas["options"]["properties"]["rings"] = field
    for path, text in made(schemas, copy).items():
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    seen = """if True:
        import inspect
        from taxel.live import Live
        print(inspect.signature(Live).parameters["rings"])
        print("rings : float, 0 or more\\n        How long it rings, s. Or more." in Live.__doc__)
    """
    environment = os.environ | {"PYTHONPATH": str(copy / "python"), "COLUMNS": "200"}
    run = partial(subprocess.run, env=environment, capture_output=True, text=True, check=False)
    shown = run([sys.executable, "-m", "taxel", "live", "--help"]).stdout
    assert re.search(r"--rings <float range> +How long it rings, s\.  \[default: 2\.5; x>=0", shown), shown
    done = run([sys.executable, "-c", seen])
    assert done.stdout.splitlines() == ["rings: 'float' = 2.5", "True"], done.stdout + done.stderr
    refused = run([sys.executable, "-m", "taxel", "live", "--rings", "-1", "--panel"])
    assert "--rings" in refused.stderr
    assert "-1" in refused.stderr


def test_a_rule_without_its_line_in_rust_is_named(copy: Path) -> None:
    for piece in of(RULE):
        if not piece.path.endswith(".rs"):
            add(copy, piece)
    done = tried(copy, RULE)
    assert done.returncode != 0
    assert "echo: nothing with this name has parameters" in done.stdout + done.stderr
