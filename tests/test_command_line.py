"""Errors of the command line name the option that was typed, in one line; exit codes are those of the docs."""

import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer
from shell import call

import taxel
from taxel.cli import app
from taxel.cli._commands import OWN, plugins
from taxel.cli._opening import FileOptions
from taxel.live import send
from taxel.recording.text_options import TYPED, TextOptions
from taxel.wire.registers import QUOTED_PRESETS

DOCS = Path(__file__).parent.parent / "docs"

#: Words of parsers and of Python that no message to a user should contain.
FOREIGN = (
    r"invalid type|unable to parse|invalid value|expected|`|Traceback|_core|overwrite=|NoneType|Input should be|"
    r"taxel\.[A-Z]"
)


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a recording, labels and a readout that needs a tare."""
    monkeypatch.chdir(tmp_path)
    array = taxel.Array(4, 4, name="small")
    t = np.arange(0, 2_000_000, 1000)
    events = taxel.Events(t, t // 1000 % 4, t // 4000 % 4, t % 2000 == 0, array=array, intensity=40 + t // 1000 % 2)
    taxel.convert(events, "walk.npz")
    Path("labels.csv").write_text("label,t_us\ncontact,500000\n")
    readout = taxel.Readout(taxel.encode.ContactArea(), {"contact": (taxel.Neuron(tau=0.5), np.ones(10))})
    readout.save("touch.json")
    Path("there.json").write_text("{}")
    Path("there.mcap").write_bytes(b"")
    return tmp_path


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("record", "--array", "8", "a.mcap"), "--array is 8: must be rows x columns, for example 64x64"),
        (
            ("record", "--port", "70000", "a.mcap"),
            "--port is 70000: must be a whole number from 0 to 65535",
        ),
        (("record", "--port", "x", "a.mcap"), "--port is 'x': must be a whole number from 0 to 65535"),
        (("record", "--seconds", "x", "a.mcap"), "--seconds is 'x': must be a number"),
        (("record", "--port=", "a.mcap"), "--port is '': must be a whole number from 0 to 65535"),
        (("record", "--port"), "--port: needs a value; see taxel"),
        (("emulate", "--fault", "lost=2"), "--fault lost is 2: must be from 0 to 1"),
        (("emulate", "--flaw", "dead=1.5"), "--flaw dead is 1.5: must be from 0 to 1"),
        (("emulate", "--circuit", "gain=-1"), "--circuit gain is -1: must be 1 or more"),
        (("demo", "--scenes", "-3"), "--scenes is -3: must be a whole number from 1"),
        (("cut", "walk.npz", "-o", "b.npz", "--from", "40000000.5", "--to", "2"), "--from 40000000.5 --to 2: the part"),
        (("record", "--port", "0", "nowhere/a.mcap"), "nowhere: no such folder"),
        (("emulate", "--truth", "nowhere/x.csv"), "nowhere: no such folder"),
        (("emulate", "--speed", "2"), "--speed needs --replay"),
        (("emulate", "--noise-floor", "2"), "--noise-floor needs --pipe"),
        (("emulate", "--baud", "9600"), "--baud needs --line"),
        (("info", "nowhere/a.mcap"), "nowhere: no such folder"),
        (("info", "none.mcap"), "none.mcap: no such file or directory"),
        (
            ("info", "walk.npz", "--tare", "0,5"),
            "tare: 0,5: no such file; seconds are a number with a point, for example 0.5",
        ),
        (("record", "--compression", "x", "a.mcap"), '--compression is "x": must be none, lz4 or zstd'),
        (("record", "--host", "no such host", "a.mcap"), '--host is "no such host": must be an IP address or the name'),
        (("record", "--preset", "9 kHz", "a.mcap"), 'preset "9 kHz" is not known: must be one of "5.2 kHz"'),
        (("record", "there.mcap"), "there.mcap: exists already; give --overwrite, or another name"),
        (("record", "--trials", "3", "a.mcap"), "--trials needs --length"),
        (("record",), "FILE is missing; see taxel record --help"),
        (("convert", "walk.npz"), "TARGET is missing; see taxel convert --help"),
        (("cut", "walk.npz", "a.npz", "-o", "b.npz"), "OUT is given twice: a.npz and b.npz"),
        (
            ("live", "--readout", "a.json", "--readout=b.json"),
            "--readout is given twice: a.json and b.json; a command uses one readout: train one readout on the "
            "labels of both, or record the data and run taxel detect once with each",
        ),
        (("record", "a.mcap", "--bogus"), "No such option: --bogus"),
        (("bogus",), "No such command 'bogus'; see taxel --help"),
        (("trian",), "No such command 'trian'. Did you mean 'train'?; see taxel --help"),
        (
            ("encode", "walk.npz", "s.npz", "--encoder", "level_crossing", "--set", "levels=40"),
            "levels is 40: must be a list",
        ),
        (("encode", "walk.npz", "s.npz", "--encoder", "level_crossing"), "levels is missing"),
        (
            ("encode", "walk.npz", "s.npz", "--encoder", "fa1", "--set", "alpha=soon"),
            'alpha is "soon": must be a number',
        ),
        (
            ("encode", "walk.npz", "s.npz", "--encoder", "fa1", "--set", "alpha=[1]"),
            "alpha is [1]: must be a number",
        ),
        (
            ("encode", "walk.npz", "s.npz", "--encoder", "fa1", "--set", "wings=2"),
            'wings is not known: must be "alpha", "a", "b"',
        ),
        (
            ("encode", "walk.npz", "s.npz", "--encoder", "fa1", "--set", "decay=s"),
            'decay is "s": must be "sample" or "ms"',
        ),
        (
            ("encode", "walk.npz", "s.npz", "--encoder", "contact_area"),
            "contact area without a tare; give --tare SECONDS or FILE",
        ),
        (("encode", "walk.npz", "nowhere/s.npz", "--encoder", "fa1"), "nowhere: no such folder"),
        (("detect", "walk.npz", "--readout", "touch.json", "--tare", "0.1", "--frame-us", "-5"), "--frame-us is -5"),
        (
            ("live", "--readout", "touch.json", "--tare", "5000"),
            "--tare 5000: must be seconds from 1e-6 to 3600, or a file",
        ),
        (("live", "--readout", "touch.json", "--save-tare", "a.json"), "--save-tare needs a fresh tare"),
        (("train", "walk.npz", "--labels", "labels.csv", "-o", "nowhere/x.json"), "nowhere: no such folder"),
        (
            ("train", "walk.npz", "--labels", "labels.csv", "-o", "there.json"),
            "there.json: exists already; give --overwrite",
        ),
        (("demo", "--noise", "0.1"), "--noise is 0.1 s: must be from 0.5 to 86400"),
        (("study", "fig6.1", "--set", "kappa"), "--set kappa: must be KEY=VALUE"),
    ],
)
def test_an_error_names_what_was_typed(here: Path, capsys, arguments: tuple[str, ...], said: str) -> None:
    before = sorted(here.iterdir())
    code, out, error = call(capsys, *arguments)
    assert (code, out) == (2, "")
    assert said in error
    assert error.count("\n") == 1
    assert not re.search(FOREIGN, error), error
    assert sorted(here.iterdir()) == before, "nothing is left behind"


@pytest.mark.usefixtures("here")
def test_an_existing_file_is_not_replaced_by_a_result(capsys) -> None:
    call(capsys, "train", "walk.npz", "--labels", "labels.csv", "-o", "there.json")
    assert Path("there.json").read_text() == "{}"


@pytest.mark.usefixtures("here")
def test_o_says_where_output_goes_too(capsys) -> None:
    for where in (("a.npz",), ("-o", "b.npz"), ("--out", "c.npz")):
        assert call(capsys, "convert", "walk.npz", *where)[0] == 0
    assert Path("a.npz").read_bytes() == Path("b.npz").read_bytes() == Path("c.npz").read_bytes()
    assert call(capsys, "cut", "-o", "part.npz", "walk.npz", "--rows", "0:2")[0] == 0
    assert taxel.open("part.npz").array.rows == 2


def test_exit_codes_are_those_of_the_docs() -> None:
    table = (DOCS / "command-line.md").read_text()
    assert set(re.findall(r"^\| (\d+) \|", table, re.MULTILINE)) == {"0", "1", "2", "3", "130"}


def test_localhost_is_the_same_address_for_sender_and_receiver() -> None:
    with taxel.live.Live(0, host="localhost") as live:
        assert live.address[0] == "127.0.0.1"
        sent = send([b"12345"], "localhost", live.address[1], seconds=0.01)
    assert live.stop().counters["capture"]["datagrams"] == sent["datagrams"]


def test_a_datagram_that_is_too_large_for_udp_is_named_in_the_error() -> None:
    with pytest.raises(OSError, match="a datagram of 70000 bytes: UDP carries at most 65507"):
        send([bytes(70_000)], port=9, seconds=0.01)


@pytest.mark.parametrize("segment", [True, False])
def test_a_datagram_larger_than_the_paths_mtu_is_named_in_the_error(segment: bool) -> None:
    """In a network namespace whose loopback has an MTU of 1000 bytes."""
    script = (
        "import socket, taxel.live as live\n"
        "with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:\n"
        f"    live.send([bytes(1400)] * 8, port=9, each=8, seconds=0.01, segment={segment})\n"
    )
    inside = ["sh", "-c", 'ip link set lo mtu 1000 up && exec "$0" -c "$1"', sys.executable, script]
    try:
        done = subprocess.run(["unshare", "-rn", *inside], capture_output=True, text=True, check=False, timeout=60)
    except FileNotFoundError:
        pytest.skip("needs unshare")
    if "unshare" in done.stderr or "ip:" in done.stderr or "RTNETLINK" in done.stderr:
        pytest.skip(f"needs a network of its own: {done.stderr.strip()}")
    if not segment:
        # The kernel cuts a single one into packets: it arrives.
        assert done.returncode == 0, done.stderr
    else:
        assert "a datagram of 1400 bytes, and 28 of headers, is larger than the path's MTU, 1000" in done.stderr


@pytest.mark.parametrize("after_s", [0.0, 0.1, 0.3, 1.0])
def test_ctrl_c_while_it_starts_ends_quietly(after_s: float) -> None:
    program = Path(sys.executable).with_name("taxel")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        link.bind(("127.0.0.1", 0))
        port = str(link.getsockname()[1])
    arguments = [program, "emulate", "--port", port, "--scenes", "3", "--json"]
    with subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        # After Python itself has started: the process is importing taxel now.
        until = time.monotonic() + 60
        while "numpy" not in _maps(process.pid):
            assert time.monotonic() < until
            time.sleep(0.005)
        time.sleep(after_s)
        os.kill(process.pid, signal.SIGINT)
        out, error = process.communicate(timeout=60)
    assert (process.returncode, out, error) == (130, "", "")


def _maps(pid: int) -> str:
    try:
        return Path(f"/proc/{pid}/maps").read_text()
    except OSError:
        return ""


def test_the_help_has_a_whole_line_for_each_command_in_the_order_of_the_work(capsys) -> None:
    code, out, _ = call(capsys, "--help")
    listed, _, epilog = out.partition("Commands:\n")[2].partition("\n\n")
    assert "Begin with: taxel demo" in epilog
    assert "docs/start.md" in epilog
    lines = dict(line.split(maxsplit=1) for line in listed.splitlines())
    assert code == 0
    assert {*lines} == {*OWN, *plugins()}
    assert {name: text for name, text in lines.items() if len(text) > 60 or not text.endswith(".")} == {}
    order = [*lines]
    way = ("record", "info", "train", "detect", "bench")
    assert sorted(way, key=order.index) == [*way]
    assert "..." not in call(capsys, "device", "--help")[1].partition("Commands:")[2]


PRINTS_COMMANDS = """
import sys
from taxel.cli import main
try:
    main(sys.argv[1:])
finally:
    loaded = {name.rpartition(".")[2] for name in sys.modules if name.startswith("taxel.cli.")}
    print(*sorted(name for name in loaded if not name.startswith("_") and name != "console"), file=sys.stderr)
    print(*sorted({"taxel_studies", "taxel_benchmarks", "scipy", "matplotlib"} & sys.modules.keys()), file=sys.stderr)
"""


@pytest.mark.parametrize(
    ("arguments", "loaded"),
    [
        (["--help"], ""),
        (["--version"], ""),
        (["nonsense"], ""),
        (["trian"], ""),
        (["merge", "--help"], "merge"),
        (["device", "show", "--help"], "device"),
    ],
)
def test_a_command_is_imported_only_when_it_is_used(arguments: list[str], loaded: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", PRINTS_COMMANDS, *arguments], capture_output=True, text=True, check=False
    )
    assert done.stderr.splitlines()[-2:] == [loaded, ""], done.stderr


@pytest.fixture
def stranger(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The module of another distribution, which brings two commands and one that is named as ours."""
    about = tmp_path / "stranger-2.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: stranger\nVersion: 2.0\nSummary: Greet a stranger.\n")
    (about / "entry_points.txt").write_text(
        "[taxel.commands]\nwave = stranger:app\nnod = stranger:absent\ntrain = stranger:app\n"
    )
    module = tmp_path / "stranger.py"
    module.write_text("import typer\napp = typer.Typer()\n@app.command()\ndef greet():\n    print('hello')\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "stranger", raising=False)
    return module


def test_a_command_of_another_distribution_is_listed_and_runs(stranger: Path, capsys) -> None:
    listed = call(capsys, "--help")[1]
    assert re.search(r"\n  wave +Greet a stranger\.\n", listed)
    assert listed.count("\n  train ") == 1
    assert "stranger" not in sys.modules
    assert call(capsys, "wave") == (0, "hello\n", "")
    assert "Usage: taxel wave" in call(capsys, "wave", "--help")[1]
    assert "taxel train a" in call(capsys, "train", "--help")[1], "ours"


@pytest.mark.parametrize(
    ("name", "source", "said"),
    [
        ("nod", None, "stranger:absent of stranger 2.0 could not be loaded: AttributeError: "),
        (
            "wave",
            "import nowhere_at_all",
            "stranger:app of stranger 2.0 could not be loaded: ModuleNotFoundError: No",
        ),
        ("wave", "app = 3", "stranger:app of stranger 2.0 could not be loaded: AttributeError: "),
        ("wave", "raise RuntimeError('a\\nb')", "stranger:app of stranger 2.0 could not be loaded: RuntimeError: a"),
    ],
)
def test_a_command_of_another_distribution_that_is_broken_is_one_error_and_breaks_no_other(
    stranger: Path, capsys, name: str, source: str | None, said: str
) -> None:
    if source is not None:
        stranger.write_text(source)
    code, out, error = call(capsys, name)
    assert (code, out) == (2, "")
    assert error.startswith(f"taxel: taxel {name}: the command {said}")
    assert error.count("\n") == 1
    assert call(capsys, "--help")[0] == call(capsys, "merge", "--help")[0] == 0


def test_labels_of_a_recording_that_is_not_there_are_left_out_and_a_misspelt_one_is_said(here: Path, capsys) -> None:
    taxel.detect.PlainRule("area", 3).save("rule.json")
    command = ("detect", "walk.npz", "--readout", "rule.json", "--tare", "0.1", "--truth", "labels.csv")
    for names, said in (
        (("walk", "walk"), None),
        (
            ("walk", "wlak", "wlak"),
            "left out 2 events whose recording is named wlak; the recordings are named walk.npz",
        ),
        (
            ("walk", "Walk", "w-alk.npz"),
            "left out 2 events whose recording is named Walk, w-alk.npz; the recordings are named walk.npz",
        ),
        (("walk", *(f"walk{k}" for k in range(7))), None),
    ):
        Path("labels.csv").write_text("recording,label,t_us\n" + "".join(f"{name},contact,500000\n" for name in names))
        code, _, error = call(capsys, *command)
        assert code == 0
        assert error.count("left out") == (said is not None), error
        assert said is None or said in error


def test_the_file_of_the_rule_of_a_label_keeps_its_letters() -> None:
    from taxel.cli.train import _of_label

    assert _of_label(Path("a/rule.json"), "Zehenablösung links/2").name == "rule.Zehenablösung_links_2.json"


def test_each_option_of_opening_is_typed_by_its_name() -> None:
    typed = {TYPED.get(option.name, option.name) for option in fields(TextOptions)}
    assert {option.name for option in fields(FileOptions)} == typed


def _commands(group: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Yield each command with the words that name it."""
    context = typer.Context(group)
    for name in group.list_commands(context):
        _, command, _ = group.resolve_command(context, [name])
        if hasattr(command, "list_commands"):
            yield from _commands(command, (*path, name))
        else:
            yield (*path, name), command


def test_a_preset_is_described_by_all_names() -> None:
    options = [
        option
        for _, command in _commands(typer.main.get_command(app))
        for option in command.params
        if "--preset" in option.opts
    ]
    assert len(options) >= 3
    assert all(QUOTED_PRESETS in option.help for option in options)


def test_an_option_of_one_value_is_refused_where_it_is_given_twice() -> None:
    options = [
        (words, command, option)
        for words, command in _commands(typer.main.get_command(app))
        for option in command.params
        if option.param_type_name == "option" and not option.is_flag and not option.multiple
    ]
    assert len(options) > 100
    for words, command, option in options:
        for typed in option.opts:
            with pytest.raises(taxel.ProblemError) as refused:
                command.make_context(words[-1], [typed, "a", typed, "b"])
            said = str(refused.value).partition(";")[0]
            assert said == f"{max(option.opts, key=len)} is given twice: a and b", (words, typed)
