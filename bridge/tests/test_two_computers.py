"""Two computers: two network namespaces with a cable between them. Needs root and iproute2."""

import contextlib
import json
import os
import shutil
import subprocess
import time

import pytest
from processes import Process

import taxel

BOARD, FAR = "10.77.0.1", "10.77.0.2"
BOARD_6, FAR_6 = "fd77::1", "fd77::2"

LISTENS = """
import json, sys, time
from taxel.live import Live
from taxel_bridge import Remote

def say(**what):
    print(json.dumps(what | {"at": time.monotonic()}), flush=True)

with Remote(sys.argv[1], timeout=60.0) as remote, Live(remote=remote, record=sys.argv[2]) as far:
    say(began=True)
    before = None
    while True:
        bridged = far.counters["bridged"]
        now = {name: bridged[name] for name in ("received", "ended", "restarts")}
        if now != before:
            say(**now)
        if now["ended"]:
            break
        before = now
        time.sleep(0.01)
    say(verdict=far.stop().verdict, counters=far.counters)
"""


def ip(*arguments, check=True):
    return subprocess.run(["ip", *arguments], check=check, capture_output=True, text=True)


@pytest.fixture
def two():
    """Make two computers and a cable between them; return how each is called."""
    pytest.importorskip("taxel_zenoh", reason="the wheel taxel_zenoh is not built: make bridge")
    if shutil.which("ip") is None:
        pytest.skip("no iproute2 here")
    near, far = names = [f"taxel-{os.getpid()}-{end}" for end in ("near", "far")]
    try:
        for name in names:
            if (made := ip("netns", "add", name, check=False)).returncode:
                pytest.skip(f"no network namespaces here: {made.stderr.strip()}")
        if ip(
            "link", "add", "cable", "netns", near, "type", "veth", "peer", "name", "cable", "netns", far, check=False
        ).returncode:
            pytest.skip("no virtual cable here")
        for name, *addresses in ((near, BOARD, BOARD_6), (far, FAR, FAR_6)):
            ip("-n", name, "addr", "add", f"{addresses[0]}/24", "dev", "cable")
            # On a machine without IPv6 its tests are skipped.
            ip("-n", name, "-6", "addr", "add", f"{addresses[1]}/64", "dev", "cable", "nodad", check=False)
            for link in ("lo", "cable"):
                ip("-n", name, "link", "set", link, "up")
        yield near, far
    finally:
        for name in names:
            ip("netns", "del", name, check=False)


class On(Process):
    """A process on one of the computers."""

    def __init__(self, computer, *arguments):
        super().__init__(*arguments, before=("ip", "netns", "exec", computer))

    def tells(self, **what):
        """Return the first line of JSON that has all of this."""
        for line in self.process.stdout:
            told = json.loads(line)
            if what.items() <= told.items():
                return told
        raise AssertionError(f"ended before it told {what}: {self.process.stderr.read()}")

    def last(self):
        """Return its last line of JSON."""
        printed, said = self.process.communicate(timeout=120)
        assert self.process.returncode == 0, said
        return json.loads(printed.splitlines()[-1])


def taxel_on(computer, *arguments):
    return On(computer, "-m", "taxel", *arguments)


def all_came(tmp_path, near, far, place):
    """Play on the one computer, record on both."""
    with taxel_on(near, "bridge", "--name", "left", "--listen", place, "--record", tmp_path / "near.mcap") as bridge:
        bridge.says("listening on UDP")
        with On(far, "-c", LISTENS, f"zenoh:{place}/left", tmp_path / "far.mcap") as listener:
            listener.tells(received=True)
            with taxel_on(
                near, "emulate", "--wire", "2", "--preset", "2 kHz", "--seed", "1", "--scenes", "1", "--json"
            ) as board:
                sent = board.last()
            time.sleep(0.5)
            bridge.end()
            said = listener.last()
    assert said["verdict"].startswith("nothing lost")
    assert said["counters"]["decoded"] == sent["datagrams"]
    events = taxel.open(tmp_path / "near.mcap").events
    assert len(events)
    assert taxel.open(tmp_path / "far.mcap").events == events


@pytest.mark.slow
@pytest.mark.parametrize("mtu", [1500, 1280])
@pytest.mark.parametrize("host", [BOARD, f"[{BOARD_6}]"])
def test_every_event_comes_to_the_other_computer(tmp_path, two, host, mtu):
    near, far = two
    if host.startswith("[") and BOARD_6 not in ip("-n", near, "-6", "addr").stdout:
        pytest.skip("no IPv6 here")
    for name in two:
        ip("-n", name, "link", "set", "cable", "mtu", str(mtu))
    all_came(tmp_path, near, far, f"{host}:7447")


@pytest.mark.slow
def test_a_cable_that_is_pulled_for_5_s_is_noticed_and_what_was_lost_meanwhile_counted(tmp_path, two):
    near, far = two
    with contextlib.ExitStack() as all_of_it:
        begin = all_of_it.enter_context
        bridge = begin(taxel_on(near, "bridge", "--name", "left", "--listen", f"{BOARD}:7447", "--json"))
        time.sleep(3.0)
        listener = begin(On(far, "-c", LISTENS, f"zenoh:{BOARD}:7447/left", tmp_path / "far.mcap"))
        listener.tells(received=True)
        board = begin(taxel_on(near, "emulate", "--wire", "2", "--preset", "2 kHz", "--seed", "1"))
        board.says("seed 1")
        time.sleep(3.0)
        pulled = time.monotonic()
        ip("-n", far, "link", "set", "cable", "down")
        assert listener.tells(received=False)["at"] - pulled < 2.0
        time.sleep(5.0)
        ip("-n", far, "link", "set", "cable", "up")
        plugged = time.monotonic()
        assert listener.tells(received=True)["at"] - plugged < 30.0
        time.sleep(2.0)
        board.end()
        time.sleep(0.5)
        printed, _ = bridge.end()
        said = listener.last()
    received = json.loads(printed)["counters"]["capture"]["datagrams"]
    bridged = said["counters"]["bridged"]
    assert said["counters"]["decoded"] + bridged["missing"] + bridged["dropped"] == received
    assert bridged["missing"] > 0
    assert (bridged["silences"], bridged["restarts"]) == (1, 0)
    assert "LOST" in said["verdict"]


@pytest.mark.slow
def test_what_keeps_two_computers_apart_is_said_in_one_line(tmp_path, two):
    near, far = two
    record = ["record", tmp_path / "no.mcap", "--remote"]
    for computer, line, said in (
        (
            far,
            [*record, f"zenoh:{BOARD}/left"],
            "the computer answers, but no program listens at this port; start taxel bridge",
        ),
        (far, [*record, "zenoh:10.77.0.9/left"], "is the address right"),
        (far, [*record, "zenoh:10.99.0.1/left"], "network is unreachable; is the address right"),
        (
            near,
            ["bridge", "--listen", f"{FAR}:7447"],
            f"listen {FAR}:7447: cannot assign requested address; it must be",
        ),
    ):
        with taxel_on(computer, *line) as refused:
            printed, told = refused.process.communicate(timeout=120)
        assert refused.process.returncode == 3
        assert (printed, told.count("\n")) == ("", 1)
        assert said in told
    assert not (tmp_path / "no.mcap").exists()
