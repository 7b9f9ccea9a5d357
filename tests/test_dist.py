"""`make dist` builds a complete source package, and a wheel that runs without cargo and without the checkout."""

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
    wheel = the("taxel-*.whl")
    assert re.fullmatch(r"taxel-[\d.]+-cp311-abi3-manylinux_2_28_x86_64\.whl", wheel.name)
    auditwheel = Path(sys.executable).with_name("auditwheel")
    said = subprocess.run([auditwheel, "show", str(wheel)], capture_output=True, text=True, check=True).stdout
    said = " ".join(said.split())
    glibc = re.search(r'consistent with the following platform tag: "manylinux_2_(\d+)_x86_64"', said)
    assert glibc, said
    assert int(glibc[1]) <= 28


def test_the_wheel_holds_all_that_is_no_python() -> None:
    inside = zipfile.ZipFile(the("taxel-*.whl")).namelist()
    data = [path.relative_to(ROOT / "python") for path in (ROOT / "python").rglob("*") if path.is_file()]
    wanted = {str(path) for path in data if path.suffix not in (".pyc", ".so")}
    assert wanted <= set(inside)
    assert any(name.startswith("taxel/_core") and name.endswith(".so") for name in inside)


def test_the_source_package_holds_what_a_build_needs_and_no_more() -> None:
    with tarfile.open(the("*.tar.gz")) as archive:
        inside = {name.split("/", 1)[1] for name in archive.getnames() if "/" in name}
    tracked = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout.split()
    needed = {
        path
        for path in tracked
        if path.startswith(
            (
                "crates/taxel-core/src",
                "crates/taxel-live/src",
                "crates/taxel-panel/src",
                "crates/taxel-panel/web",
                "python/taxel/",
            )
        )
    }
    assert needed | {"Cargo.lock", "pyproject.toml", "README.md", "LICENSE"} <= inside
    assert not {name for name in inside if name.startswith((".venv", "target"))}


class Bare:
    """An environment with pip alone, which cannot import from the checkout."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.bin = folder, folder / "bare" / "bin"
        venv.create(folder / "bare", with_pip=True)
        kept = {k: v for k, v in os.environ.items() if "proxy" in k.lower() or k.startswith(("PIP_", "SSL_"))}
        self.environment = {"PATH": "/usr/bin:/bin", "HOME": str(folder), **kept}

    def run(self, program: str, *arguments: str) -> subprocess.CompletedProcess[str]:
        """Run a program of this environment."""
        command = [str(self.bin / program), *arguments]
        given = {"env": self.environment, "cwd": self.folder, "timeout": 600}
        return subprocess.run(command, capture_output=True, text=True, check=False, **given)  # type: ignore[call-overload,no-any-return]

    def install(self, *wanted: str) -> None:
        """Install packages."""
        done = self.run("python", "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *wanted)
        assert done.returncode == 0, done.stderr


def test_the_wheel_runs_the_demo_in_a_bare_environment(tmp_path: Path) -> None:
    bare = Bare(tmp_path)
    bare.install(str(the("taxel-*.whl")))
    ended = bare.run("taxel", "demo", "--no-clock", "--scenes", "2", "--seed", "1", "--folder", "report")
    assert ended.returncode == 0, ended.stderr
    assert (tmp_path / "report" / "report.html").stat().st_size > 100_000
    where = bare.run("python", "-c", "import taxel; print(taxel.__file__)")
    assert where.stdout.startswith(str(tmp_path))
    hooks = bare.run(
        "python", "-c", "from taxel import _core; print(hasattr(_core, 'Live'), hasattr(_core, 'test_hook'))"
    )
    assert hooks.stdout == "True False\n", "what only tests call does not ship"
    without = bare.run("taxel", "study", "fig6.1", "--size", "toy")
    assert without.returncode == 2
    assert without.stderr == "taxel: No such command 'study'; see taxel --help\n"


def test_the_studies_install_beside_the_wheel(tmp_path: Path) -> None:
    bare = Bare(tmp_path)
    the("taxel_studies-*.whl")
    the("taxel_rules-*.whl")
    bare.install("--find-links", str(DIST), "taxel[studies]")
    ended = bare.run("taxel", "study", "fig6.1", "--size", "toy", "--report", "report")
    assert ended.returncode == 0, ended.stderr
    assert "fig6.1, size toy" in ended.stdout
    assert (tmp_path / "report" / "index.html").exists()


def test_the_viewers_install_beside_the_wheel(tmp_path: Path) -> None:
    bare = Bare(tmp_path)
    bare.install("--find-links", str(DIST), str(the("taxel_viewers-*.whl")))
    assert "\n  show  " in bare.run("taxel", "--help").stdout
    ended = bare.run("taxel", "show", "walk.mcap", "foxglove")
    assert (ended.returncode, ended.stderr) == (
        2,
        "taxel: foxglove is not installed: pip install 'taxel[foxglove]'\n",
    )


def test_the_benchmarks_install_beside_the_wheel(tmp_path: Path) -> None:
    bare = Bare(tmp_path)
    bare.install("--find-links", str(DIST), str(the("taxel_benchmarks-*.whl")))
    assert "\n  bench  " in bare.run("taxel", "--help").stdout
    ended = bare.run("taxel", "bench", "encode_moments", "--quick")
    assert ended.returncode == 0, ended.stderr
    assert ended.stdout.startswith("encode_moments: ratios")
