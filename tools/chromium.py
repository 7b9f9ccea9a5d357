"""Find the Chromium that shows pages to tests, and install one where there is none: `python tools/chromium.py`."""

import contextlib
import os
import shutil
import subprocess
import sys
from pathlib import Path

from playwright.sync_api import sync_playwright

LACKING = "no Chromium: on Debian, apt install chromium; elsewhere, .venv/bin/playwright install chromium"


def chromium() -> str | None:
    """Return the browser's program: the system's, or Playwright's own where it starts here."""
    if found := next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None):
        return found
    with sync_playwright() as started:
        own = started.chromium.executable_path
    # Where only the program was fetched, it lacks libraries of the system.
    starts = Path(own).exists() and subprocess.run([own, "--version"], capture_output=True, check=False).returncode == 0
    return own if starts else None


def install(*commands: list[str]) -> str | None:
    """Run the commands of one way to install a browser, as far as they succeed, and return its program."""
    print(f"taxel: installing Chromium: {' '.join(commands[-1])}", flush=True)
    with contextlib.suppress(subprocess.SubprocessError):
        for command in commands:
            subprocess.run(command, check=True, capture_output=True, stdin=subprocess.DEVNULL, timeout=600)
    return chromium()


def main() -> None:
    """Install a browser, unless there is one."""
    found = chromium() or install([sys.executable, "-m", "playwright", "install", "chromium"])
    if not found and shutil.which("apt-get") and os.geteuid() == 0:
        found = install(["apt-get", "update"], ["apt-get", "install", "-y", "chromium"])
    if not found:
        sys.exit(LACKING)


if __name__ == "__main__":
    main()
