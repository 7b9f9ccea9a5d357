"""Steps that the tests of the page share: what opens it, waits for it, and reads from it; a board and a recording."""

from __future__ import annotations

import contextlib
import re
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from queue import Queue
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from tests.panel.browser import PATIENCE

import taxel
from taxel.demo.script import endless
from taxel.live import Live
from taxel.panel import Panel
from taxel.simulate import emulate

#: Pixels of a map, as a text that changes when the picture does.
PIXELS = "name => document.getElementById(name).toDataURL()"

#: The states of a board that is followed, whether or not anything arrives.
FOLLOWS = "live|quiet"


def until(true: Callable[[], Any], what: str) -> Any:
    """Wait for something outside of the page."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        if found := true():
            return found
        time.sleep(0.05)
    raise AssertionError(f"not within {PATIENCE} s: {what}")


@contextmanager
def opened(
    browser: Any, url: str, *, width: int = 1300, height: int = 900, motion: str = "no-preference", **how: Any
) -> Iterator[Any]:
    """Open the panel in the page of all tests, which knows nothing of others; with `how`, in a context of its own.

    It may not have complained in the end. A page in a new context costs a second of processor time more.
    """
    page = browser.new_context(**how).new_page() if how else browser.contexts[0].pages[0]
    page.context.set_default_timeout(PATIENCE * 1000)
    page.set_viewport_size({"width": width, "height": height})
    page.emulate_media(reduced_motion=motion)
    page.mouse.move(0, 0)
    errors: list[str] = []
    listeners = {
        "pageerror": lambda error: errors.append(str(error)),
        "console": lambda message: errors.append(message.text) if message.type == "error" else None,
    }
    for name, listener in listeners.items():
        page.on(name, listener)
    page.goto(url)
    try:
        yield page
        assert not errors
    finally:
        for name, listener in listeners.items():
            page.remove_listener(name, listener)
        page.evaluate("localStorage.clear()")
        page.context.close() if how else page.goto("about:blank")


@contextmanager
def shown(browser: Any, file: Path, **how: Any) -> Iterator[Any]:
    """Show a recording in a browser, by a panel in this process."""
    with Panel(file) as panel, opened(browser, panel.url, **how) as page:
        is_in(page, "replay")
        shows(page, "clock", r"\d")
        yield page


@contextmanager
def followed(browser: Any, folder: Path, *receives: Any, **given: Any) -> Iterator[tuple[Live, Any]]:
    """Listen with these arguments and show that in a browser, by a panel in this process; yield both."""
    with (
        Live(*receives, host="127.0.0.1", record_later=True, **given) as live,
        Panel(live, folder=folder) as panel,
        opened(browser, panel.url) as page,
    ):
        yield live, page


def is_in(page: Any, state: str, name: str = "state") -> None:
    """Wait until a part of the page, that of what is shown, is in a state."""
    from playwright.sync_api import expect

    expect(page.locator(f"#{name}")).to_have_attribute(
        "data-state", re.compile(f"^({state})$"), timeout=PATIENCE * 1000
    )


def shows(page: Any, name: str, pattern: str) -> None:
    """Wait until a part of the page has a text."""
    from playwright.sync_api import expect

    expect(page.locator(f"#{name}")).to_have_text(re.compile(pattern), timeout=PATIENCE * 1000)


def clock(page: Any) -> float:
    """Return the time that the page shows, s, once it shows one."""
    shows(page, "clock", r"\d")
    return float(page.locator("#clock").inner_text().split()[0])


def still(page: Any) -> float:
    """Return the time of a view at rest, s: it is written to the microsecond, and no request is under way."""
    shows(page, "clock", r"\.\d{6} s")
    while (at := clock(page)) != (page.wait_for_timeout(400), clock(page))[1]:
        pass
    return at


def settled(page: Any, name: str) -> Any:
    """Return the pixels of a map that is drawn to its end: a busy machine draws it in steps."""
    while (seen := page.evaluate(PIXELS, name)) != (page.wait_for_timeout(400), page.evaluate(PIXELS, name))[1]:
        pass
    return seen


def press(page: Any, *keys: str) -> None:
    """Press keys with nothing in focus that would take them."""
    page.evaluate("document.activeElement.blur()")
    for key in keys:
        page.keyboard.press(key)


def span(page: Any) -> list[float]:
    """Return the times at the edges of the lanes, s, from the numbers of the axis."""
    ticks = page.locator("#axis span").evaluate_all("all => all.map(e => [e.style.left, e.textContent])")
    (left, first), (right, last) = ([float(text.rstrip("% s")) for text in tick] for tick in (ticks[0], ticks[-1]))
    per = (last - first) / (right - left)
    return [first - left * per, first + (100 - left) * per]


#: The columns of a lane's canvas that are mostly of the colour of the grid, as shares of the width of the axis.
GRID = """name => {
  const canvas = document.querySelector(`#${name}-lane canvas`), {width, height} = canvas;
  const {data} = canvas.getContext("2d").getImageData(0, 0, width, height);
  const colour = getComputedStyle(document.documentElement).getPropertyValue("--grid");
  const grid = colour.match(/[0-9a-f]{2}/g).map(h => parseInt(h, 16));
  const is = at => data[at + 3] > 99 && grid.every((of, k) => Math.abs(data[at + k] - of) < 12);
  const rows = x => Array.from({length: height}, (_, y) => is(4 * (y * width + x))).filter(Boolean).length;
  const lines = Array.from({length: width}, (_, x) => x).filter(x => rows(x) > height / 2);
  const axis = document.getElementById("axis").getBoundingClientRect(), box = canvas.getBoundingClientRect();
  return lines.map(x => 100 * (box.x + (x + .5) * box.width / width - axis.x) / axis.width);
}"""

#: Where the axis has numbers, %.
NUMBERS = "() => [...document.querySelectorAll('#axis span')].map(e => parseFloat(e.style.left))"


def pixel(page: Any, t_s: float) -> float:
    """Return where a time is on the screen."""
    box, (start, stop) = page.locator("#track").bounding_box(), span(page)
    return box["x"] + (t_s - start) / (stop - start) * box["width"]


@pytest.fixture(scope="module")
def live(tmp_path_factory: pytest.TempPathFactory) -> Iterator[SimpleNamespace]:
    """An emulated board with a control line, and a panel that listens to it, in this process."""
    folder, over, control = tmp_path_factory.mktemp("live"), threading.Event(), Queue[str]()

    def watch(_: object) -> None:
        if over.is_set():
            raise KeyboardInterrupt

    def play(to: str) -> None:
        with contextlib.suppress(KeyboardInterrupt):
            emulate(to, endless(1), seed=1, control="127.0.0.1:0", begun=control.put, watch=watch)

    with Live(0, host="127.0.0.1", record_later=True) as live:
        board = threading.Thread(target=play, args=["{}:{}".format(*live.address)])
        board.start()
        try:
            place = control.get(timeout=PATIENCE)
            with Panel(live, control=place, folder=folder) as panel:
                yield SimpleNamespace(url=panel.url, folder=folder, control=place)
        finally:
            over.set()
            board.join()


@pytest.fixture
def page(chromium: Any, live: SimpleNamespace) -> Iterator[Any]:
    """The panel in a browser, following the board."""
    with opened(chromium, live.url) as page:
        is_in(page, "live")
        shows(page, "events", r"^[1-9]")
        shows(page, "clock", r"\d s")
        yield page


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Ten footfalls with silence between them, on an array of 16 x 24."""
    folder = tmp_path_factory.mktemp("view")
    rows, columns, t, x, y, p, intensity = 16, 24, [], [], [], [], []
    for fall in range(10):
        for step in range(40):
            t += [1_000_000 * fall + 200_000 + 192 * step] * 3
            x += [fall + 3, fall + 4, fall + 5]
            # Three times over the rows: at rest, pressed, and at rest again, so that no taxel stays pressed.
            y += [step % 13] * 3
            p += [step < 26] * 3
            intensity += [40 + 2 * max(0, min(step - 12, 26 - step))] * 3
    events = taxel.Events(
        np.array(t), np.array(x), np.array(y), np.array(p), intensity=intensity, array=taxel.Array(rows, columns)
    )
    taxel.convert(events, folder / "walk.mcap")
    return folder / "walk.mcap"


@pytest.fixture
def replay(chromium: Any, recording: Path) -> Iterator[Any]:
    """The recording in a browser, without a board."""
    with shown(chromium, recording) as page:
        yield page
