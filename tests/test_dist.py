"""What `make dist` builds: a source package that is whole, a wheel that runs without cargo and the checkout."""

import os
import re
import subprocess
import sys
import tarfile
import venv
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
DIST = ROOT / "dist"

pytestmark = [pytest.mark.slow, pytest.mark.timeout(1800)]


def the(pattern: str) -> Path:
    found = list(DIST.glob(pattern))
    assert len(found) == 1, f"{DIST} holds {[path.name for path in found]}: make dist first"
    return found[0]


def test_the_wheel_is_for_any_python_from_3_11_and_any_glibc_from_2_28() -> None:
    wheel = the("*.whl")
    assert re.fullmatch(r"taxel-[\d.]+-cp311-abi3-manylinux_2_28_x86_64\.whl", wheel.name)
    auditwheel = Path(sys.executable).with_name("auditwheel")
    said = subprocess.run([auditwheel, "show", str(wheel)], capture_output=True, text=True, check=True).stdout
    said = " ".join(said.split())
    glibc = re.search(r'consistent with the following platform tag: "manylinux_2_(\d+)_x86_64"', said)
    assert glibc, said
    assert int(glibc[1]) <= 28


def test_the_wheel_holds_all_that_is_no_python() -> None:
    inside = zipfile.ZipFile(the("*.whl")).namelist()
    data = [path.relative_to(ROOT / "python") for path in (ROOT / "python").rglob("*") if path.is_file()]
    wanted = {str(path) for path in data if path.suffix not in (".pyc", ".so")}
    assert wanted <= set(inside)
    assert any(name.startswith("taxel/_core") and name.endswith(".so") for name in inside)


def test_the_source_package_holds_what_a_build_needs_and_no_more() -> None:
    with tarfile.open(the("*.tar.gz")) as archive:
        inside = {name.split("/", 1)[1] for name in archive.getnames() if "/" in name}
    tracked = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout.split()
    needed = {
        path for path in tracked if path.startswith(("crates/taxel-core/src", "crates/taxel-live/src", "crates/taxel-panel/src", "crates/taxel-panel/web", "python/taxel/"))
    }
    assert needed | {"Cargo.lock", "pyproject.toml", "README.md", "LICENSE"} <= inside
    assert not {name for name in inside if name.startswith((".venv", "target"))}


def test_the_wheel_runs_the_demo_in_a_bare_environment(tmp_path: Path) -> None:
    venv.create(tmp_path / "bare", with_pip=True)
    python = tmp_path / "bare" / "bin" / "python"
    bare = {
        "PATH": "/usr/bin:/bin",
        "HOME": str(tmp_path),
        **{k: v for k, v in os.environ.items() if "proxy" in k.lower()},
    }
    bare |= {name: value for name, value in os.environ.items() if name.startswith(("PIP_", "SSL_"))}
    installed = subprocess.run(
        [python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", str(the("*.whl"))],
        capture_output=True,
        text=True,
        check=False,
        env=bare,
        cwd=tmp_path,
    )
    assert installed.returncode == 0, installed.stderr
    command = [python.with_name("taxel"), "demo", "--no-clock", "--scenes", "2", "--seed", "1", "--folder", "report"]
    ended = subprocess.run(command, capture_output=True, text=True, check=False, env=bare, cwd=tmp_path, timeout=600)
    assert ended.returncode == 0, ended.stderr
    assert (tmp_path / "report" / "report.html").stat().st_size > 100_000
    where = subprocess.run(
        [python, "-c", "import taxel; print(taxel.__file__)"],
        capture_output=True,
        text=True,
        check=True,
        env=bare,
        cwd=tmp_path,
    )
    assert where.stdout.startswith(str(tmp_path))
