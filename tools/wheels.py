"""Build the wheels of taxel and taxel_rules for each target that this machine can build, to dist/ (`make dist`).

Usage: python tools/wheels.py. Zig, a wheel of PyPI, links for every target and compiles its C parts. A target also needs Rust's
standard library: compiled, or its source, from which it is built. For another target one line says what it needs.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
BIN = Path(sys.executable).parent
#: Crates with a compiled part, and its name.
CRATES = {"crates/taxel-python": "_core", "rules": "_rules"}
#: What Rust calls a target, and what a user does.
TARGETS = {
    "x86_64-unknown-linux-gnu": "Linux on x86-64",
    "aarch64-unknown-linux-gnu": "Linux on ARM",
    "x86_64-pc-windows-gnu": "Windows on x86-64",
}
#: The glibc of 2018, whatever this machine has; auditwheel checks it.
GLIBC = "manylinux_2_28"


def rustc(*asked: str) -> Path:
    """Return a path that the compiler prints."""
    command = [os.environ.get("RUSTC", "rustc"), "--print", *asked]
    return Path(subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip())


def library(target: str) -> dict[str, str] | None:
    """Return the variables by which cargo finds a target's standard library or builds it; None if it can do neither."""
    if any(rustc("target-libdir", "--target", target).glob("libstd-*")):
        return {}
    if (rustc("sysroot") / "lib/rustlib/src/rust/library/std").is_dir():
        # Building the standard library is not stable: the variable lets a released compiler do it.
        return {"RUSTC_BOOTSTRAP": "1", "CARGO_UNSTABLE_BUILD_STD": "std,panic_abort"}
    return None


def build(target: str, variables: dict[str, str]) -> None:
    """Build the wheels of a target, and check the glibc of those for Linux."""
    environment = {**os.environ, **variables, "PATH": f"{BIN}{os.pathsep}{os.environ['PATH']}"}
    if "windows" in target:
        # Maturin's own way, --zig, passes a list of exports that lld refuses (1.16): to other crates too, by a name with a dot.
        environment |= {"CARGO": str(BIN / "cargo-zigbuild"), "ZIG_COMMAND": f"{sys.executable} -m ziglang"}
    for crate, module in CRATES.items():
        before = set((ROOT / "dist").glob("*.whl"))
        command = ["maturin", "build", "--release", "--target", target]
        command += ["--out", "dist", "--manifest-path", f"{crate}/Cargo.toml"]
        if "linux" in target:
            command += ["--zig", "--compatibility", GLIBC]
        else:
            # Without this list zig's linker exports, and so keeps, every function.
            exports = ROOT / "target" / f"{module}.def"
            exports.write_text(f"EXPORTS\n    PyInit_{module}\n")
            command += ["--", "-C", f"link-arg={exports}"]
        subprocess.run(command, cwd=ROOT, env=environment, check=True)
        if "linux" in target:
            (wheel,) = set((ROOT / "dist").glob("*.whl")) - before
            subprocess.run([BIN / "auditwheel", "show", wheel], check=True)


def main() -> int:
    """Build what can be built; fail where that is nothing."""
    built = 0
    for target, name in TARGETS.items():
        variables = library(target)
        if variables is None:
            print(
                f"dist: no wheel for {name}, which needs Rust's standard library: rustup target add {target}, "
                "or its source: rustup component add rust-src",
                flush=True,
            )
        else:
            build(target, variables)
            built += 1
    return 0 if built else 1


if __name__ == "__main__":
    sys.exit(main())
