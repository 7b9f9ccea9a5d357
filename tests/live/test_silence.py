"""`taxel live` in the terminal: silence is said, and Ctrl-C ends it promptly."""

from __future__ import annotations

import socket

import numpy as np
from loopback import free_port
from panel.browser import running
from panel.protocol import word

from taxel import Array, Frames, Tare
from taxel.detect import PlainRule


def test_what_does_not_arrive_is_said_and_ctrl_c_ends_it(tmp_path):
    rest = Tare.take(Frames(np.full((2, 64, 64), 40.0), [0, 1000], array=Array.thesis()))
    PlainRule("area", 2, tare=rest).save(tmp_path / "rule.json")
    port = free_port()
    words = ("live", "--readout", "rule.json", "--port", str(port), "--host", "127.0.0.1", "--preset", "5.2 kHz")
    with running(*words, folder=tmp_path) as server:
        server.wait_for(r"(listening on)")
        assert str(port) in server.wait_for(r"nothing has arrived on (\S+ \S+)")
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as board:
            board.sendto(word(1000, 3, 4, 60), ("127.0.0.1", port))
        server.wait_for(r"(datagrams arrive)")
        assert float(server.wait_for(r"quiet: nothing for ([\d.]+) s")) >= 1
        # Ctrl-C ends it; else this raises.
        server.end()
