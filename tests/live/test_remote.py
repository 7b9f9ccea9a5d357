"""A board of another computer, as a package beside taxel brings it, without a network."""

import time
from pathlib import Path

import pytest

import taxel
from taxel.cli import main
from taxel.live import Live, RemoteBoard
from taxel.live.remote import ParcelFeed
from taxel.simulate import Silence, emulate

from .boards import LOOPBACK


class There(RemoteBoard):
    """A board whose parcels the test passes on."""

    def begin(self, feed: ParcelFeed) -> None:
        self.in_use, self.feed = True, feed


def test_parcels_alone_carry_a_board_and_a_spoilt_one_is_refused(tmp_path: Path) -> None:
    """The same as over a network, with a queue for one."""
    array = taxel.Array(32, 48, name="palm")
    near = Live(0, host=LOOPBACK, array=array, registers="2 kHz", record=tmp_path / "near.mcap")
    copies, board = near.copies(), There("there:1/left", near.about)
    far = Live(remote=board, record=tmp_path / "far.mcap")
    assert (far.place, far.array, far.about) == ("there:1/left", array, near.about)
    with pytest.raises(taxel.ProblemError, match="remote: is in use already; make another remote board"):
        Live(remote=board)
    # A smaller array drives fewer lines of a preset.
    assert (board.registers["lines"], board.registers["noise_floor"]) == (48, 10)
    now = time.time_ns()
    board.feed.begin_session()
    board.feed.compare(now, now, now, now)
    emulate("{}:{}".format(*near.address), [Silence(200.0)], tare_ms=20.0, wire=2)
    sent = near.stop().counters
    assert near.is_over
    kinds = set()
    while not copies.is_over():
        kind, data = copies.next(0.05) or ("nothing", b"")
        kinds.add(kind)
        if kind == "parcel":
            assert board.feed.take(data)
    assert "parcel" in kinds
    assert board.feed.take(b"no parcel")
    came = far.stop().counters
    assert came["decoded"] == sent["decoded"] > 0
    bridged = came["bridged"]
    assert (bridged["missing"], bridged["dropped"], bridged["refused"], bridged["ended"]) == (0, 0, 1, True)
    ours, theirs = (taxel.open(tmp_path / f"{name}.mcap").events for name in ("near", "far"))
    assert ours == theirs
    assert len(ours)


@pytest.mark.parametrize(
    ("address", "code", "said"),
    [
        ("pigeon:192.168.1.5", 3, "no installed package receives addresses that begin with pigeon:"),
        ("192.168.1.5", 2, "address '192.168.1.5': must be zenoh:HOST:PORT/NAME"),
    ],
)
def test_an_address_that_nothing_receives_is_refused_in_one_line(
    address: str, code: int, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["live", "--panel", "--remote", address])
    assert ended.value.code == code
    printed = capsys.readouterr().err
    assert printed.count("\n") == 1
    assert said in printed
