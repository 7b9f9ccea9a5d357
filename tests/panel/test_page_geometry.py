"""What the page draws of a sensor: a grid in proportion, places with their outline, channels as cells, and curves."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.panel.pages import press, shown, shows, until

import taxel
from taxel import Array, Frames, Places

FEET = Places([-500.0, -700.0, -300.0, 300.0, 500.0], [-800.0, 0.0, 0.0, 0.0, 900.0])
SENSORS = {
    "plate": Array(4, 5, pitch_mm=(7.62, 5.08)),
    "uneven": Array(1, 5, places=Places(FEET.x, FEET.y, [9e3, 4e3, 9e3, 9e3, 2e3], "mm")),
    "channels": Array(1, 5),
}


#: How high each of so many curves is at three quarters of the time, as a share of its room.
HEIGHTS = """count => {
    const lane = document.getElementById("channels-lane");
    const [canvas, over] = [lane.querySelector("canvas"), lane.querySelector(".u-over")];
    const ratio = canvas.width / canvas.clientWidth;
    const places = [over.offsetLeft + over.offsetWidth * 0.77, over.offsetTop, over.offsetHeight];
    const [x, top, height] = places.map(place => place * ratio);
    const pixels = canvas.getContext("2d").getImageData(Math.round(x), 0, 1, canvas.height).data;
    const colour = getComputedStyle(document.documentElement).getPropertyValue("--more").trim();
    const wanted = [1, 3, 5].map(at => parseInt(colour.slice(at, at + 2), 16));
    const drawn = y => pixels[4 * y + 3] > 100 && wanted.every((value, k) => Math.abs(value - pixels[4 * y + k]) < 40);
    const room = height / count;
    return Array.from({ length: count }, (_, k) => {
        let y = Math.ceil(top + k * room) + 3;
        while (!drawn(y) && y < top + (k + 1) * room + 2) y += 1;
        return (top + (k + 1) * room - y) / room;
    });
}"""


def _cross(page: Any) -> list[Any]:
    """Return whether the mark of the chosen taxel is hidden, and where it is."""
    return page.locator("#pressure-cross").evaluate(
        "e => [e.hidden, e.style.getPropertyValue('--x'), e.style.getPropertyValue('--y')]"
    )


def test_sensors_are_drawn_as_their_geometry_is_known(chromium: Any, tmp_path: Path) -> None:
    for name, array in SENSORS.items():
        values = np.zeros((60, *array.shape))
        values[20:, 0, 1], values[20:, 0, 4] = 10, 30
        taxel.convert(Frames(values, np.arange(60) * 20_000, unit="kPa", array=array), tmp_path / f"{name}.npz")
    first, *others = SENSORS
    with shown(chromium, tmp_path / f"{first}.npz") as page:
        drawn(page, first)
        for name in others:
            page.locator("#files").select_option(f"{name}.npz")
            shows(page, "source", f"^{name}.npz")
            drawn(page, name)


def drawn(page: Any, name: str) -> None:
    """Check what the page draws of a sensor."""
    # A pressure is a force where the area of each taxel is known.
    force = {"plate": r"^1\.55 N$", "uneven": "^100 N$"}.get(name)
    shows(page, "force-sum", force or "^40 kPa$")
    shows(page, "force-title", "^Force$" if force else "^Sum$")
    shows(page, "rest-from", "^above 0$")
    kind = {"plate": "grid", "channels": "channels"}.get(name, "places")
    frame = page.locator("#pressure-frame")
    assert frame.get_attribute("data-kind") == kind
    channels = name == "channels"
    shows(page, "pressure-title", "^Channels$" if channels else "^Pressure$")
    assert page.locator("#centre-block").is_visible() is not channels
    assert page.locator("#area-block").is_visible() is not channels
    assert page.locator("#channels-block").is_visible() is channels
    # The crosshair is where somebody placed it, and nobody did.
    assert page.locator("#pressure-cross").is_hidden()
    if channels:
        shows(page, "channels-scale", "^each up to 30 kPa$")
        # The second and the fifth have a load, of a third and nearly all of the height.
        heights = page.evaluate(HEIGHTS, 5)
        assert heights == pytest.approx([0, 1 / 3, 0, 0, 1], abs=0.15)
    centre = {
        "plate": r"^3\.3, 0\.0 \(16\.5, 0 mm\)$",
        "uneven": r"^x 200, y 675 mm$",
    }
    area = {"plate": r"^2 taxels \(77\.4 mm²\)$"}.get(name, "^2 taxels$")
    if not channels:
        shows(page, "centre-now", centre[name])
        shows(page, "area-now", area)
    box = frame.bounding_box()
    if name == "plate":
        assert box["width"] / box["height"] == pytest.approx(5 * 5.08 / (4 * 7.62), rel=0.02)
    # The taxel that is pointed at is the one whose mark stands there.
    frame.focus()
    page.keyboard.press("Escape")
    for _ in range(6):
        page.keyboard.press("ArrowRight")
    at = _cross(page)
    x, y = (float(share.rstrip("%")) / 100 for share in at[1:])
    page.keyboard.press("Escape")
    until(page.locator("#pressure-cross").is_hidden, "no taxel is watched")
    inner = page.locator("#pressure-map").bounding_box()
    page.mouse.click(inner["x"] + x * inner["width"], inner["y"] + y * inner["height"])
    until(lambda at=at: _cross(page) == at, f"the mark is at {at}")
    # A fixed scale holds for each that is shown.
    press(page, "5")
    page.locator("#top").fill("60")
    shows(page, "pressure-top", "^60 kPa$")
