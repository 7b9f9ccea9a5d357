"""The panel's server, by a client of its own (`protocol.py`), as docs/panel-protocol.md has it."""

from __future__ import annotations

from panel.protocol import Client, head, heard, word

from taxel.live import send


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
