"""Files of recordings: locked while they are written, whole or not there, never lost without a word."""

from pathlib import Path

import pytest
from loopback import free_port
from shell import run

import taxel
from taxel.live import Live

from .boards import LOOPBACK, SMALL, play, presses, wait_for


def test_a_recording_to_which_nothing_came_is_not_kept(tmp_path: Path) -> None:
    port, file = free_port(), tmp_path / "walk.mcap"
    done = run("record", file, "--host", LOOPBACK, "--port", port, "--seconds", 0.2)
    assert done.returncode == 3
    assert done.stdout.startswith(f"nothing arrived at UDP {LOOPBACK}:{port} in ")
    assert "nothing lost" not in done.stdout
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("earlier", [False, True])
def test_a_second_recorder_does_not_take_the_file_of_a_running_one(tmp_path: Path, earlier: bool) -> None:
    file = tmp_path / "walk.mcap"
    if earlier:
        file.write_bytes(b"an earlier one")
    with Live(0, host=LOOPBACK, array=SMALL, record=file, overwrite=True) as first:
        sent = play(presses(2), first.address[1])
        done = run("record", file, "--host", LOOPBACK, "--port", free_port(), "--overwrite", "--seconds", 0.1)
        said = "is being recorded by another program; end that first, or name another file"
        assert (done.returncode, done.stderr) == (3, f"taxel: {file}: {said}\n")
        wait_for(first, sent + play(presses(2), first.address[1]))
    assert len(taxel.open(file).events) == 2 * len(presses(2))
