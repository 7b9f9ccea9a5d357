"""The panel's server, by a client of its own (`protocol.py`), as docs/panel-protocol.md has it."""

from __future__ import annotations

import numpy as np
from panel.protocol import (
    Client,
    head,
    heard,
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
        assert (about["magic"], about["bytes"], about["rows"], about["columns"]) == (b"TXF1", 136, 64, 64)
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
