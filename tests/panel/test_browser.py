"""The panel as a person has it: a real browser, an emulated board, recordings on disk."""

from __future__ import annotations

import csv
import re
import socket
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from loopback import free_port
from tests.detect.test_readout import recipe, tare, touches
from tests.panel.browser import PATIENCE, chromium, running
from tests.panel.protocol import word

import taxel
import taxel.device
from taxel.detect import Example, train

__all__ = ["chromium"]

pytestmark = pytest.mark.timeout(600)

#: Pixels of a map, as a text that changes when the picture does.
PIXELS = "name => document.getElementById(name).toDataURL()"


def until(true: Callable[[], Any], what: str) -> Any:
    """Wait for something outside of the page."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        if found := true():
            return found
        time.sleep(0.05)
    raise AssertionError(f"not within {PATIENCE} s: {what}")


#: The state of a board that is followed, whether or not anything arrives.
FOLLOWS = "^(Live|Quiet|Nothing arrives)$"


def opened(browser: Any, url: str, **how: Any) -> Any:
    """Open the panel in a context of its own; any error of the page is kept in `errors`."""
    context = browser.new_context(**{"viewport": {"width": 1300, "height": 900}, **how})
    context.set_default_timeout(PATIENCE * 1000)
    page = context.new_page()
    errors: list[str] = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.on("console", lambda message: errors.append(message.text) if message.type == "error" else None)
    page.goto(url)
    page.errors = errors
    return page


def shows(page: Any, name: str, pattern: str) -> None:
    """Wait until a part of the page has a text."""
    from playwright.sync_api import expect

    expect(page.locator(f"#{name}")).to_have_text(re.compile(pattern), timeout=PATIENCE * 1000)


def clock(page: Any) -> float:
    """Return the time that the page shows, s."""
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


@pytest.fixture(scope="module")
def live(tmp_path_factory: pytest.TempPathFactory) -> Iterator[SimpleNamespace]:
    """An emulated board with a control line, and a panel that listens to it."""
    pytest.importorskip("playwright", reason="no Playwright: pip install playwright")
    folder = tmp_path_factory.mktemp("live")
    port = str(free_port())
    with running("emulate", "--port", port, "--seed", "1", "--control", "0", folder=folder) as board:
        control = board.wait_for(r"commands are accepted at (\S+)")
        panel = ("live", "--panel", "--port", port, "--host", "127.0.0.1", "--control", control)
        with running(*panel, "--folder", str(folder), folder=folder) as server:
            url = server.wait_for(r"(http://127\.0\.0\.1:\d+/#\S+)")
            yield SimpleNamespace(url=url, folder=folder)


@pytest.fixture
def page(chromium: Any, live: SimpleNamespace) -> Iterator[Any]:
    """The panel in a browser, following the board; it may not have complained in the end."""
    page = opened(chromium, live.url)
    shows(page, "state-word", "^Live$")
    shows(page, "events", r"^[1-9]")
    shows(page, "clock", r"\d s")
    yield page
    assert not page.errors
    page.context.close()


def press(page: Any, *keys: str) -> None:
    """Press keys with nothing in focus that would take them."""
    page.evaluate("document.activeElement.blur()")
    for key in keys:
        page.keyboard.press(key)


def record_form(page: Any, **values: Any) -> None:
    """Fill in the tab Record."""
    press(page, "2")
    for name, value in values.items():
        if isinstance(value, bool):
            page.locator(f"#record-{name}").set_checked(value)
        else:
            page.locator(f"#record-{name}").fill(str(value))


def story(page: Any, folder: Path, name: str, floor_ticks: int) -> None:
    """Set a register, see the map move, record, label, stop, replay, and look into the file."""
    before = page.evaluate(PIXELS, "pressure-map")
    press(page, "1")
    floor = page.get_by_label("Noise floor", exact=True)
    floor.fill(str(floor_ticks))
    floor.press("Tab")
    # The page must show the value that the board reports, not the one that was typed.
    page.locator("#read-back").click()
    shows(page, "registers-why", "^$")
    until(lambda: floor.input_value() == str(floor_ticks), "the board holds the floor")
    until(lambda: page.evaluate(PIXELS, "pressure-map") != before, "the map moves")
    record_form(page, name=name, index="7", label="heel", length="", countdown="0")
    press(page, "r")
    shows(page, "state-word", rf"Recording {name}7\.mcap")
    page.locator("#label-name").evaluate(
        "input => { input.value = 'contact'; input.dispatchEvent(new Event('input')) }"
    )
    press(page, "m")
    shows(page, "label-count", "^1 label")
    until(lambda: float((page.locator("#record-state").inner_text().split() or ["0"])[0]) >= 2, "two seconds of it")
    press(page, "r")
    shows(page, "record-last-file", rf"^{name}7\.mcap$")
    page.locator("#files").select_option(f"{name}7.mcap")
    shows(page, "state-word", "^Replay$")
    shows(page, "label-count", "^1 label")
    press(page, "Home")
    start = still(page)
    press(page, "Space")
    # Datagrams arrived for only part of the two seconds, so the recording may be that short.
    until(lambda: clock(page) > start + 0.2, "it plays")
    file = taxel.open(folder / f"{name}7.mcap")
    assert len(file.events.t) > 0
    assert file.registers is not None
    assert file.registers.noise_floor == floor_ticks
    rows = list(csv.DictReader((folder / f"{name}7.notes.csv").open()))
    assert [row["label"] for row in rows] == ["contact"]
    # The trial's label is no event: it has no time. The recording may begin in silence.
    said = {note.text: note.t for note in file.notes}
    assert said == {"heel": None, "contact": int(rows[0]["t_us"])}
    assert file.events.t[0] - 2_500_000 <= said["contact"] <= file.events.t[-1] + 2_500_000


def test_a_register_a_recording_and_a_label_reach_board_and_file(page: Any, live: SimpleNamespace) -> None:
    story(page, live.folder, "walk", 5)


@pytest.mark.slow
@pytest.mark.parametrize("turn", range(20))
def test_the_story_holds_every_time(page: Any, live: SimpleNamespace, turn: int) -> None:
    story(page, live.folder, f"again{turn:02}-", 3 + turn % 5)


def test_a_board_is_chosen_connected_and_remembered(chromium: Any, tmp_path: Path) -> None:
    port = str(free_port())
    with (
        running("emulate", "--port", port, "--control", "0", folder=tmp_path) as board,
        running("live", "--panel", "--port", port, "--host", "127.0.0.1", folder=tmp_path) as server,
    ):
        control = board.wait_for(r"commands are accepted at (\S+)")
        page = opened(chromium, server.wait_for(r"(http://127\.0\.0\.1:\d+/#\S+)"))
        shows(page, "where-info", "no control line")
        assert not page.get_by_label("Noise floor", exact=True).is_enabled()
        # The machine's ports and addresses stand in the lists.
        until(lambda: page.locator("#udp-choice option[value^='127.0.0.1:']").count() == 1, "loopback is offered")
        listed = page.locator("#control-choice optgroup[label='Serial ports'] option").evaluate_all(
            "all => all.map(e => e.value)"
        )
        assert listed == [port.place for port in taxel.device.ports()]
        page.locator("#control").fill("127.0.0.1:1")
        page.locator("#control-connect").click()
        shows(page, "control-why", "refused")
        page.locator("#control").fill(control)
        page.locator("#control-connect").click()
        shows(page, "where-info", re.escape(control))
        until(lambda: page.get_by_label("Noise floor", exact=True).is_enabled(), "registers can be written")
        shows(page, "board-lines", "REG")
        page.locator("#control-drop").click()
        shows(page, "where-info", "no control line")
        page.locator("#control-choice").select_option(control)
        assert page.locator("#control").input_value() == control
        page.locator("#delta-intensity").check()
        until(
            lambda: page.locator("#delta-intensity").is_checked() and page.locator("#notice").is_hidden(), "it is taken"
        )
        assert not page.errors
        page.context.close()


def test_a_refused_value_stays_typed_with_its_reason_until_escape(page: Any) -> None:
    period = page.get_by_label("Step period", exact=True)
    period.fill("4")
    period.press("Enter")
    shows(page, "register-step_period-reason", r"4 x step_period 4\.00 us is longer than line_read 3\.00 us \(rule 2\)")
    assert period.input_value() == "4"
    assert period.get_attribute("aria-invalid") == "true"
    # A slower line period makes the value valid: both are written together.
    for name, value in (("Line period", "20"), ("Line read", "20")):
        page.get_by_label(name, exact=True).fill(value)
        page.get_by_label(name, exact=True).press("Enter")
    until(lambda: period.get_attribute("aria-invalid") == "false" and period.input_value() == "4.00", "all are written")
    period.fill("nonsense")
    period.press("Enter")
    shows(page, "register-step_period-reason", "nonsense is no number")
    period.press("Escape")
    assert period.input_value() == "4.00"
    page.locator("#preset").select_option("5.2 kHz")
    until(lambda: period.input_value() == "0.75", "the preset is back")


def test_presets_of_ones_own_are_kept_applied_and_deleted(page: Any) -> None:
    page.locator("#preset-path").click()
    floor = page.get_by_label("Noise floor", exact=True)
    floor.fill("9")
    floor.press("Enter")
    until(lambda: page.locator("#preset").input_value() == "", "no preset is this")
    page.locator("#preset-name").fill("quiet")
    page.locator("#preset-name").press("Enter")
    until(lambda: page.locator("#preset").input_value() == "quiet", "it is kept")
    page.locator("#preset").select_option("5.2 kHz")
    until(lambda: floor.input_value() == "3", "another is applied")
    page.locator("#preset").select_option("quiet")
    until(lambda: floor.input_value() == "9", "and ours again")
    page.locator("#preset-delete").click()
    until(lambda: page.locator("#preset option[value=quiet]").count() == 0, "it is gone")
    page.locator("#preset").select_option("5.2 kHz")
    until(lambda: floor.input_value() == "3", "the preset is back")


def test_recordings_count_down_go_on_by_themselves_and_overwrite_nothing(page: Any, live: SimpleNamespace) -> None:
    record_form(page, name="auto", index="1", countdown="1", length="1", advance=True)
    press(page, "r")
    shows(page, "record-word", "^Cancel$")
    shows(page, "record-word", "^Stop$")
    until((live.folder / "auto2.mcap").exists, "the second begins by itself")
    press(page, "r")
    shows(page, "record-word", "^Record$")
    before = (live.folder / "auto1.mcap").read_bytes()
    record_form(page, name="auto", index="1", countdown="0", length="1", advance=False)
    press(page, "r")
    shows(page, "record-reason", r"auto1\.mcap.*exists")
    for name in ("../away", ".hidden", ""):
        record_form(page, name=name, index="")
        press(page, "r")
        until(lambda: page.locator("#record-reason").is_visible(), f"{name!r} is refused")
    assert (live.folder / "auto1.mcap").read_bytes() == before
    record_form(page, name="auto", index="one")
    press(page, "r")
    shows(page, "record-reason", "index: one is no number")


def test_a_trained_readout_is_heard_in_the_page_with_its_latency(chromium: Any, tmp_path: Path) -> None:
    readout = train([Example(*touches(seed), tare()) for seed in (1, 2, 3)], recipe())
    readout.save(tmp_path / "touch.json")
    tare().save(tmp_path / "tare.json")
    events, truth = touches(11)
    taxel.convert(events, tmp_path / "played.mcap")
    port = str(free_port())
    given = ("--readout", "touch.json", "--tare", "tare.json", "--array", "8x8")
    with running("live", "--panel", "--port", port, "--host", "127.0.0.1", *given, folder=tmp_path) as server:
        page = opened(chromium, server.wait_for(r"(http://127\.0\.0\.1:\d+/#\S+)"))
        shows(page, "state-word", FOLLOWS)
        shows(page, "detections-none", "^None yet")
        with running("emulate", "--replay", "played.mcap", "--port", port, folder=tmp_path) as board:
            board.process.wait(PATIENCE)

        def printed() -> list[tuple[str, str]]:
            return re.findall(r"^ +([\d.]+) s +(contact|lift) ", server.heard(), re.MULTILINE)

        until(lambda: server.heard().count(" lift ") >= 1, "the board has been heard")
        page.wait_for_timeout(1000)
        shows(page, "detection-count", f"^{len(printed())}$")
        # The page lists the detections of the terminal, the latest first, with the time and the latency of each.
        rows = page.locator("#detection-list li").all_inner_texts()
        assert all(re.search(r"\d+\.\d{3} s\s+-?\d[\d.]* (µs|ms|s)$", row) for row in rows), rows
        names = [re.match(r"\w+", row.strip()).group() for row in rows]  # type: ignore[union-attr]
        at = np.array([float(re.findall(r"([\d.]+) s", row)[0]) for row in rows])
        assert names[::-1] == [name for _, name in printed()]
        assert np.diff(at[::-1]) == pytest.approx(np.diff([float(time) for time, _ in printed()]), abs=0.0021)
        assert page.locator("#detection-marks span").count() > 0
        until(lambda: page.locator("#latency").inner_text() != "–", "latency is counted")
        page.locator("#detection-list button").last.click()
        shows(page, "state-word", "^Held$")
        assert not page.errors
        page.context.close()
    # If the machine delays the emulated board, detections that were output too early are in the list too, and counted
    # there.
    if " late" not in server.heard():
        assert names == ["lift", "contact"] * 6
        wanted = sorted(truth["contact"] + truth["lift"])
        assert np.diff(at[::-1]) * 1e6 == pytest.approx(np.diff(wanted), abs=4000)


def test_what_does_not_arrive_is_said(chromium: Any, tmp_path: Path) -> None:
    port = str(free_port())
    how = ("--panel", "--port", port, "--host", "127.0.0.1", "--array", "4x4", "--rate-hz", "500", "--bits", "12")
    with running("live", *how, folder=tmp_path) as server:
        page = opened(chromium, server.wait_for(r"(http://127\.0\.0\.1:\d+/#\S+)"))
        shows(page, "silence", rf"^Nothing has arrived at UDP 127\.0\.0\.1:{port} so far")
        shows(page, "state-word", "^Nothing arrives$")
        shows(page, "frames", "^500$")
        # Version 1 has no heartbeats: quiet.
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as board:
            board.sendto(word(1_000_000, 1, 1, 50), ("127.0.0.1", int(port)))
        shows(page, "silence", r"^Quiet: nothing since 1\.000 s of the board, for ")
        shows(page, "state-word", "^Quiet$")
        # Version 2 sends them: lost.
        source = taxel.live.Source(taxel.Array(4, 4), 500.0, bits=12, to=f"127.0.0.1:{port}")
        for k in range(200):
            source.push(np.full((4, 4), 100 if k < 20 else 300))
            time.sleep(0.002)
        shows(page, "silence", "^The board is lost: nothing since .* heartbeat every .* or sooner")
        shows(page, "state-word", "^Lost$")
        assert not page.errors
        page.context.close()


def test_the_page_is_there_while_a_tare_waits(chromium: Any, tmp_path: Path) -> None:
    train([Example(*touches(seed), tare()) for seed in (1, 2, 3)], recipe()).save(tmp_path / "touch.json")
    port = str(free_port())
    with running("emulate", "--port", port, "--control", "0", "--heartbeat", "10", folder=tmp_path) as board:
        control = board.wait_for(r"commands are accepted at (\S+)")
        other = str(free_port())
        how = ("--port", other, "--host", "127.0.0.1", "--control", control, "--readout", "touch.json", "--tare", "0.2")
        with running("live", "--panel", *how, folder=tmp_path) as server:
            server.wait_for(r"(the readout assumes frames of 24 us)")
            page = opened(chromium, server.wait_for(r"(http://127\.0\.0\.1:\d+/#\S+)"))
            shows(page, "silence", "^Nothing has arrived")
            shows(page, "assumed", r"assumes frames of 24 µs")
            shows(page, "where-info", "no control line")
            rest = np.full((8, 8), 50)
            source = taxel.live.Source(taxel.Array(8, 8), 100.0, to=f"127.0.0.1:{other}")
            source.push(rest)
            shows(page, "silence", "^Taking a tare|^The board is lost")
            for _ in range(40):
                source.push(rest)
                time.sleep(0.01)
            # The serial line has had its first user, the tare.
            shows(page, "where-info", re.escape(control))
            assert not page.errors
            page.context.close()


def test_looking_back_while_live_holds_the_view_and_not_the_board(page: Any) -> None:
    until(lambda: clock(page) > 2, "there is something to look back at")
    press(page, "Space")
    shows(page, "state-word", "^Held$")
    held = still(page)
    press(page, "ArrowLeft")
    until(lambda: clock(page) == pytest.approx(held - 0.1, abs=0.002), "a tenth of a second back")
    back = still(page)
    press(page, ".")
    until(lambda: clock(page) > back, "a step on")
    on = still(page)
    press(page, ",", ",")
    until(lambda: clock(page) < on, "two steps back")
    events = page.locator("#events").inner_text()
    until(lambda: page.locator("#events").inner_text() != events, "the board goes on")
    press(page, "l")
    shows(page, "state-word", "^Live$")
    until(lambda: clock(page) > held + 0.1, "it follows again")


def test_the_crosshair_goes_by_keys_and_names_its_taxel(page: Any) -> None:
    press(page, "c")
    page.keyboard.press("Escape")
    shows(page, "taxel-name", "^none")
    for key in ("ArrowUp", "ArrowLeft", "Shift+ArrowUp"):
        page.keyboard.press(key)
    shows(page, "taxel-name", r"row 24, column 31 · sense line 24, driven line 31")
    page.locator("#tab-view").click()
    page.locator("#flip-x").check()
    box = page.locator("#pressure-frame").bounding_box()
    page.mouse.click(box["x"] + 3, box["y"] + 3)
    shows(page, "taxel-name", "row 0, column 63")
    page.locator("#flip-x").uncheck()


def test_a_taxel_is_zeroed_by_a_button_and_marked(page: Any) -> None:
    shows(page, "state-word", "^Live$")
    button = page.get_by_role("button", name="Zero", exact=True)
    page.locator("#pressure-frame").click()
    until(lambda: "ticks" in page.locator("#taxel-value").inner_text(), "the taxel was heard of")
    button.click()
    shows(page, "taxel-value", "zeroed")
    until(lambda: page.locator("#pressure-marks .unwell.zeroed").count() == 1, "it is marked")
    press(page, "Space")
    shows(page, "state-word", "^Held$")
    assert button.is_hidden(), "what it holds now is not what is shown"


@pytest.mark.parametrize(("rows", "columns"), [(200, 3), (3, 200), (1, 1)])
def test_a_sensor_of_any_shape_is_seen_pointed_at_and_saved(
    chromium: Any, tmp_path: Path, rows: int, columns: int
) -> None:
    port = str(free_port())
    array = ("--array", f"{rows}x{columns}")
    with running("live", "--panel", "--port", port, "--host", "127.0.0.1", *array, folder=tmp_path) as server:
        page = opened(chromium, server.wait_for(r"(http://127\.0\.0\.1:\d+/#\S+)"))
        shows(page, "state-word", FOLLOWS)
        source = taxel.live.Source(taxel.Array(rows, columns), 100.0, to=f"127.0.0.1:{port}")
        for k in range(10):
            source.push(np.full((rows, columns), 100 + 10 * k))
        until(lambda: page.locator("#events").inner_text() != "–", "it is heard")
        # Nobody has stated the registers, and another sensor has another rate than a board at reset.
        shows(page, "frames", "^–$")
        box = page.locator("#pressure-frame").bounding_box()
        assert 40 <= box["height"] <= 700
        assert box["width"] >= 40
        page.mouse.click(box["x"] + box["width"] - 2, box["y"] + box["height"] - 2)
        shows(page, "taxel-name", f"row {rows - 1}, column {columns - 1} ")
        until(lambda: "ticks" in page.locator("#taxel-value").inner_text(), "its value")
        with page.expect_download() as download:
            press(page, "s")
        width, height = np.frombuffer(Path(download.value.path()).read_bytes()[16:24], ">u4")
        assert 0 < height < 4 * width
        assert not page.errors
        page.context.close()


def test_the_page_fits_a_phone_and_its_foot_hides_nothing(chromium: Any, live: SimpleNamespace) -> None:
    page = opened(chromium, live.url, viewport={"width": 390, "height": 844}, has_touch=True, is_mobile=True)
    shows(page, "state-word", "^Live$")
    for tab in ("board", "record", "labels", "view"):
        page.locator(f"#tab-{tab}").click()
        assert page.evaluate("document.documentElement.scrollWidth") <= 390, tab
    # The counters' widest texts, as on a slow board.
    for name, text in {"events": "120,000", "frames": "20,833", "latency": "134 / 134,218", "lost": "12,345"}.items():
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
    page.context.close()


@pytest.mark.parametrize("motion", ["reduce", "no-preference"])
def test_nothing_moves_by_itself_where_less_motion_is_wanted(chromium: Any, live: SimpleNamespace, motion: str) -> None:
    page = opened(chromium, live.url, reduced_motion=motion)
    shows(page, "state-word", "^Live$")
    record_form(page, name=f"motion-{motion}", index="")
    press(page, "r")
    shows(page, "record-word", "^Stop$")
    assert bool(page.evaluate("document.getAnimations().length")) is (motion == "no-preference")
    press(page, "r")
    shows(page, "record-word", "^Record$")
    page.context.close()


def test_every_control_has_a_name_and_every_id_is_one(page: Any) -> None:
    nameless = page.evaluate(
        """() => [...document.querySelectorAll("button, input, select, canvas[role], [role=application]")]
            .filter(e => !(e.getAttribute("aria-label") || e.labels?.length || e.textContent.trim()))
            .map(e => e.outerHTML.slice(0, 80))"""
    )
    assert nameless == []


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Ten footfalls with silence between them, on an array of 16 x 24."""
    folder = tmp_path_factory.mktemp("view")
    rows, columns, t, x, y, p, intensity = 16, 24, [], [], [], [], []
    for fall in range(10):
        for step in range(40):
            t += [1_000_000 * fall + 200_000 + 192 * step] * 3
            x += [fall + 3, fall + 4, fall + 5]
            y += [step % rows] * 3
            p += [step < 20] * 3
            intensity += [40 + min(step, 40 - step)] * 3
    events = taxel.Events(
        np.array(t), np.array(x), np.array(y), np.array(p), intensity=intensity, array=taxel.Array(rows, columns)
    )
    taxel.convert(events, folder / "walk.mcap")
    return folder / "walk.mcap"


@pytest.fixture
def replay(chromium: Any, recording: Path) -> Iterator[Any]:
    """The recording in a browser, without a board."""
    with running("view", str(recording), "--no-open", folder=recording.parent) as server:
        page = opened(chromium, server.wait_for(r"(http://127\.0\.0\.1:\d+/#\S+)"))
        shows(page, "state-word", "^Replay$")
        shows(page, "clock", r"\d s")
        yield page
        assert not page.errors
        page.context.close()


def test_steps_leap_over_silence_both_ways(replay: Any) -> None:
    press(replay, "End")
    until(lambda: clock(replay) > 9, "the end")
    press(replay, "Home")
    until(lambda: clock(replay) < 0.3, "the beginning")
    replay.locator("#strip").focus()
    for _ in range(3):
        at = clock(replay)
        replay.keyboard.press("Shift+ArrowRight")
        until(lambda at=at: clock(replay) > at + 0.9, "a second on")
    # Between two footfalls a step moves to the last stamp of one, or to the first of the next.
    replay.keyboard.press("ArrowRight")
    at = still(replay)
    press(replay, ",")
    until(lambda: clock(replay) < at - 0.05, "back over the silence")
    at = still(replay)
    press(replay, ".")
    until(lambda: clock(replay) > at, "on over the silence")


def span(page: Any) -> list[float]:
    """Return the times at the edges of the lanes, s, from the numbers of the axis."""
    ticks = page.locator("#axis span").evaluate_all("all => all.map(e => [e.style.left, e.textContent])")
    (left, first), (right, last) = ([float(text.rstrip("% s")) for text in tick] for tick in (ticks[0], ticks[-1]))
    per = (last - first) / (right - left)
    return [first - left * per, first + (100 - left) * per]


def pixel(page: Any, t_s: float) -> float:
    """Return where a time is on the screen."""
    box, (start, stop) = page.locator("#track").bounding_box(), span(page)
    return box["x"] + (t_s - start) / (stop - start) * box["width"]


def test_a_recording_opens_on_all_of_its_time_and_its_first_touch(replay: Any) -> None:
    # The rest is that of the taxels' first values, so the first fall has nearly half of the greatest force.
    until(lambda: 0.2 < clock(replay) < 0.212, "the first touch, where its force is greatest")
    start, stop = span(replay)
    assert (start, stop) == (pytest.approx(0.1, abs=0.15), pytest.approx(9.3, abs=0.15))
    drawn = "document.getElementById('pressure-map').getContext('2d').getImageData(0, 0, 24, 16).data.buffer"
    assert replay.evaluate(f"new Set(new Uint32Array({drawn})).size") > 2, "the touch is in the map"
    # Nobody has placed a crosshair, and the lane of a watched taxel takes no room.
    assert replay.locator("#pressure-cross").is_hidden()
    assert replay.locator("#taxel-block").is_hidden()
    force = replay.locator("#force-lane").bounding_box()
    title = replay.locator("#force-block h2").bounding_box()
    assert title["y"] + title["height"] <= force["y"] + 1, "titles cover no curve"
    assert replay.locator("#tab-labels").get_attribute("aria-selected") == "true"


def test_the_lanes_zoom_and_scroll_as_a_time_axis(replay: Any) -> None:
    still(replay)
    box = replay.locator("#raster").bounding_box()
    replay.mouse.move(pixel(replay, 5.2), box["y"] + 5)
    for _ in range(8):
        before = span(replay)
        replay.mouse.wheel(0, -200)
        until(lambda before=before: span(replay) != before, "it zooms")
    start, stop = span(replay)
    assert stop - start < 1
    # The time under the pointer stays there, and the columns are narrower now: the fall is 7.5 ms long.
    pointed = float(replay.locator("#cursor-time").inner_text()[:-2])
    assert pixel(replay, 5.2) == pytest.approx(pixel(replay, pointed), abs=3)
    replay.mouse.click(pixel(replay, 5.2), box["y"] + 5)
    until(lambda: clock(replay) == pytest.approx(5.2, abs=0.003), "a click shows the map at that time")
    middle = box["x"] + box["width"] / 2
    replay.mouse.move(middle, box["y"] + 5)
    replay.mouse.down()
    replay.mouse.move(middle + box["width"] / 4, box["y"] + 6, steps=4)
    replay.mouse.up()
    until(lambda: span(replay)[0] == pytest.approx(start - (stop - start) / 4, abs=0.01), "a drag scrolls")
    assert clock(replay) == pytest.approx(5.2, abs=0.003), "and shows no other time"
    press(replay, "Home")
    until(lambda: span(replay)[0] < 0.2 < span(replay)[1], "the window follows the time")
    replay.locator("#zoom-all").click()
    until(lambda: span(replay)[1] > 9.2, "all of it")
    press(replay, "z")
    shows(replay, "span", r"^4\.\d s$")
    press(replay, "x", "x", "x")
    until(lambda: span(replay)[1] - span(replay)[0] < 10, "no longer than the recording")


def test_a_replay_that_leaves_the_window_takes_it_along(replay: Any) -> None:
    still(replay)
    replay.mouse.move(pixel(replay, 0.2), replay.locator("#raster").bounding_box()["y"] + 5)
    for _ in range(6):
        press(replay, "z")
    until(lambda: span(replay)[1] < 1, "a short stretch")
    press(replay, "Space")
    until(lambda: clock(replay) > 2, "it plays")
    press(replay, "Space")
    at = still(replay)
    start, stop = span(replay)
    assert start < at <= stop + 0.01
    # The lanes have what was played: the force of the last fall that the window shows.
    assert replay.evaluate(PIXELS, "raster")


def test_spikes_of_an_encoder_are_shown_in_a_recording(replay: Any) -> None:
    press(replay, "End", "4")
    until(lambda: clock(replay) > 9, "the end")
    still(replay)
    changes = settled(replay, "raster")
    replay.locator("#encoder").select_option("change_events")
    shows(replay, "spikes-info", "change events, latency")
    until(lambda: replay.evaluate(PIXELS, "raster") != changes, "the raster is of spikes")
    replay.locator("#encoder").select_option("")
    until(lambda: replay.evaluate(PIXELS, "raster") == changes, "and of changes again")


def test_ten_footfalls_are_labelled_moved_named_and_deleted(replay: Any, recording: Path) -> None:
    table = recording.with_suffix("").with_suffix(".notes.csv")
    press(replay, "3")
    replay.locator("#label-name").fill("contact")
    for fall in range(10):
        t_us = 1_000_000 * fall + 200_000
        replay.evaluate("document.activeElement.blur()")
        replay.locator("#strip").focus()
        replay.keyboard.press("Home")
        for _ in range(fall):
            replay.keyboard.press("Shift+ArrowRight")
        until(lambda t_us=t_us: abs(clock(replay) * 1e6 - t_us) < 20_000, f"fall {fall}")
        press(replay, "m")
        shows(replay, "label-count", f"^{fall + 1} label")
    first = replay.locator("#label-list li").first
    first.locator("input").first.fill("heel")
    first.locator("input").first.press("Enter")
    until(lambda: "heel" in table.read_text(), "the name is kept")
    press(replay, "End", "p")
    flag = replay.locator(".flag.chosen")
    flag.focus()
    before = [int(row["t_us"]) for row in csv.DictReader(table.open())]
    flag.press("Shift+ArrowLeft")
    until(lambda: sum(int(row["t_us"]) for row in csv.DictReader(table.open())) == sum(before) - 100_000, "moved")
    replay.locator(".flag.chosen").focus()
    replay.keyboard.press("Delete")
    shows(replay, "label-count", "^9 label")
    rows = list(csv.DictReader(table.open()))
    assert sorted(row["label"] for row in rows) == ["contact"] * 8 + ["heel"]
    assert sorted(note.text for note in taxel.open(recording).notes) == ["contact"] * 8 + ["heel"]


def test_a_click_anywhere_in_the_row_makes_a_label_and_a_handle_moves_it(replay: Any, recording: Path) -> None:
    table = recording.with_suffix("").with_suffix(".notes.csv")
    table.unlink(missing_ok=True)
    replay.reload()
    shows(replay, "label-count", "^0 labels")
    still(replay)
    replay.locator("#label-name").fill("a name of a label that is long")
    lane = replay.locator("#label-lane").bounding_box()
    low = lane["y"] + lane["height"] - 4
    # One click for each: the names of the others are in nobody's way.
    for count, t_s in enumerate((2.0, 2.3, 2.6, 2.9, 8.0), start=1):
        replay.mouse.click(pixel(replay, t_s), low)
        shows(replay, "label-count", f"^{count} label")
    marked = [int(row["t_us"]) / 1e6 for row in csv.DictReader(table.open())]
    assert marked == pytest.approx([2.0, 2.3, 2.6, 2.9, 8.0], abs=0.01)
    # One count everywhere.
    assert "5 labels" in replay.locator("#files option:checked").inner_text()
    assert replay.locator("#label-list li").count() == replay.locator(".flag").count() == 5
    # Without a name nothing is lost: the label is set where the click was, once there is one.
    replay.locator("#label-name").fill("")
    replay.mouse.click(pixel(replay, 6.0), low)
    replay.keyboard.type("toe")
    replay.keyboard.press("Enter")
    shows(replay, "label-count", "^6 label")
    flag = replay.locator(".flag", has_text="toe")
    said = flag.get_attribute("aria-label")
    handle = flag.locator("i").bounding_box()
    at = (handle["x"] + 4, handle["y"] + 4)
    replay.mouse.click(*at)
    shows(replay, "label-count", "^6 label")
    assert "chosen" in flag.get_attribute("class")
    replay.mouse.move(*at)
    replay.mouse.down()
    replay.mouse.move(at[0] + 40, at[1], steps=4)
    replay.keyboard.press("Escape")
    replay.mouse.up()
    assert flag.get_attribute("aria-label") == said, "Escape gives up a drag"
    replay.mouse.move(*at)
    replay.mouse.down()
    replay.mouse.move(at[0] + lane["width"] / 10, at[1], steps=4)
    replay.mouse.up()
    until(lambda: flag.get_attribute("aria-label") != said, "it moves")
    seconds = [float(re.findall(r"at ([\d.]+) s", text)[0]) for text in (said, flag.get_attribute("aria-label"))]
    start, stop = span(replay)
    assert seconds[1] - seconds[0] == pytest.approx((stop - start) / 10, abs=0.03)
    # A label that was deleted by a click comes back by one.
    replay.locator("#label-list li").last.get_by_text("×").click()
    shows(replay, "label-count", "^5 label")
    replay.locator("#notice-offer").click()
    shows(replay, "label-count", "^6 label")


def test_flags_stack_and_shrink_to_lines(replay: Any, recording: Path) -> None:
    table = recording.with_suffix("").with_suffix(".notes.csv")
    table.write_text("label,t_us\n" + "".join(f"contact,{5_000_000 + 1000 * k}\n" for k in range(9)))
    replay.reload()
    shows(replay, "label-count", "^9 labels")
    until(lambda: replay.locator(".flag").count() == 9, "a flag each")
    levels = replay.locator(".flag").evaluate_all("all => all.map(e => e.dataset.level)")
    assert levels == ["0", "1", "2"] + ["-1"] * 6
    assert replay.locator(".flag i:visible").count() == 3
    table.unlink()


def test_play_label_train_and_watch_the_new_readout(chromium: Any, tmp_path: Path) -> None:
    events, truth = touches(11)
    taxel.convert(events, tmp_path / "played.mcap")
    with running("view", "played.mcap", "--no-open", folder=tmp_path) as server:
        page = opened(chromium, server.wait_for(r"(http://127\.0\.0\.1:\d+/#\S+)"))
        shows(page, "state-word", "^Replay$")
        shows(page, "detections-none", "None in this recording")
        press(page, "Space")
        at = clock(page)
        until(lambda: clock(page) > at + 0.05, "it plays")
        press(page, "Space")
        still(page)
        lane = page.locator("#label-lane").bounding_box()
        count, (first, last) = 0, span(page)
        for label, times in truth.items():
            page.locator("#label-name").fill(label)
            for t_us in times:
                # Close up, so that neither handle nor pixel is in the way.
                page.locator("#zoom-all").click()
                until(lambda: span(page) == pytest.approx([first, last]), "all of it")
                x = pixel(page, t_us / 1e6)
                page.mouse.move(x, lane["y"] + lane["height"] + 30)
                for _ in range(4):
                    press(page, "z")
                page.mouse.click(x, lane["y"] + lane["height"] - 3)
                count += 1
                shows(page, "label-count", f"^{count} label")
        page.locator("#train").click()
        shows(page, "train", r"^Stop the training")
        shows(page, "train-text", "contact, neuron: ")
        until(lambda: page.locator("#readout").input_value() == "played.readout.json", "it reads the recording")
        until(lambda: page.locator("#detection-list li").count() > 0, "its detections are listed")
        assert page.locator("#detection-marks span").count() > 0
        found = [row.split() for row in page.locator("#detection-list li").all_inner_texts()]
        wanted = sorted((t_us / 1e6, label) for label, times in truth.items() for t_us in times)
        assert [label for label, *_ in found][::-1] == [label for _, label in wanted]
        assert [float(t) for _, t, *_ in found][::-1] == pytest.approx([t for t, _ in wanted], abs=0.05)
        low = page.locator("#detection-list").bounding_box()
        assert low["y"] + 40 < 900, "detections are in sight"
        assert not page.errors
        page.context.close()
    assert taxel.Readout.load(tmp_path / "played.readout.json").labels == ("contact", "lift")


def test_a_stretch_is_cut_out_and_the_picture_saved(replay: Any, recording: Path, tmp_path: Path) -> None:
    press(replay, "Home", "4", "[")
    press(replay, "Shift+ArrowRight")
    until(lambda: clock(replay) > 1.1, "a second on")
    press(replay, "]")
    replay.locator("#cut-name").fill("piece.mcap")
    replay.locator("#cut-write").click()
    shows(replay, "notice-text", r"wrote piece\.mcap")
    whole, piece = taxel.open(recording).events, taxel.open(recording.parent / "piece.mcap").events
    assert 0 < len(piece.t) < len(whole.t)
    with replay.expect_download() as download:
        press(replay, "s")
    download.value.save_as(tmp_path / "picture.png")
    assert (tmp_path / "picture.png").read_bytes().startswith(b"\x89PNG")


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
