"""Draw the pictures of the page: python docs/page_pictures.py.

The commands of the event board on *Start here* run in a new folder. `docs/pictures/panel.png` is their recording in
Chromium, with its labels and what the readout detects; `board-live.png` is the board while it runs.
"""

from __future__ import annotations

import contextlib
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import PIL.Image
from playwright.sync_api import sync_playwright

DOCS = Path(__file__).resolve().parent
sys.path[:0] = [str(DOCS.parent), str(DOCS.parent / "tests")]  # the tests walk these pages too

from tests.panel.browser import CHROMIUM, FLAGS, running
from tests.panel.pages import clock, shows, until
from tests.test_start import PAGE, Shell, blocks, waits_for_another

#: Loaded taxels from which on the board is drawn.
TOUCHED = 60
#: From this time of the board, s.
WATCHED_S = 5.5
URL = r"(http://127\.0\.0\.1:\d+/#\S+)"


def save(page: Any, name: str) -> None:
    """Save what is seen, in a palette: a third of the size."""
    file = DOCS / "pictures" / f"{name}.png"
    page.screenshot(path=file)
    with PIL.Image.open(file) as picture:
        small = picture.convert("RGB").quantize(256, kmeans=2, dither=PIL.Image.Dither.NONE)
    small.save(file, optimize=True)
    print(f"{file.name}: {file.stat().st_size / 1000:.0f} kB")


@contextlib.contextmanager
def seen(browser: Any, folder: Path, *arguments: str) -> Iterator[Any]:
    """Open what a command serves."""
    page = browser.new_context(viewport={"width": 1400, "height": 900}).new_page()
    with running(*arguments, folder=folder) as server:
        page.goto(server.wait_for(URL))
        yield page
    page.context.close()


def draw_recording(browser: Any) -> None:
    """Draw the recording with its labels and what its readout detects."""
    with seen(browser, Path.cwd(), "view", "ball.mcap", "--no-open") as page:
        shows(page, "state-word", "^Replay$")
        page.locator("#readout").select_option("touch.json")
        until(lambda: page.locator("#detection-list li").count(), "its detections")
        page.wait_for_timeout(1000)
        if page.locator("#notice-close").is_visible():
            page.locator("#notice-close").click()
        page.mouse.move(700, 5)
        page.wait_for_timeout(3000)
        save(page, "panel")


def draw_board(browser: Any) -> None:
    """Draw the emulated board while it runs."""
    shell = Shell()
    port = str(shell.port)
    with (
        seen(browser, Path.cwd(), "live", "--panel", "--host", "127.0.0.1", "--port", port) as page,
        running("emulate", "--port", port, "--wire", "2", "--seed", "1", folder=Path.cwd()),
    ):
        shows(page, "state-word", "^Live$")
        until(lambda: clock(page) > WATCHED_S, "the lanes are full")
        # A press is shorter than the way of a screenshot: the page itself stops at it.
        page.wait_for_function(
            """(touched) => {
                const pressed = parseInt(document.getElementById("area-now").textContent) > touched;
                if (pressed) document.getElementById("play").click();
                return pressed;
            }""",
            arg=TOUCHED,
        )
        page.wait_for_timeout(500)
        save(page, "board-live")


def main() -> None:
    """Walk the board's commands of the page, and draw both pictures."""
    shell = Shell()
    for language, text in blocks(PAGE):
        lines = text.splitlines()
        if language or not ("ball.mcap" in text or "touch.json" in text):
            continue
        shell.beside(*lines) if waits_for_another(lines[0]) else [shell.run(line) for line in lines]
    with sync_playwright() as started:
        browser = started.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        draw_recording(browser)
        draw_board(browser)
        browser.close()


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        main()
