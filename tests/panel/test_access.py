"""Who may use the panel's server: origins, tokens, limits of connections, refusals."""

from __future__ import annotations

import contextlib
import http.client
import socket
import sys
import threading
import time

import pytest
from panel.protocol import (
    ADDRESS,
    SOON,
    Client,
    door,
    heard,
    say,
    websockets,
    word,
)
from shell import run, run_beside

import taxel
from taxel.live import Live, send
from taxel.panel import Panel


def test_a_port_that_is_taken_is_said_with_what_to_do(panel, tmp_path):
    taxel.convert(taxel.Events([0], [0], [0], [True], array=taxel.Array(2, 2)), tmp_path / "a.npz")
    host, port = panel.address
    done = run("view", tmp_path / "a.npz", "--no-open", "--panel-port", port)
    says = f"taxel: {host}:{port}: address already in use; end the program that listens there, or name another port\n"
    assert (done.returncode, done.stderr) == (3, says)


@pytest.mark.skipif(sys.platform != "linux", reason="has one address of this computer alone, else")
def test_unless_asked_no_other_address_than_this_computers_own_is_listened_on(panel, tmp_path):
    """Who listens on all addresses is reached at each of them."""

    def is_reached(port):
        with contextlib.suppress(OSError), socket.create_connection(("127.0.0.2", port), timeout=SOON):
            return True
        return False

    def look(said):
        reached.append(is_reached(door(said).address[1]))

    reached = [is_reached(panel.address[1])]
    taxel.convert(taxel.Events([0], [0], [0], [True], array=taxel.Array(2, 2)), tmp_path / "a.npz")
    run_beside(look, "view", tmp_path / "a.npz", "--no-open", says=ADDRESS)
    run_beside(look, "live", "--panel", "--port", 0, "--host", "127.0.0.1", "--folder", tmp_path, says=ADDRESS)
    run_beside(
        look, "view", tmp_path / "a.npz", "--no-open", "--panel-host", "127.0.0.2", says=r"http://127\.0\.0\.2:\d+/#\S+"
    )
    assert reached == [False, False, False, True]


def test_a_foreign_or_nameless_visitor_is_not_let_in(panel):
    host = "{}:{}".format(*panel.address)
    foreign = "http://evil.example"
    for how in (
        {"subprotocols": ["taxel.panel.1", f"token.{'0' * 64}"]},
        {"subprotocols": ["taxel.panel.1"]},
        {"subprotocols": [f"token.{panel.token}"]},
        {"origin": foreign},
        {"origin": None},
        {"origin": "null"},
        {"origin": f"https://{host}"},
    ):
        with pytest.raises(websockets.exceptions.InvalidStatus) as refused:
            Client(panel, **how)
        assert refused.value.response.status_code == (401 if "subprotocols" in how else 403), how
    upgrade = {"Connection": "Upgrade", "Upgrade": "websocket", "Sec-WebSocket-Version": "13"}
    for path, headers, status in (
        ("/", {}, 200),
        ("/", {"Host": "evil.example"}, 421),
        ("/", {"Host": f"localhost:{panel.address[1]}"}, 200),
        ("/", {"Host": "localhost:1"}, 421),
        ("/socket", {"Origin": f"http://{host}", **upgrade}, 401),
    ):
        line = http.client.HTTPConnection(*panel.address, timeout=SOON)
        line.putrequest("GET", path, skip_host="Host" in headers)
        for name, value in headers.items():
            line.putheader(name, value)
        line.endheaders()
        answer = line.getresponse()
        assert answer.status == status, (path, headers)
        assert "default-src 'self'" in answer.headers["Content-Security-Policy"]
        line.close()
    for method, body, status in (("POST", b"", 405), ("POST", b"x" * 100_000, 400), ("GET", b"x", 400)):
        line = http.client.HTTPConnection(*panel.address, timeout=SOON)
        line.request(method, "/", body)
        answer = line.getresponse()
        assert (answer.status, "Content-Security-Policy" in answer.headers) == (status, True)
        line.close()


NONSENSE = [
    "nonsense",
    "[]",
    "{}",
    '{"type":7}',
    '{"type":"fly"}',
    '{"type":"credit","n":-1}',
    '{"type":"watch","taxel":[64,0]}',
    '{"type":"open","name":"../secret.mcap"}',
    '{"type":"open","name":"/etc/passwd"}',
    '{"type":"open","name":"not there.mcap"}',
    '{"type":"record","name":"../x"}',
    '{"type":"seek","t_us":1e300}',
    '{"type":"set","values":{"noise_floor":5}}',
    '{"type":"set","values":{"speed":5}}',
    '{"type":"play","speed":NaN}',
    '{"type":"change","changes":[{"new":{"label":"a","t_us":5,"source":"","trial":""}}]}',
    '{"type":"stop"}',
    '{"type":"cut","start_us":0,"stop_us":1,"name":"x.mcap"}',
    '{"type":"credit","n":1,"id":[1]}',
    "[" * 20_000,
]


def test_what_makes_no_sense_is_refused_and_the_next_is_heard(panel):
    with Client(panel) as page:
        for message in NONSENSE:
            page.socket.send(message)
            assert page.until("refused")["reason"], message
            assert page.ask("recordings")["type"] == "done"


@pytest.mark.parametrize(("message", "code"), [("x" * 1_100_000, 1009), (b"bytes", 1003)])
def test_what_no_page_sends_ends_the_connection(panel, message, code):
    with Client(panel) as page:
        page.socket.send(message)
        with pytest.raises(websockets.exceptions.ConnectionClosed) as closed:
            page.until("nothing")
    assert closed.value.rcvd.code == code


def test_many_visitors_half_of_whom_never_read_cost_no_event_and_no_frame_of_another(live, panel):
    visitors = [Client(panel) for _ in range(63)]
    try:
        for k, visitor in enumerate(visitors):
            visitor.send(type="credit", n=8)
            if k % 2:
                for _ in range(20):
                    visitor.send(type="credit", n=8)
        frames = [b"".join(word(t * 200, x, t % 64, 48 + (t + x) % 60) for x in range(60)) for t in range(200)]
        sent = {}
        sender = threading.Thread(
            target=lambda: sent.update(send(frames, *live.address, each=1, period_us=500.0, seconds=3.0))
        )
        with Client(panel) as page:
            with pytest.raises(websockets.exceptions.InvalidStatus) as refused:
                Client(panel)
            assert refused.value.response.status_code == 503
            page.send(type="credit", n=2)
            sender.start()
            before = len(page.frames)
            # A page that reads goes on being shown frames.
            while sender.is_alive() or len(page.frames) - before < 10:
                page.until("frame")
            sender.join()
            heard(live, sent["datagrams"] * 60)
            counters = page.until("counters")
            assert counters["viewers"] == 64
            assert (counters["lost"]["number"], counters["lost"]["by_kernel_known"]) == (0, True)
    finally:
        for visitor in visitors:
            visitor.socket.socket.close()
    assert live.counters["events"] == sent["datagrams"] * 60


def deaf(panel):
    """A client that asks for frames over and over and reads nothing, behind a small buffer."""
    line = socket.socket()
    line.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    line.connect(panel.address)
    host = "{}:{}".format(*panel.address)
    wanted = (
        "GET /socket HTTP/1.1", f"Host: {host}", f"Origin: http://{host}", "Connection: Upgrade", "Upgrade: websocket",
        "Sec-WebSocket-Version: 13", "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
        f"Sec-WebSocket-Protocol: taxel.panel.1, token.{panel.token}", "", "",
    )  # fmt: skip
    line.sendall("\r\n".join(wanted).encode())
    credit = b'{"type":"credit","n":8}'
    return line, bytes([0x81, 0x80 | len(credit), 0, 0, 0, 0]) + credit


def test_a_visitor_that_does_not_read_is_sent_away_after_five_seconds_and_another_is_shown_frames(tmp_path):
    array = taxel.Array(256, 256)
    with Live(0, host="127.0.0.1", array=array) as live, Panel(live, folder=tmp_path) as panel:
        (line, credit), (other, _) = deaf(panel), deaf(panel)
        with Client(panel) as page, line, other:
            page.send(type="credit", n=2)
            until = time.monotonic() + 5.0
            while time.monotonic() < until and panel.viewers < 3:
                page.next()
            begun, t_us = time.monotonic(), 0
            while panel.viewers > 1:
                with contextlib.suppress(OSError):
                    line.sendall(credit)
                    other.sendall(credit)
                t_us += 10_000
                say(live, word(t_us, 3, 5, 40 + t_us // 10_000 % 50))
                page.until("frame")
                assert time.monotonic() < begun + SOON
            assert time.monotonic() - begun > 4.0
            page.ask("recordings")
