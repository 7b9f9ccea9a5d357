"""The panel's server, by a client that is written from docs/panel-protocol.md alone."""

from __future__ import annotations

import contextlib
import http.client
import json
import socket
import struct
import threading
import time
from contextlib import contextmanager
from types import SimpleNamespace
from urllib.parse import urlsplit

import numpy as np
import pytest
from panel.browser import free_port, running

import taxel
import taxel.device
from taxel.cli import main
from taxel.live import Live, Panel, send
from taxel.simulate import Board, Version2
from taxel.wire import Registers

websockets = pytest.importorskip("websockets", reason="the test extra brings websockets")
client = pytest.importorskip("websockets.sync.client")

#: How long what must happen may take on a busy machine, s.
SOON = 60.0


class Client:
    """Somebody else's page."""

    def __init__(self, panel, **changed):
        self.host, self.token = "{}:{}".format(*panel.address), panel.token
        how = {"origin": f"http://{self.host}", "subprotocols": ["taxel.panel.1", f"token.{panel.token}"], **changed}
        self.door = client.connect(f"ws://{self.host}/socket", max_size=None, open_timeout=SOON, **how)
        self.socket = self.door.__enter__()
        self.pictures, self.said, self.ids, self.asked = [], [], 0, 0

    def __enter__(self):
        return self

    def __exit__(self, *raised):
        self.door.__exit__(*raised)

    def send(self, **message):
        self.socket.send(json.dumps(message))

    def next(self):
        message = self.socket.recv(timeout=SOON)
        if isinstance(message, bytes):
            self.pictures.append(message)
            self.send(type="credit", n=1)
            return message
        self.said.append(json.loads(message))
        return self.said[-1]

    def until(self, kind, **wanted):
        until = time.monotonic() + SOON
        while time.monotonic() < until:
            message = self.next()
            if isinstance(message, bytes):
                if kind == "picture":
                    return message
            elif message["type"] == kind and all(message[key] == value for key, value in wanted.items()):
                return message
        raise AssertionError(f"no {kind} {wanted}; the last were {[m['type'] for m in self.said[-20:]]}")

    def since_asked(self, kind, **wanted):
        """What may also have been told before the last question was answered."""
        for message in self.said[self.asked :]:
            if message["type"] == kind and all(message[key] == value for key, value in wanted.items()):
                return message
        return self.until(kind, **wanted)

    def ask(self, kind, **message):
        self.ids += 1
        self.asked = len(self.said)
        self.send(type=kind, id=self.ids, **message)
        while True:
            answer = self.next()
            if not isinstance(answer, bytes) and answer["type"] in ("done", "refused") and answer["id"] == self.ids:
                return answer


def head(picture):
    names = ("magic", "bytes", "flags", "number", "rows", "columns", "t_us", "made_ns", "events", "watched")
    names += ("column_us", "first", "count", "none")
    values = struct.unpack_from("<4sHHIHHqqQIIqII", picture)
    sections = struct.unpack_from("<16I", picture, 64)
    return dict(zip(names, values, strict=True)), list(zip(sections[::2], sections[1::2], strict=True))


def section(picture, k, dtype):
    start, size = head(picture)[1][k]
    return np.frombuffer(picture, dtype, count=size // np.dtype(dtype).itemsize, offset=start)


def word(t_us, x, y, ticks, more=True):
    """A change and its intensity, version 1 of the wire (docs/wire.md)."""
    t = t_us // 100 % 65_536
    first = [0x80 | more << 6, t]
    second = [0xA0 | more << 6, ticks]
    return b"".join(bytes([a | b >> 14, b >> 7 & 127, b & 127, x, y]) for a, b in (first, second))


def marker(t_us):
    """The start of a recording, version 1 of the wire."""
    t = t_us // 100 % 65_536
    return bytes([0xC8 | t >> 14, t >> 7 & 127, t & 127, 0, 0])


@pytest.fixture
def live():
    with Live(0, host="127.0.0.1") as live:
        yield live


@pytest.fixture
def panel(live, tmp_path):
    with Panel(live, folder=tmp_path) as panel:
        yield panel


def say(live, *datagrams):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as board:
        for datagram in datagrams:
            board.sendto(datagram, live.address)


def heard(live, events):
    until = time.monotonic() + SOON
    while live.counters["events"] < events:
        assert time.monotonic() < until, live.counters
        time.sleep(0.01)


def test_a_picture_shows_what_came(live, panel):
    with Client(panel) as page:
        assert page.until("hello")["protocol"] == 1
        page.send(type="credit", n=2)
        assert np.all(section(page.until("picture"), 0, "<u2") == 65_535)
        frame = b"".join(word(4000, x, 5, 48) for x in range(64))
        send([frame, word(9000, 3, 5, 90)], *live.address, each=2, seconds=1e-4)
        heard(live, 65)
        while head(page.until("picture"))[0]["events"] < 65:
            pass
        picture = page.pictures[-1]
        about, sections = head(picture)
        assert (about["magic"], about["bytes"], about["rows"], about["columns"]) == (b"TXP1", 128, 64, 64)
        assert all(start % 8 == 0 for start, _ in sections)
        pressure = section(picture, 0, "<u2").reshape(64, 64)
        assert pressure[5, 3] == 90
        assert np.all(np.delete(pressure[5], 3) == 48)
        assert np.all(np.delete(pressure, 5, axis=0) == 65_535)
        while not (rest := section(page.until("picture"), 5, "<u2")).size or rest[5 * 64 + 3] != 48:
            pass
        assert page.ask("watch", taxel=[3, 5])["type"] == "done"
        while head(page.until("picture"))[0]["watched"] != 5 * 64 + 3:
            pass
        assert 90 in section(page.pictures[-1], 4, "<u2").reshape(-1, 3)[:, 1]


def test_a_source_that_stalled_is_shown_at_its_own_time_again(live, panel):
    with Client(panel) as page:
        page.send(type="credit", n=1)
        for t_us in range(10_000, 400_000, 10_000):
            send([word(t_us, 3, 5, 40 + t_us // 10_000)], *live.address, seconds=0.01)
        heard(live, 39)
        t_us = 0
        while t_us < 900_000:
            # Time goes on by the host's clock where nothing comes.
            page.send(type="credit", n=1)
            t_us = head(page.until("picture"))[0]["t_us"]
        send([word(400_000, 4, 5, 99)], *live.address, seconds=0.01)
        since = time.monotonic()
        for _ in range(100):
            page.send(type="credit", n=1)
            t_us = head(page.until("picture"))[0]["t_us"]
            if t_us < 700_000:
                break
        assert t_us >= 400_000, "not before what was heard"
        assert head(page.pictures[-1])[0]["flags"] & 4, "columns that never were are forgotten"
        assert section(page.pictures[-1], 0, "<u2").reshape(64, 64)[5, 4] == 99
        # Its time goes on from there, and does not leap to what the host's clock would make of it.
        for _ in range(8):
            t_us = head(page.until("picture"))[0]["t_us"]
        assert 400_000 < t_us < 600_000 + 1e6 * (time.monotonic() - since)


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
        ("/../Cargo.toml", {}, 404),
        ("/%2e%2e/Cargo.toml", {}, 404),
        ("//etc/passwd", {}, 404),
        ("/vendor", {}, 404),
        ("/index.html/", {}, 404),
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
    line = http.client.HTTPConnection(*panel.address, timeout=SOON)
    line.request("POST", "/", b"")
    assert line.getresponse().status == 405


def test_connections_that_say_nothing_are_so_many_and_no_more(live, panel):
    with Client(panel) as page, contextlib.ExitStack() as idle:
        crowd = [idle.enter_context(socket.create_connection(panel.address, SOON)) for _ in range(600)]
        assert page.ask("recordings")["type"] == "done", "who was in is served"

        def closed():
            count = 0
            for one in crowd:
                one.setblocking(False)
                with contextlib.suppress(BlockingIOError):
                    count += one.recv(1) == b""
            return count

        until = time.monotonic() + SOON
        while closed() < 600 - 511:
            assert time.monotonic() < until
            time.sleep(0.05)
        assert closed() == 600 - 511
        idle.close()
        while True:
            # They are gone as soon as the server has seen it.
            with contextlib.suppress(OSError, websockets.exceptions.InvalidHandshake), Client(panel) as other:
                assert other.until("hello")["live"]
                break
            assert time.monotonic() < until
            time.sleep(0.05)


@pytest.mark.parametrize(
    "message",
    [
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
        '{"type":"encode","encoder":{"name":"none"}}',
        '{"type":"mark","label":"a","t_us":5}',
        '{"type":"stop"}',
        '{"type":"cut","start_us":0,"stop_us":1,"name":"x.mcap"}',
        '{"type":"credit","n":1,"id":[1]}',
        "[" * 20_000,
    ],
)
def test_what_makes_no_sense_is_refused_and_the_next_is_heard(panel, message):
    with Client(panel) as page:
        page.socket.send(message)
        assert page.until("refused")["reason"]
        assert page.ask("recordings")["type"] == "done"


@pytest.mark.parametrize(("message", "code"), [("x" * 70_000, 1009), (b"bytes", 1003)])
def test_what_no_page_sends_ends_the_connection(panel, message, code):
    with Client(panel) as page:
        page.socket.send(message)
        with pytest.raises(websockets.exceptions.ConnectionClosed) as closed:
            page.until("nothing")
    assert closed.value.rcvd.code == code


def test_who_is_refused_over_and_over_is_let_go(panel):
    with Client(panel) as page:
        for _ in range(101):
            page.socket.send("nonsense")
        with pytest.raises(websockets.exceptions.ConnectionClosed) as closed:
            page.until("nothing")
    assert closed.value.rcvd.code == 1008


def test_a_hundred_visitors_half_of_whom_never_read_cost_no_event_and_no_picture_of_another(live, panel):
    visitors = [Client(panel) for _ in range(99)]
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
            page.send(type="credit", n=2)
            sender.start()
            before = len(page.pictures)
            while sender.is_alive():
                page.until("picture")
            sender.join()
            assert len(page.pictures) - before >= 10, "a page that reads goes on being shown pictures"
            heard(live, sent["datagrams"] * 60)
            counters = page.until("counters")
            assert counters["viewers"] == 100
            assert counters["lost"]["kernel"] == counters["lost"]["queue"] == 0
            assert counters["reach_bytes"] < 512 << 20
    finally:
        for visitor in visitors:
            visitor.socket.socket.close()
    assert live.counters["events"] == sent["datagrams"] * 60


def test_a_recording_is_made_labelled_shown_and_cut(live, panel, tmp_path):  # noqa: PLR0915  one story
    playing = threading.Event()
    clock = {"t": 7_000_000}

    def play():
        # Beyond one turn of the board's clock, so that a recording begun now has to find its place.
        while not playing.is_set():
            t = clock["t"] = clock["t"] + 1000
            send([word(t, t // 1000 % 64, 7, 40 + t // 1000 % 50)], *live.address, seconds=0.0005)
            time.sleep(0.001)

    board = threading.Thread(target=play)
    with Client(panel) as page:
        send([word(3_000_000, 9, 9, 77)], *live.address, seconds=0.0005)
        heard(live, 1)
        board.start()
        try:
            assert page.ask("record", name="step", index=1, length_s=0.5, label="heel")["type"] == "done"
            assert page.ask("record", name="other")["type"] == "refused"
            last = page.since_asked("recorder", state="idle")
        finally:
            playing.set()
            board.join()
        assert last["last"]["file"] == "step1.mcap"
        assert last["index"] == 2
        again = page.ask("record", name="step", index=1)
        assert again["type"] == "refused"
        assert "exists" in again["reason"]
        recording = taxel.open(tmp_path / "step1.mcap")
        assert recording.verdict.startswith("nothing lost")
        assert [(note.text, note.t) for note in recording.notes] == [("heel", None)]
        # On the clock that the board was heard on, not from its own first stamp.
        assert recording.events.t[0] > 6_553_600
        page.send(type="credit", n=2)
        assert page.ask("open", name="step1.mcap")["type"] == "done"
        opened = next(m for m in page.said if m["type"] == "opened")
        assert (opened["events"], opened["start_us"]) == (len(recording.events), recording.events.t[0])
        middle = int(recording.events.t[len(recording.events) // 2])
        assert page.ask("seek", t_us=middle)["type"] == "done"
        while head(page.until("picture"))[0]["t_us"] != middle:
            pass
        picture = section(page.pictures[-1], 0, "<u2").reshape(64, 64)
        seen = recording.events.t <= middle
        for x in range(64):
            here = seen & (recording.events.x == x)
            if here.any():
                assert picture[7, x] == recording.events.intensity[here][-1]
        assert picture[9, 9] == 77, "what was held when it began"
        assert page.ask("mark", label="contact", t_us=middle)["type"] == "done"
        labels = next(m for m in reversed(page.said) if m["type"] == "labels")["labels"]
        before = (tmp_path / "step1.mcap").read_bytes()
        assert page.ask("rename", label_id=labels[0]["label_id"], label="lift")["type"] == "done"
        assert page.ask("move", label_id=labels[0]["label_id"], t_us=middle + 5)["type"] == "done"
        assert (tmp_path / "step1.notes.csv").read_text() == f"label,t_us\nlift,{middle + 5}\n"
        assert (tmp_path / "step1.mcap").read_bytes() == before
        notes = taxel.open(tmp_path / "step1.mcap").notes
        assert [(n.text, n.t) for n in notes][1:] == [("lift", middle + 5)]
        assert page.ask("cut", start_us=opened["start_us"], stop_us=middle, name="half.mcap")["type"] == "done"
        assert len(taxel.open(tmp_path / "half.mcap").events) == int((recording.events.t < middle).sum())
        assert page.ask("delete", label_id=labels[0]["label_id"])["type"] == "done"
        assert page.ask("step", frames=-1)["type"] == "done"
        earlier = recording.events.t[recording.events.t < middle].max()
        assert next(m for m in reversed(page.said) if m["type"] == "transport")["t_us"] == earlier


def test_a_recording_of_the_panel_holds_all_sources_of_the_board(tmp_path):
    sources = {"imu": "given,columns=t_us:ax"}
    with (
        Live(0, host="127.0.0.1", record_later=True, sources=sources) as live,
        Panel(live, folder=tmp_path) as panel,
        Client(panel) as page,
    ):
        live.sample("imu", [1.0, 0.0])
        page.ask("record", name="walk")
        page.since_asked("recorder", state="recording")
        live.sample("imu", [2.0, 0.5])
        sent = send([bytes.fromhex("c000050304")], *live.address, seconds=0.01)["datagrams"]
        page.until("counters", events=sent)
        live.sample("imu", [3.0, 1.5])
        page.ask("stop")
        done = page.since_asked("recorder", state="idle")
        assert (done["error"], done["last"]["file"]) == (None, "walk.mcap")
    recording = taxel.open(tmp_path / "walk.mcap")
    assert len(recording.sources["board"].events) == sent
    assert recording.sources["imu"].frames().values.reshape(-1).tolist() == [0.5, 1.5]


def test_the_ports_and_addresses_of_the_machine_are_told(panel):
    with Client(panel) as page:
        assert page.ask("places")["type"] == "done"
        told = next(m for m in page.said if m["type"] == "places")
        assert [port["place"] for port in told["serial"]] == [port.place for port in taxel.device.ports()]
        assert {"host": "127.0.0.1", "name": "lo"} in told["addresses"]
        for address in told["addresses"]:
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as own:
                own.bind((address["host"], 0))


def test_differences_add_up_once_the_page_says_that_they_are_some(panel):
    with Client(panel) as page:
        assert page.until("hello")["delta_intensity"] is False
        page.send(type="credit", n=2)
        say(panel.live, word(1000, 3, 5, 90))
        while head(page.until("picture"))[0]["events"] < 1:
            pass
        where = panel.live.address
        assert page.ask("delta_intensity", on="yes")["field"] == "on"
        said = page.ask("delta_intensity", on=True)
        assert said["type"] == "done", said
        told = next((m for m in page.said[1:] if m["type"] == "hello"), None) or page.until("hello")
        assert (told["delta_intensity"], told["udp"]) == (True, "{}:{}".format(*where))
        say(
            panel.live,
            *(word(t, 3, 5, n, more) for t, more, n in ((1000, True, 40), (2000, True, 8), (3000, False, 18))),
        )
        say(panel.live, word(4000, 4, 5, 7))
        while head(page.until("picture"))[0]["events"] < 4:
            pass
        assert list(section(page.pictures[-1], 0, "<u2").reshape(64, 64)[5, 3:5]) == [30, 7]
        assert page.ask("record", name="delta")["type"] == "done"
        assert "recording runs" in page.ask("delta_intensity", on=False)["reason"]
        say(panel.live, word(5000, 3, 5, 1))
        heard(panel.live, 5)
        assert page.ask("stop")["type"] == "done"
        page.since_asked("recorder", state="idle")


@pytest.mark.parametrize("first", ["event", "marker"])
def test_a_recording_of_a_later_wrap_has_the_times_of_the_page(live, tmp_path, first):
    with Panel(live, folder=tmp_path) as panel, Client(panel) as page:
        # Version 1 says times modulo 6.5536 s: two wraps pass before it records.
        for n in range(7):
            say(live, word(2_000_000 * (n + 1), 3, 5, n + 1))
            heard(live, n + 1)
        assert page.ask("record", name="late")["type"] == "done"
        page.since_asked("recorder", state="recording")
        if first == "marker":
            say(live, marker(14_100_000))
            while not live.counters["markers"]:
                time.sleep(0.01)
        say(live, word(14_200_000, 3, 5, 9))
        heard(live, 8)
        assert page.ask("stop")["type"] == "done"
        last = page.since_asked("recorder", state="idle")
        assert last["error"] is None, last
        found = taxel.open(tmp_path / "late.mcap").events
        assert list(found.t) == [14_200_000]
        assert found.markers == (((14_100_000, True),) if first == "marker" else ())


def test_the_command_stays_while_a_page_begins_its_board_anew(tmp_path):
    with running("live", "--panel", "--port", "0", "--host", "127.0.0.1", folder=tmp_path) as server:
        url = urlsplit(server.wait_for(r"(http://127\.0\.0\.1:\d+/#\S+)"))
        with Client(
            SimpleNamespace(address=(url.hostname, url.port), token=url.fragment.removeprefix("token="))
        ) as page:
            for n in range(12):
                assert page.ask("delta_intensity", on=n % 2 == 0)["type"] == "done"
                # The command looks every tenth of a second, at any moment of it.
                assert page.ask("listen", host="127.0.0.1", port=0)["type"] == "done"
        # Nothing came; that is all there is to complain of.
        assert server.end() == 3, "".join([*server.said, *iter(server.lines.get, "")])


@contextmanager
def page_of_a_board(folder, *options):
    """A client of the command's panel, which hears an emulated board and holds its serial line."""
    port = str(free_port())
    with running("emulate", "--port", port, "--control", "0", *options, folder=folder) as emulated:
        control = emulated.wait_for(r"commands are taken at (\S+)")
        panel = ("live", "--panel", "--port", port, "--host", "127.0.0.1", "--control", control)
        with running(*panel, folder=folder) as server:
            url = urlsplit(server.wait_for(r"(http://127\.0\.0\.1:\d+/#\S+)"))
            door = SimpleNamespace(address=(url.hostname, url.port), token=url.fragment.removeprefix("token="))
            with Client(door) as page:
                yield page


@pytest.mark.parametrize("version", [1, 2])
def test_registers_are_read_again_when_the_board_was_reset(tmp_path, version):
    # Version 2 tells of it by a new session, version 1 by nothing but the greeting on the board's line.
    with page_of_a_board(tmp_path, "--wire", str(version), "--reset-every", "3") as page:
        page.send(type="credit", n=1)
        page.until("registers", known=True)
        while page.ask("set", values={"noise_floor": 9})["type"] != "done":
            pass  # it is being reset just now
        floors = []
        while not floors or floors[-1] != 3:
            said = page.until("registers", known=True)
            floors.append(said["values"]["noise_floor"])
        assert set(floors) <= {3, 9}


@pytest.mark.parametrize("version", [1, 2])
def test_a_preset_by_name_leaves_the_version_of_the_wire(tmp_path, version):
    with page_of_a_board(tmp_path, "--wire", str(version)) as page:
        page.send(type="credit", n=1)
        for name, floor in (("2 kHz", 10), ("5.2 kHz", 3)):
            assert page.ask("preset_apply", name=name)["type"] == "done"
            said = page.since_asked("registers", known=True, preset=name)
            assert (said["values"]["noise_floor"], said["values"]["wire_version"]) == (floor, version)


def spikes_of(page, columns):
    """The section of spikes, by column of time, of the last picture."""
    picture = page.pictures[-1]
    first, rows = head(picture)[0]["first"], head(picture)[0]["rows"]
    ups = section(picture, 6, "u1").reshape(-1, rows)
    return {column: list(np.flatnonzero(ups[column - first])) for column in columns}


def test_spikes_of_a_recording_and_any_width_of_its_columns_are_shown(tmp_path):
    # Row 2 rises by 20 ticks at each whole second, and falls half a second later; a quiet row tells that it is there.
    t = np.arange(0, 10_000_000, 500_000)
    p = np.arange(len(t)) % 2 == 0
    events = taxel.Events(t, 0 * t + 3, 0 * t + 2, p, intensity=np.where(p, 70, 50), array=taxel.Array(8, 8))
    taxel.convert(events, tmp_path / "steps.mcap")
    with Panel(tmp_path / "steps.mcap") as panel, Client(panel) as page:
        page.send(type="credit", n=2)
        assert page.ask("open", name="steps.mcap")["type"] == "done"
        assert page.ask("encode", encoder={"name": "change_events"})["type"] == "done"
        for column_us in (4000, 1000, 125, 64_000, 256_000):
            assert page.ask("zoom", column_us=column_us)["type"] == "done"
            for t_us in (9_000_000, 6_500_000, 100, 8_250_000):
                assert page.ask("seek", t_us=t_us)["type"] == "done"
                while True:
                    about = head(page.until("picture"))[0]
                    if about["t_us"] == t_us and about["flags"] & 4:
                        break
                assert about["column_us"] == column_us
                last = t_us // column_us
                assert about["first"] + about["count"] - 1 == last
                assert about["first"] <= max(0, last - 1249) + 1
                shown = range(about["first"], last + 1)
                raster = section(page.pictures[-1], 2, "u1").reshape(-1, 8)
                sums = section(page.pictures[-1], 3, "<u4").reshape(-1, 4)[:, 0]
                for column in shown:
                    ups, downs = (
                        sum(t // column_us == column and t <= t_us for t in t[p == which]) for which in (True, False)
                    )
                    assert raster[column - shown[0], 2] == ups | downs << 4, (column_us, t_us, column)
                    held = t[t <= min(t_us, (column + 1) * column_us - 1)]
                    assert sums[column - shown[0]] == (20 if len(held) and p[len(held) - 1] and held[-1] else 0)
                # The first change has nothing to be compared with; that of now is a spike when its sample is over.
                changed = {int(k) for k in t[(t < t_us) & (t > 0)] // column_us} & set(shown)
                assert spikes_of(page, changed) == {column: [2] for column in changed}
                assert (
                    not section(page.pictures[-1], 6, "u1")
                    .reshape(-1, 8)[[c - shown[0] for c in shown if c not in changed]]
                    .any()
                )
        assert page.ask("zoom", column_us=3000)["field"] == "column_us"
        assert page.ask("zoom", column_us=512_000)["field"] == "column_us"
        told = [m for m in page.said if m["type"] == "spikes"]
        assert {round(t_ms) for m in told for t_ms in m["t_ms"]} <= {int(k) // 1000 for k in t}
        assert {m["encoder"] for m in told} == {"change_events"}


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
            seen, complete = {}, len(page.pictures)
            while True:
                picture = page.until("picture")
                about = head(picture)[0]
                if about["column_us"] != column_us:
                    continue
                if about["flags"] & 4:
                    seen = {}
                raster = section(picture, 2, "u1").reshape(-1, 64)
                seen.update((about["first"] + k, raster[k, 5]) for k in range(about["count"]))
                # The next one has what came while this one was made.
                if about["events"] >= sent and len(page.pictures) > complete + 2:
                    break
                if about["events"] < sent:
                    complete = len(page.pictures)
            last = 20_000 * sent // column_us
            for n in range(sent, 0, -1):
                column = 20_000 * n // column_us
                if column <= last - 1249:
                    break
                here = [k for k in range(1, sent + 1) if 20_000 * k // column_us == column]
                ups = sum(k % 2 for k in here)
                assert seen[column] == ups | (len(here) - ups) << 4, (column_us, n)


def test_health_of_what_is_shown_is_that_of_taxel_health(live, panel):
    frames = [b"".join(word(t * 1000, x, y, 40 + t) for x in range(5) for y in range(5) if (x, y) != (2, 2))
              for t in range(20)]  # fmt: skip
    sent = send(frames, *live.address, each=20, seconds=0.001)
    heard(live, sent["datagrams"] * 24)
    with Client(panel) as page:
        page.send(type="credit", n=1)
        while head(page.until("picture"))[0]["events"] < 480:
            pass
        assert page.ask("health")["type"] == "done"
        assert next(m for m in page.said if m["type"] == "health")["dead"] == [[2, 2]]


def test_a_dead_taxel_of_a_board_of_version_2_is_found_though_states_tell_of_it(live, panel):
    random = np.random.default_rng(3)
    board = Board(Registers(wire_version=2), version_2=Version2(states_us=2_000))
    sent, until = 0, time.monotonic() + SOON
    for _ in range(60):
        ticks = random.integers(40, 100, board.array.taxels).astype(np.uint16)
        ticks[board.array.index(4, 7)] = 0
        datagrams = board.frame(ticks)
        say(live, *datagrams)
        sent += len(datagrams)
        # A frame at a time: nothing is lost on a busy machine.
        while live.counters["capture"]["datagrams"] < sent:
            assert time.monotonic() < until, live.counters
            time.sleep(0.001)
    with Client(panel) as page:
        page.send(type="credit", n=1)
        # A state has told what the dead one holds.
        while section(page.until("picture"), 0, "<u2").reshape(64, 64)[7, 4] != 0:
            pass
        dead = []
        for _ in range(200):
            # Until the others have spoken often enough to be told from it.
            assert page.ask("health")["type"] == "done"
            dead = next(m for m in reversed(page.said) if m["type"] == "health")["dead"]
            if dead:
                break
            time.sleep(0.1)
        assert dead == [[4, 7]]


def test_a_board_that_was_reset_is_shown_anew(live, panel):
    board = Board(Registers(wire_version=2), version_2=Version2(states_us=0))

    def said(columns, ticks):
        pictures = np.zeros((8, 64, 64), np.uint16)
        pictures[1:, 5, :columns] = ticks + 4 * np.arange(7)[:, None]
        return [datagram for picture in pictures for datagram in board.frame(picture.ravel())]

    with Client(panel) as page:
        page.send(type="credit", n=1)
        say(live, *said(40, 60))
        while np.sum(section(page.until("picture"), 0, "<u2") != 65_535) != 40:
            pass
        while head(page.until("picture"))[0]["flags"] & 4:
            pass
        here = len(page.pictures)
        board.reset()
        say(live, *said(5, 80))
        while np.sum(section(page.until("picture"), 0, "<u2") != 65_535) != 5:
            pass
        assert any(head(picture)[0]["flags"] & 4 for picture in page.pictures[here:])


def test_a_recording_alone_is_viewed_and_the_address_names_it(tmp_path):
    events = taxel.Events([0, 200], [3, 4], [5, 5], [True, False], array=taxel.Array(8, 8))
    taxel.convert(events, tmp_path / "two.mcap")
    with Panel(tmp_path / "two.mcap") as panel:
        assert panel.url.endswith("&open=two.mcap")
        with Client(panel) as page:
            hello = page.until("hello")
            assert (hello["live"], hello["open"]) == (False, "two.mcap")
            assert page.ask("open", name="two.mcap")["type"] == "done"
            assert page.ask("record", name="x")["type"] == "refused"
    with pytest.raises(FileNotFoundError):
        Panel(tmp_path / "none.mcap")


def test_the_command_shows_a_recording_and_says_where(tmp_path, capsys):
    events = taxel.Events([0, 200], [3, 4], [5, 5], [True, False], array=taxel.Array(8, 8))
    taxel.convert(events, tmp_path / "two.mcap")
    with pytest.raises(SystemExit) as ended:
        main(["view", str(tmp_path / "two.mcap"), "--no-open", "--seconds", "0.2", "--json"])
    assert ended.value.code in (0, None)
    assert json.loads(capsys.readouterr().out)["url"].startswith("http://127.0.0.1:")


def test_a_taxel_is_zeroed_for_all_and_the_next_recording_begins_with_it(live, tmp_path):
    with Panel(live, folder=tmp_path) as panel, Client(panel) as page, Client(panel) as other:
        assert page.until("zeroed")["taxels"] == []
        page.send(type="credit", n=1)
        assert page.ask("zero", taxels=[[3, 5]])["type"] == "refused"
        say(live, word(4000, 3, 5, 48), word(5000, 3, 5, 90))
        heard(live, 2)
        for wrong in ([], [[3]], [[3, -1]], "all", [[3, 5], [4, 5]], [[64, 5]]):
            assert page.ask("zero", taxels=wrong)["type"] == "refused"
        assert page.ask("zero", taxels=[[3, 5]])["type"] == "done"
        for one in (page, other):
            # It may have been told before the command was answered.
            while not (all_told := [m for m in one.said if m["type"] == "zeroed" and m["taxels"]]):
                one.until("zeroed")
            (told,) = all_told[-1]["taxels"]
            assert (told["taxel"], told["rest"], told["before"]) == ([3, 5], 90.0, None)
        # The picture's rest is the new one, and a lower value does not move it.
        say(live, word(6000, 3, 5, 80), word(7000, 3, 5, 95))
        heard(live, 4)
        page.send(type="credit", n=8)
        while not (rest := section(page.until("picture"), 5, "<u2")).size or rest[5 * 64 + 3] != 90:
            page.send(type="credit", n=1)
        assert page.ask("record", name="after")["type"] == "done"
        page.since_asked("recorder", state="recording")
        say(live, word(8000, 3, 5, 99))
        heard(live, 5)
        assert page.ask("stop")["type"] == "done"
        page.since_asked("recorder", state="idle")
        (kept,) = taxel.open(tmp_path / "after.mcap").zeroings
        assert (kept.x, kept.y, kept.rest) == (3, 5, 90.0)
        assert page.ask("open", name="after.mcap")["type"] == "done"
        opened = next(m for m in reversed(page.said) if not isinstance(m, bytes) and m["type"] == "opened")
        assert [z["taxel"] for z in opened["zeroed"]] == [[3, 5]]
