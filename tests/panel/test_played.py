"""The past of a board reaches a client whole; the oracle reads the events alone."""

import time

import numpy as np
import pytest
from loopback import until
from panel.protocol import SOON, Client, section
from tests.live.boards import LOOPBACK, SMALL, above_rest, play, presses, touch, wait_for

from taxel.live import Live
from taxel.panel import Panel

ConnectionClosedOK = pytest.importorskip("websockets.exceptions").ConnectionClosedOK


def shown(frame, rest):
    """The values above rest, by a noise floor of 3 ticks, as docs and page have them."""
    values = section(frame, 0, "<u2").astype(int)
    above = np.where((values == 65_535) | (rest == 65_535), 0, values - rest)
    return np.where(above > 3, above, 0).reshape(SMALL.shape)


def test_a_client_that_connects_later_is_told_the_detections_before_it_and_the_end():
    found, events = [], presses(5)
    with Live(0, host=LOOPBACK, array=SMALL, readout=touch(), say=found.append) as live:
        panel = Panel(live)
        wait_for(live, play(events, live.address[1]))
        until(lambda: live.counters["detections"] == 5)
        with Client(panel) as page:
            page.send(type="credit", n=2)
            told = [page.until("detection")["t_us"] for _ in range(5)]
            assert told == [one.t for one in found]
            end, rest = time.monotonic() + SOON, None
            while rest is None or not np.array_equal(shown(page.frames[-1], rest), above_rest(events)):
                assert time.monotonic() < end
                values = section(page.until("frame"), 5, "<u2").astype(int)
                rest = values if len(values) else rest
            panel.stop()
            with pytest.raises(ConnectionClosedOK):
                list(iter(page.next, None))
