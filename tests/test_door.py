"""The boundary between Rust and Python: errors, panics, Ctrl-C, the GIL, and threads."""

import os
import signal
import threading
import time

import numpy as np
import pytest
from refusal import refused

import taxel
from taxel import _core


@pytest.mark.parametrize(
    ("what", "kind"),
    [
        ("format", taxel.FormatError),
        ("problem", taxel.ProblemError),
        ("device", taxel.DeviceError),
        ("scene", taxel.SceneError),
    ],
)
def test_each_kind_of_error_has_its_class(what, kind):
    with pytest.raises(kind) as caught:
        _core.test_hook(what)
    assert type(caught.value) is kind
    assert isinstance(caught.value, taxel.Error)


def test_a_panic_is_an_error_that_asks_for_a_report(capfd):
    with refused(taxel.Error) as caught:
        _core.test_hook("panic")
    assert type(caught.value) is taxel.Error
    capfd.readouterr()


def test_a_stopped_call_raises_keyboard_interrupt():
    with pytest.raises(KeyboardInterrupt):
        _core.test_hook("interrupted")


def test_another_thread_runs_while_a_call_waits():
    """The GIL is released: this thread sends the Ctrl-C that ends the main thread's wait, of a minute, promptly."""
    woken = []

    def interrupt():
        woken.append(True)
        os.kill(os.getpid(), signal.SIGINT)

    timer, begun = threading.Timer(0.2, interrupt), time.monotonic()
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        _core.test_hook("wait")
    assert time.monotonic() < begun + 30
    timer.join()
    assert woken


def test_what_progress_raises_ends_a_fit_that_keeps_its_best():
    """A fit stopped at its first round is not solved, which shows that it did not continue."""
    rng = np.random.default_rng(3)
    trains = taxel.SpikeTrains.from_lists([np.sort(rng.uniform(0, 2000, 12)) for _ in range(150)], stop=2000.0)
    targets = [np.arange(100.0, 1900.0, 45.0)]
    cone = taxel.learn.ConeX()
    told = []

    def progress(*said):
        told.append(said)
        raise LookupError("enough")

    with pytest.raises(LookupError, match="enough"):
        cone.fit([trains], targets, progress=progress)
    assert len(told) == 1
    assert cone.status_ == "stopped"
    assert taxel.learn.ConeX().fit([trains], targets).status_ != "stopped"
