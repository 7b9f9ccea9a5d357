"""Addresses of boards on other computers, and what is said where nothing carries them."""

import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st

import taxel
from taxel.cli import main
from taxel.live import Live
from taxel_bridge import Address, Bridge, Remote

HOSTS = st.one_of(
    st.ip_addresses(v=4).map(str),
    st.ip_addresses(v=6).map(lambda address: f"[{address}]"),
    st.from_regex(r"[a-z][a-z0-9-]{0,20}(\.[a-z]{1,5}){0,2}", fullmatch=True),
)


@given(HOSTS, st.integers(1, 65_535), st.none() | st.from_regex(r"[A-Za-z0-9_.-]{1,64}", fullmatch=True))
def test_an_address_is_read_as_it_is_written(host, port, name):
    address = Address(host, port, name)
    assert Address.of(str(address)) == address
    assert Address.of(f"zenoh:{host}") == Address(host, 7447, None)


@pytest.mark.parametrize(
    "said",
    ["", "zenoh:", "udp:127.0.0.1", "127.0.0.1:7447", "zenoh:host:0", "zenoh:host:99999", "zenoh:host:7447/",
     "zenoh:a/b/c", "zenoh:host/*", "zenoh:ho st", "zenoh:tcp/host:7447", "zenoh:host:7447/a\n",
     "zenoh:[fe80::1%eth0]:7447"],
)  # fmt: skip
def test_what_is_no_address_is_refused_with_one_that_is(said):
    with pytest.raises(
        taxel.ProblemError, match=r"must be zenoh:HOST:PORT/NAME, for example zenoh:192\.168\.1\.5:7447/left"
    ):
        Address.of(said)


def test_without_the_wheel_one_line_says_how_to_get_it(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "taxel_zenoh", None)
    for command in (["live", "--panel", "--remote", "zenoh:127.0.0.1/left"], ["bridge", "--port", "0"]):
        with pytest.raises(SystemExit) as ended:
            main(command)
        assert ended.value.code == 3
        said = capsys.readouterr()
        assert said.err.count("\n") == 1
        assert "run make bridge in a checkout" in said.err


def test_what_only_a_remote_board_takes_is_refused_without_one(capsys):
    with pytest.raises(SystemExit) as ended:
        main(["live", "--panel", "--congestion", "drop"])
    assert ended.value.code == 2
    assert "give --remote ADDRESS" in capsys.readouterr().err
    with pytest.raises(taxel.ProblemError, match="congestion is 'wait': must be block or drop"):
        Remote("zenoh:127.0.0.1", congestion="wait")
    with (
        Live(0, host="127.0.0.1") as live,
        pytest.raises(taxel.ProblemError, match="listen is '7447': must be HOST:PORT"),
    ):
        Bridge(live, listen="7447")
    with Live(0, host="127.0.0.1") as live, pytest.raises(taxel.ProblemError, match="must be HOST:PORT"):
        Bridge(live, listen="127.0.0.1:99999")
