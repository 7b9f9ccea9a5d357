"""A board of another computer: two ends of the bridge on loopback, without a search by multicast."""

import signal
import socket
import subprocess
import sys
import time

import pytest
from loopback import free_port
from tests.live.boards import LOOPBACK, SMALL, datagrams, presses, wait_for

import taxel
from taxel import DeviceError, ProblemError
from taxel.cli import main
from taxel.live import Live
from taxel.simulate import Silence, emulate
from taxel_bridge import Bridge

#: Timeout for an event on a busy machine, s.
SOON = 60.0


@pytest.fixture
def place():
    return f"tcp/{LOOPBACK}:{free_port(socket.SOCK_STREAM)}"


class End:
    """A process of ``taxel bridge``."""

    def __init__(self, *arguments):
        words = [sys.executable, "-m", "taxel", "bridge", *map(str, arguments)]
        self.process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.said = []

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.kill()
        self.process.communicate()

    def says(self, words):
        """Wait until a line holds words."""
        for line in self.process.stderr:
            self.said.append(line)
            if words in line:
                return
        raise AssertionError(self.said)

    def end(self):
        """Press Ctrl-C; return its code, how long it took (s), and what it printed."""
        begun = time.monotonic()
        self.process.send_signal(signal.SIGINT)
        printed, _ = self.process.communicate(timeout=SOON)
        return self.process.returncode, time.monotonic() - begun, printed


class Way:
    """Both ends, from a port of this computer to another."""

    def __init__(self, place, to):
        self.port = free_port(socket.SOCK_DGRAM)
        self.publisher = End("publish", "--host", LOOPBACK, "--port", self.port, "--listen", place)
        self.publisher.says("listening on UDP")
        self.receiver = End("receive", "--port", to, "--connect", place)
        self.receiver.says("connected")
        self.publisher.says("connected")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.publisher.__exit__()
        self.receiver.__exit__()

    def carry(self, board):
        """Send a board's datagrams, a ms each."""
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
            for one in board:
                link.sendto(one, (LOOPBACK, self.port))
                time.sleep(0.001)


def far(place, board, array, record):
    """Carry a board's datagrams over a bridge to a recording; return its last counters, and what the receiver said."""
    with Live(0, host=LOOPBACK, array=array, record=record) as live, Way(place, live.address[1]) as way:
        way.carry(board)
        wait_for(live, len(board))
        codes = [way.receiver.end(), way.publisher.end()]
    assert [code for code, _, _ in codes] == [0, 0]
    assert max(took for _, took, _ in codes) < 5.0
    assert all(f"{len(board):,} datagrams" in printed for _, _, printed in codes)
    return live.stop().counters, way.receiver.said


@pytest.fixture(scope="module")
def board(tmp_path_factory):
    """What a board of version 2 sends, and the events that are in it."""
    path = tmp_path_factory.mktemp("board") / "near.mcap"
    array = taxel.Array(32, 48, name="palm")
    with Live(0, host=LOOPBACK, array=array, record=path) as live:
        emulate("{}:{}".format(*live.address), [Silence(200.0)], tare_ms=20.0, wire=2)
    recording = taxel.open(path)
    kept = recording.datagrams()
    return array, [kept[k] for k in range(len(kept))], recording.events


def test_a_recording_of_the_other_computer_holds_the_same_events(tmp_path, place, board):
    array, sent, events = board
    counters, said = far(place, sent, array, tmp_path / "far.mcap")
    assert taxel.open(tmp_path / "far.mcap").events == events
    assert len(events)
    assert counters["wire_v2"]["missing"] == 0
    assert len(said) == 2  # of version 2 no line says that losses are not counted


def test_what_the_way_lost_is_counted_by_the_numbers_of_version_2(tmp_path, place, board):
    array, sent, _ = board
    gone = len(sent) // 2
    counters, _ = far(place, [*sent[:gone], *sent[gone + 3 :]], array, tmp_path / "far.mcap")
    assert counters["wire_v2"]["missing"] == 3


def test_of_version_1_one_line_says_that_losses_are_not_counted(tmp_path, place):
    events = presses(3)
    with Live(0, host=LOOPBACK, array=SMALL, record=tmp_path / "far.mcap") as live, Way(place, live.address[1]) as way:
        way.carry(datagrams(events))
        way.receiver.says("losses on the way are not counted")
        wait_for(live, len(datagrams(events)))
    assert taxel.open(tmp_path / "far.mcap").events == events


@pytest.mark.parametrize("how", ["SIGKILL", "SIGSTOP"])
def test_a_receiver_that_is_killed_or_hangs_is_said_and_holds_nobody_up(place, how):
    if not hasattr(signal, how):
        pytest.skip("no such signal here")
    with Way(place, free_port(socket.SOCK_DGRAM)) as way:
        way.receiver.process.send_signal(getattr(signal, how))
        way.carry([bytes(1400)] * 4000)
        way.publisher.says("LOST")
        way.publisher.end()


def test_a_publisher_that_comes_back_is_received_again(place):
    with Live(0, host=LOOPBACK, array=SMALL) as live, Way(place, live.address[1]) as way:
        way.publisher.process.kill()
        way.receiver.says("LOST")
        with End("publish", "--host", LOOPBACK, "--port", way.port, "--listen", place) as again:
            again.says("a receiver is connected")
            way.receiver.says("connected")
            way.carry(datagrams(presses(1)))
            wait_for(live, len(datagrams(presses(1))))


@pytest.mark.parametrize(
    ("arguments", "kind"),
    [
        ({"name": "no name"}, ProblemError),
        ({"name": "a", "connect": ["192.168.1.5"]}, ProblemError),
        ({"name": "a", "listen": ["tcp/192.0.2.1:7447"]}, DeviceError),
    ],
)
def test_what_cannot_be_is_refused(arguments, kind):
    with pytest.raises(kind):
        Bridge(say=print, **arguments)


@pytest.mark.parametrize("end", ["publish", "receive"])
def test_an_end_that_cannot_begin_says_so_in_one_line(end, place, capsys):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind((LOOPBACK, 0))
        port = ["--host", LOOPBACK, "--port", str(taken.getsockname()[1]), "--listen", place]
        with pytest.raises(SystemExit) as ended:
            main(["bridge", end, *(port if end == "publish" else ["--connect", place])])
    assert ended.value.code == 3
    assert capsys.readouterr().err.count("\n") == 1
