"""What the RTL has of registers is what registers.toml says."""

import subprocess
import sys

from logic import RTL


def test_quick_what_is_made_is_as_made(tmp_path):
    subprocess.run([sys.executable, str(RTL / "tools" / "registers.py"), str(tmp_path)], check=True)
    for name in ("taxel_registers.sv", "taxel_power_law.sv"):
        assert (tmp_path / name).read_text() == (RTL / name).read_text(), "make rtl-registers"


def test_quick_each_module_is_in_a_file_of_its_name():
    for file in RTL.glob("taxel_*.sv"):
        kind = "package" if file.stem in ("taxel_types", "taxel_registers") else "module"
        assert f"\n{kind} {file.stem}" in "\n" + file.read_text()
