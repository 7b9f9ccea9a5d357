"""The panel's server, by a client of its own (`protocol.py`), as docs/panel-protocol.md has it."""

from __future__ import annotations

import time

import numpy as np
from panel.protocol import (
    SOON,
    Client,
    head,
    heard,
    say,
    section,
    word,
)

from taxel.live import send


def test_a_frame_shows_what_came(live, panel):
    with Client(panel) as page:
        assert page.until("hello")["protocol"] == 1
        page.send(type="credit", n=2)
        assert np.all(section(page.until("frame"), 0, "<u2") == 65_535)
        sent = b"".join(word(4000, x, 5, 48) for x in range(64))
        send([sent, word(9000, 3, 5, 90)], *live.address, each=2, seconds=1e-4)
        heard(live, 65)
        while head(page.until("frame"))[0]["events"] < 65:
            pass
        frame = page.frames[-1]
        about, sections = head(frame)
        assert (about["magic"], about["bytes"], about["rows"], about["columns"]) == (b"TXF1", 144, 64, 64)
        assert all(start % 8 == 0 for start, _ in sections)
        pressure = section(frame, 0, "<u2").reshape(64, 64)
        assert pressure[5, 3] == 90
        assert np.all(np.delete(pressure[5], 3) == 48)
        assert np.all(np.delete(pressure, 5, axis=0) == 65_535)
        # The rest is tracked from the first values on: slowly where a value is far from it.
        while not (rest := section(page.until("frame"), 5, "<u2")).size or rest[5 * 64 + 4] != 48:
            pass
        assert 48 <= rest[5 * 64 + 3] < (48 + 90) / 2
        assert page.ask("watch", taxel=[3, 5])["type"] == "done"
        while head(page.until("frame"))[0]["watched"] != 5 * 64 + 3:
            pass
        assert 90 in section(page.frames[-1], 4, "<u2").reshape(-1, 3)[:, 1]


def test_a_source_that_stalled_is_shown_at_its_own_time_again(live, panel):
    with Client(panel) as page:
        page.send(type="credit", n=1)
        for t_us in range(10_000, 400_000, 10_000):
            send([word(t_us, 3, 5, 40 + t_us // 10_000)], *live.address, seconds=0.01)
        heard(live, 39)
        t_us = 0
        while t_us < 900_000:
            # Without datagrams, time advances by the host's clock.
            page.send(type="credit", n=1)
            t_us = head(page.until("frame"))[0]["t_us"]
        send([word(400_000, 4, 5, 99)], *live.address, seconds=0.01)
        since = time.monotonic()
        for _ in range(100):
            page.send(type="credit", n=1)
            t_us = head(page.until("frame"))[0]["t_us"]
            if t_us < 700_000:
                break
        assert t_us >= 400_000, "not before what was heard"
        assert head(page.frames[-1])[0]["flags"] & 4, "columns that never were are forgotten"
        assert section(page.frames[-1], 0, "<u2").reshape(64, 64)[5, 4] == 99
        # The board's time continues from there, and does not jump to the host's estimate.
        for _ in range(8):
            t_us = head(page.until("frame"))[0]["t_us"]
        assert 400_000 < t_us < 600_000 + 1e6 * (time.monotonic() - since)


def test_narrow_and_wide_columns_follow_the_board_too(live, panel):
    with Client(panel) as page:
        page.send(type="credit", n=2)
        sent = 0
        for column_us in (500, 4000, 32_000):
            assert page.ask("zoom", column_us=column_us)["type"] == "done"
            for _ in range(50):
                sent += 1
                say(live, word(20_000 * sent, 3, 5, 40 + sent % 2 * 20, sent % 2 == 1))
                time.sleep(0.002)
            heard(live, sent)
            last, columns = 20_000 * sent // column_us, {}
            for n in range(1, sent + 1):
                column = 20_000 * n // column_us
                if column > last - 1249:
                    columns[column] = columns.get(column, 0) + (1 if n % 2 else 1 << 4)
            # A frame may be made before the columns hold what is counted already.
            seen, end = {}, time.monotonic() + SOON
            while {column: seen.get(column) for column in columns} != columns:
                assert time.monotonic() < end, column_us
                frame = page.until("frame")
                about = head(frame)[0]
                if about["column_us"] != column_us:
                    continue
                if about["flags"] & 4:
                    seen = {}
                raster = section(frame, 2, "u1").reshape(-1, 64)
                seen.update((about["first"] + k, raster[k, 5]) for k in range(about["count"]))


def test_health_of_what_is_shown_is_that_of_taxel_health(live, panel):
    # Three touches of a dead taxel's neighbours; no other place is touched.
    block = [(x, y) for x in range(5) for y in range(5) if (x, y) != (2, 2)]
    frames = [
        b"".join(word(100_000 * k, x, y, ticks, k % 2 == 1) for x, y in block)
        for k, ticks in enumerate([40, 60, 40, 60, 40, 60, 40, 41])
    ]
    sent = send(frames, *live.address, each=8, seconds=0.001)
    heard(live, sent["datagrams"] * 24)
    with Client(panel) as page:
        page.send(type="credit", n=1)
        while head(page.until("frame"))[0]["events"] < 192:
            pass
        assert page.ask("health")["type"] == "done"
        health = next(m for m in page.said if m["type"] == "health")
        assert (health["dead"], health["stuck"], health["noisy"]) == ([[2, 2]], [], [])
        # Of the others, those that moved work.
        assert health["untested"] == 64 * 64 - 25
