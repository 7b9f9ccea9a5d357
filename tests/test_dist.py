"""`make dist` builds a complete source package, and wheels that run without cargo and without the checkout."""

import json
import os
import platform
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


#: The end of the name of a wheel that this machine can install.
HERE = f"manylinux_2_28_{platform.machine()}.whl"
#: Wheels with a compiled part: those of every target that `make dist` found a standard library for.
COMPILED = sorted([*DIST.glob("taxel-*.whl"), *DIST.glob("taxel_rules-*.whl")])
each_wheel = pytest.mark.parametrize("wheel", COMPILED, ids=lambda wheel: wheel.name)
#: Libraries that every Windows since 10 has, and Python's.
OF_WINDOWS = {
    "advapi32", "bcryptprimitives", "cfgmgr32", "kernel32", "ntdll", "python3", "setupapi", "userenv", "ws2_32",
}  # fmt: skip


def test_there_is_a_wheel_for_this_machine() -> None:
    assert the(f"taxel-*{HERE}")
    assert the(f"taxel_rules-*{HERE}")


@each_wheel
def test_a_wheel_is_for_any_python_from_3_11_and_for_a_system_that_is_tested(wheel: Path) -> None:
    assert re.search(r"-cp311-abi3-(manylinux_2_28_(x86_64|aarch64)|win_amd64)\.whl$", wheel.name)


@each_wheel
def test_a_wheel_for_linux_is_for_any_glibc_from_2_28(wheel: Path) -> None:
    if "manylinux" not in wheel.name:
        pytest.skip("not for Linux")
    auditwheel = Path(sys.executable).with_name("auditwheel")
    said = subprocess.run([auditwheel, "show", str(wheel)], capture_output=True, text=True, check=True).stdout
    said = " ".join(said.split())
    glibc = re.search(r'consistent with the following platform tag: "manylinux_2_(\d+)_(\w+)"', said)
    assert glibc, said
    assert int(glibc[1]) <= 28
    assert wheel.name.endswith(f"{glibc[2]}.whl")


@each_wheel
def test_a_wheel_for_windows_needs_no_library_that_windows_lacks(wheel: Path) -> None:
    if "win_amd64" not in wheel.name:
        pytest.skip("not for Windows")
    archive = zipfile.ZipFile(wheel)
    (extension,) = (name for name in archive.namelist() if name.endswith(".pyd"))
    wanted = {name.decode().lower() for name in re.findall(rb"([\w-]+)\.dll\0", archive.read(extension), re.IGNORECASE)}
    assert "python3" in wanted
    own = Path(extension).stem
    assert {name for name in wanted - {own} if not name.startswith("api-ms-win-")} <= OF_WINDOWS


@each_wheel
def test_a_wheel_holds_all_that_is_no_python(wheel: Path) -> None:
    package, module, root = (
        ("taxel", "_core", "python") if wheel.name.startswith("taxel-") else ("taxel_rules", "_rules", "rules")
    )
    inside = zipfile.ZipFile(wheel).namelist()
    data = [path.relative_to(ROOT / root) for path in (ROOT / root / package).rglob("*") if path.is_file()]
    wanted = {path.as_posix() for path in data if path.suffix not in (".pyc", ".so", ".pyd")}
    assert wanted <= set(inside)
    assert any(name.startswith(f"{package}/{module}") and name.endswith((".so", ".pyd")) for name in inside)


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
                "python/taxel/panel/web",
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
    bare.install(str(the(f"taxel-*{HERE}")))
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
    the(f"taxel_rules-*{HERE}")
    bare.install("--find-links", str(DIST), "taxel[studies]")
    ended = bare.run("taxel", "study", "fig6.1", "--size", "toy", "--report", "report")
    assert ended.returncode == 0, ended.stderr
    assert "fig6.1, size toy" in ended.stdout
    assert (tmp_path / "report" / "index.html").exists()


def test_the_viewers_install_beside_the_wheel(tmp_path: Path) -> None:
    bare = Bare(tmp_path)
    bare.install("--find-links", str(DIST), str(the("taxel_viewers-*.whl")))
    assert "\n  show  " in bare.run("taxel", "--help").stdout
    ended = bare.run("taxel", "show", "board:127.0.0.1:0", "rerun")
    assert (ended.returncode, ended.stderr) == (
        2,
        "taxel: rerun is not installed: pip install 'taxel[rerun]'\n",
    )


def test_the_makers_formats_install_beside_the_wheel(tmp_path: Path) -> None:
    bare = Bare(tmp_path)
    the("taxel_makers-*.whl")
    bare.install("--find-links", str(DIST), "taxel[makers]")
    (tmp_path / "skin.tact").write_text("".join(f"{k % 2} {k % 80} {k / 100}\n" for k in range(99)))
    ended = bare.run("taxel", "info", "skin.tact", "--json")
    assert (ended.returncode, json.loads(ended.stdout)["kind"]) == (0, "neutouch"), ended.stderr


def test_the_benchmarks_install_beside_the_wheel(tmp_path: Path) -> None:
    bare = Bare(tmp_path)
    bare.install("--find-links", str(DIST), str(the("taxel_benchmarks-*.whl")))
    assert "\n  bench  " in bare.run("taxel", "--help").stdout
    ended = bare.run("taxel", "bench", "encode_moments", "--quick")
    assert ended.returncode == 0, ended.stderr
    assert ended.stdout.startswith("encode_moments: ratios")
