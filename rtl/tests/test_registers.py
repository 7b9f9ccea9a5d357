"""The RTL's package of registers is what registers.toml says."""

import subprocess
import sys

from logic import RTL


def test_quick_the_package_is_as_made(tmp_path):
    to = tmp_path / "taxel_registers.sv"
    subprocess.run([sys.executable, str(RTL / "tools" / "registers.py"), str(to)], check=True)
    assert to.read_text() == (RTL / "taxel_registers.sv").read_text(), "make rtl-registers"


def test_quick_each_module_is_in_a_file_of_its_name():
    for file in RTL.glob("taxel_*.sv"):
        kind = "package" if file.stem in ("taxel_types", "taxel_registers") else "module"
        assert f"\n{kind} {file.stem}" in "\n" + file.read_text()
