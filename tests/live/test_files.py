"""Files of recordings: locked while they are written, whole or not there, never lost without a word."""

import signal
import time
from pathlib import Path

import pytest
from loopback import free_port
from shell import run

import taxel
from taxel.live import Live

from .boards import LOOPBACK, SMALL, listening, play, presses, recording, wait_for


def test_a_full_disk_is_one_clear_error(tmp_path: Path, full_device: Path) -> None:
    (tmp_path / "full.mcap").symlink_to(full_device)

    def record() -> None:
        with Live(0, host=LOOPBACK, array=SMALL, record=tmp_path / "full.mcap", overwrite=True) as live:
            play(presses(300), live.address[1])
            list(live)

    with pytest.raises(OSError, match="No space left on device"):
        record()


def test_a_recording_to_which_nothing_came_is_not_kept(tmp_path: Path) -> None:
    port, file = free_port(), tmp_path / "walk.mcap"
    done = run("record", file, "--host", LOOPBACK, "--port", port, "--seconds", 0.2)
    assert done.returncode == 3
    assert done.stdout.startswith(f"nothing arrived at UDP {LOOPBACK}:{port} in ")
    assert "nothing lost" not in done.stdout
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["walk.lsa", "walk.csv", "walk", "walk.MCAP"])
def test_a_recording_is_an_mcap_file(tmp_path: Path, name: str) -> None:
    with pytest.raises(taxel.ProblemError, match=r"must end with \.mcap"):
        Live(0, host=LOOPBACK, array=SMALL, record=tmp_path / name)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("earlier", [False, True])
def test_a_second_recorder_does_not_take_the_file_of_a_running_one(tmp_path: Path, earlier: bool) -> None:
    port, file = free_port(), tmp_path / "walk.mcap"
    if earlier:
        file.write_bytes(b"an earlier one")
    with recording(file, port, "--overwrite") as first:
        listening(first)
        play(presses(2), port)
        done = run("record", file, "--host", LOOPBACK, "--port", free_port(), "--overwrite", "--seconds", 0.1)
        said = "is being recorded by another program; end that first, or name another file"
        assert (done.returncode, done.stderr) == (3, f"taxel: {file}: {said}\n")
        play(presses(2), port)
        time.sleep(0.3)
        first.send_signal(signal.SIGINT)
        out, _ = first.communicate(timeout=60)
    assert first.returncode == 0, out
    assert len(taxel.open(file).events) == 2 * len(presses(2))


def test_a_lock_dies_with_its_process(tmp_path: Path) -> None:
    port, file = free_port(), tmp_path / "walk.mcap"
    with recording(file, port) as first:
        listening(first)
        play(presses(2), port)
        first.kill()
    with Live(0, host=LOOPBACK, array=SMALL, record=file, overwrite=True) as live:
        wait_for(live, play(presses(1), live.address[1]))
    assert len(taxel.open(file).events) == len(presses(1))


def test_two_recordings_of_one_program_do_not_share_a_file(tmp_path: Path) -> None:
    file = tmp_path / "walk.mcap"
    with (
        Live(0, host=LOOPBACK, array=SMALL, record_later=True) as one,
        Live(0, host=LOOPBACK, record_later=True) as two,
    ):
        one.record(file)
        with pytest.raises(OSError, match="is being recorded by another program"):
            two.record(file, overwrite=True)
        wait_for(one, play(presses(1), one.address[1]))
        assert one.end_recording().path == file
        assert len(taxel.open(file).events) == len(presses(1))
        two.record(file, overwrite=True)
        assert two.end_recording().path is None
    assert not file.exists(), "nothing came to the recording that replaced it"


def test_what_was_noted_is_kept_though_nothing_came(tmp_path: Path) -> None:
    with Live(0, host=LOOPBACK, array=SMALL, record=tmp_path / "noted.mcap") as live:
        live.note("the cable is out")
    assert live.stop().path == tmp_path / "noted.mcap"
    assert [note.text for note in taxel.open(tmp_path / "noted.mcap").notes] == ["the cable is out"]
