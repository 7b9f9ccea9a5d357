"""Draw the pictures of the page and of trained results: each page of *Start here* is walked, and looked at.

    python docs/page_pictures.py [start-insole ...]

The commands and the Python of a page run in a new folder. Then its recording is opened in Chromium, with its labels and
its readout: `docs/pictures/NAME.png` is what is seen; the first tables of its training's report are `NAME-report.png`.
The board is seen while it runs, and its recording as `panel.png`, for the README.
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
from tests.test_start import Shell, blocks, waits_for_another

#: What each page shows: the arguments of taxel view, and the readout that is chosen.
SHOWN = {
    "start-board": (["ball.mcap"], "touch.json"),
    "start-camera": (["skin.raw"], "burst.json"),
    "start-insole": (["walk.npz"], "gait.json"),
    "start-nothing": (["disc.npz"], ""),
    "start-numbers": (["mat.mcap"], "press.json"),
    "start-plate": (["plate.npz"], "plate.json"),
    "start-robot": (["grasps", "--topic", "/finger", "--field", "data", "--array", "8x8"], "grasp.json"),
}
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


def walk(name: str) -> None:
    """Run the commands and the Python of a page in the folder in which the caller is."""
    shell = Shell(Path.cwd())
    for language, text in blocks(DOCS / f"{name}.md"):
        lines = text.splitlines()
        if language == "python":
            exec(compile(text, name, "exec"), {"__name__": name})
        elif not language:
            shell.beside(*lines) if waits_for_another(lines[0]) else [shell.run(line) for line in lines]


def draw_recording(browser: Any, name: str, picture: str) -> None:
    """Draw a page's recording with its labels and what its readout detects."""
    (file, *options), readout = SHOWN[name]
    with seen(browser, Path.cwd(), "view", file, *options, "--no-open") as page:
        shows(page, "state-word", "^Replay$")
        if readout:
            page.locator("#readout").select_option(readout)
            until(lambda: page.locator("#detection-list li").count(), "its detections")
            page.wait_for_timeout(1000)
            if page.locator("#notice-close").is_visible():
                page.locator("#notice-close").click()
        page.mouse.move(700, 5)
        page.wait_for_timeout(3000)
        save(page, picture)


def draw_board(browser: Any) -> None:
    """Draw the emulated board while it runs."""
    shell = Shell(Path.cwd())
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
        save(page, "start-board")


def main(names: list[str]) -> None:
    """Draw the pictures of some pages."""
    with sync_playwright() as started:
        browser = started.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        for name in names:
            with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
                walk(name)
                draw_recording(browser, name, "panel" if name == "start-board" else name)
                if name == "start-board":
                    draw_board(browser)
                report = Path("training/report.html") if SHOWN[name][1] else Path("demo/report.html")
                page = browser.new_context(viewport={"width": 1020, "height": 760}).new_page()
                page.goto(report.resolve().as_uri())
                page.wait_for_timeout(1000)
                save(page, f"{name}-report")
                page.context.close()
        browser.close()


if __name__ == "__main__":
    main(sys.argv[1:] or list(SHOWN))
