"""The page on screens and for sensors of any shape: a phone, less motion, names of controls, colours, tones."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from tests.panel.pages import (
    FOLLOWS,
    live,
    opened,
    page,
    press,
    record_form,
    recording,
    replay,
    shows,
    until,
)

import taxel
import taxel.device

__all__ = ["live", "page", "recording", "replay"]

pytestmark = pytest.mark.timeout(600)


@pytest.mark.parametrize(("rows", "columns"), [(200, 3), (3, 200), (1, 1)])
def test_a_sensor_of_any_shape_is_seen_pointed_at_and_saved(
    chromium: Any, tmp_path: Path, rows: int, columns: int
) -> None:
    array = taxel.Array(rows, columns, pitch_mm=2.67)
    with (
        taxel.live.Live(0, host="127.0.0.1", array=array) as board,
        taxel.live.Panel(board, folder=tmp_path) as panel,
        opened(chromium, panel.url) as page,
    ):
        shows(page, "state-word", FOLLOWS)
        source = taxel.live.Source(array, 100.0, to="{}:{}".format(*board.address))
        for k in range(10):
            source.push(np.full((rows, columns), 100 + 10 * k))
        until(lambda: page.locator("#events").inner_text() != "–", "it is heard")
        # No registers are stated, and another sensor has another rate than a board at reset.
        shows(page, "frames", "^–$")

        def last_taxel_is_named() -> bool:
            # The map changes its size until all parts of the page are there.
            box = page.locator("#pressure-frame").bounding_box()
            assert 40 <= box["height"] <= 700
            assert box["width"] >= 40
            page.mouse.click(box["x"] + box["width"] - 2, box["y"] + box["height"] - 2)
            return f"row {rows - 1}, column {columns - 1} " in page.locator("#taxel-name").inner_text()

        until(last_taxel_is_named, "its last taxel is named")
        until(lambda: "ticks" in page.locator("#taxel-value").inner_text(), "its value")
        with page.expect_download() as download:
            press(page, "s")
        width, height = np.frombuffer(Path(download.value.path()).read_bytes()[16:24], ">u4")
        assert 0 < height < 4 * width


def test_colours_are_those_of_their_makers_and_grow_lighter_all_the_way(replay: Any) -> None:
    """Oracle: Matplotlib's tables; the law: lightness tells the order, which is what colour-blind eyes need."""
    import matplotlib

    for name in ("lipari", "batlow", "cividis", "viridis", "grey"):
        words = replay.evaluate("name => import('/colours.js').then(c => [...c.pressureWords(name, 'dark', 1)])", name)
        colours = np.array([[w & 255, w >> 8 & 255, w >> 16 & 255] for w in words])
        if name in ("cividis", "viridis"):
            ours = np.array(matplotlib.colormaps[name].colors) * 255
            assert np.abs(colours - ours).max() <= 3, name
        linear = np.where(colours / 255 <= 0.04045, colours / 255 / 12.92, ((colours / 255 + 0.055) / 1.055) ** 2.4)
        luminance = linear @ [0.2126, 0.7152, 0.0722]
        assert (np.diff(luminance) > -1e-3).all(), name
        light = replay.evaluate("name => import('/colours.js').then(c => [...c.pressureWords(name, 'light', 1)])", name)
        assert light == words[::-1], name


def test_tones_have_their_pitch_and_fade(replay: Any) -> None:
    for hz, length in ((440, 0.12), (880, 0.35), (330, 0.2)):
        samples = replay.evaluate(
            """([hz, length]) => import('/tones.js').then(async ({ sound }) => {
                const context = new OfflineAudioContext(1, 24000, 48000);
                sound(context, hz, length);
                return [...(await context.startRendering()).getChannelData(0)];
            })""",
            [hz, length],
        )
        wave = np.array(samples)
        spectrum = np.abs(np.fft.rfft(wave * np.hanning(len(wave))))
        assert abs(np.argmax(spectrum) * 2 - hz) <= 4
        assert np.abs(wave[int(48_000 * length) + 10 :]).max() == 0
        assert np.abs(np.diff(wave)).max() < 0.2 * 2 * np.pi * 880 / 48_000 * 1.1


def test_the_page_fits_a_phone_and_its_foot_hides_nothing(chromium: Any, live: SimpleNamespace) -> None:
    with opened(chromium, live.url, width=390, height=844, has_touch=True, is_mobile=True) as page:
        shows(page, "state-word", "^Live$")
        for tab in ("board", "record", "labels", "view"):
            page.locator(f"#tab-{tab}").click()
            assert page.evaluate("document.documentElement.scrollWidth") <= 390, tab
        # The counters' widest texts, as on a slow board.
        for name, text in {
            "events": "120,000",
            "frames": "20,833",
            "latency": "134 / 134,218",
            "lost": "12,345",
        }.items():
            page.locator(f"#{name}").evaluate("(place, text) => { place.textContent = text }", text)
        edge = page.evaluate(
            "Math.max(...[...document.querySelectorAll('header *')].map(e => e.getBoundingClientRect().right))"
        )
        assert edge <= 390
        page.evaluate("window.scrollTo(0, document.body.scrollHeight)")
        foot = page.locator("footer").bounding_box()
        assert page.locator("header").bounding_box()["height"] + foot["height"] < 844 / 8
        low = page.locator("aside").bounding_box()
        assert low["y"] + low["height"] <= foot["y"]
        for button in page.locator("footer button:visible, header button:visible").all():
            assert min(button.bounding_box()["height"], button.bounding_box()["width"]) >= 44, button.inner_text()
        for button in page.locator(".under button:visible").all():
            assert min(button.bounding_box()["height"], button.bounding_box()["width"]) >= 36, button.inner_text()


@pytest.mark.parametrize("motion", ["reduce", "no-preference"])
def test_nothing_moves_by_itself_where_less_motion_is_wanted(chromium: Any, live: SimpleNamespace, motion: str) -> None:
    with opened(chromium, live.url, motion=motion) as page:
        shows(page, "state-word", "^Live$")
        record_form(page, name=f"motion-{motion}", index="")
        press(page, "r")
        shows(page, "record-word", "^Stop$")
        assert bool(page.evaluate("document.getAnimations().length")) is (motion == "no-preference")
        press(page, "r")
        shows(page, "record-word", "^Record$")


def test_every_control_has_a_name_and_every_id_is_one(page: Any) -> None:
    nameless = page.evaluate(
        """() => [...document.querySelectorAll("button, input, select, canvas[role], [role=application]")]
            .filter(e => !(e.getAttribute("aria-label") || e.labels?.length || e.textContent.trim()))
            .map(e => e.outerHTML.slice(0, 80))"""
    )
    assert nameless == []


def test_curves_of_frames_have_gaps_where_none_arrived(replay: Any) -> None:
    """Columns of 4 ms and two rows: a frame every 10 columns, none in 200 to 400 and after 900."""
    found = replay.evaluate("""() => import('/timeline.js').then(({ Timeline }) => {
        const timeline = new Timeline(2, 4000);
        const [raster, count] = [new Uint8Array(2 * 1000), 1000];
        for (let column = 0; column <= 900; column += 10)
          if (column < 200 || column >= 400) raster[2 * column + 1] = 16;
        timeline.put({ restart: false, column_us: 4000, t_us: 4e6 - 1, following: true, first: 0, count, raster });
        const gaps = (us) => [...timeline.gaps(-5, 999, us)];
        return [gaps(36000), gaps(35999).length, gaps(300000), gaps(1e6)];
    })""")
    silent = [*range(191, 400), *range(901, 1000)]
    assert (found[0], found[2], found[3]) == (silent, silent, [])
    assert found[1] == 1000 - sum(column < 200 or column >= 400 for column in range(0, 901, 10))
