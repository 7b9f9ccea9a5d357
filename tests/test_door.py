"""The one door between Rust and Python: errors, panics, Ctrl-C, the GIL."""

import os
import signal
import subprocess
import sys
import threading
import time

import pytest

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
    with pytest.raises(kind, match="said by knock") as caught:
        _core.knock(what)
    assert type(caught.value) is kind
    assert isinstance(caught.value, taxel.Error)


def test_a_panic_is_an_error_that_asks_for_a_report(capfd):
    with pytest.raises(taxel.Error, match="a bug in taxel, please report it: said by knock") as caught:
        _core.knock("panic")
    assert type(caught.value) is taxel.Error
    capfd.readouterr()


def test_a_call_that_was_told_to_stop_raises_keyboard_interrupt():
    with pytest.raises(KeyboardInterrupt):
        _core.knock("interrupted")


def test_ctrl_c_ends_a_long_call_promptly():
    program = "import sys; from taxel import _core; print('in', flush=True); _core.knock('wait')"
    with subprocess.Popen(
        [sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as child:
        assert child.stdout.readline() == "in\n"
        time.sleep(0.3)
        child.send_signal(signal.SIGINT)
        _, said = child.communicate(timeout=30)  # the knock alone would wait a minute
    assert "KeyboardInterrupt" in said


def test_another_thread_runs_while_a_call_waits():
    """The GIL is let go: this thread wakes the signal that ends the wait of the main thread."""
    woken = []

    def interrupt():
        woken.append(True)
        os.kill(os.getpid(), signal.SIGINT)

    timer = threading.Timer(0.2, interrupt)
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        _core.knock("wait")
    timer.join()
    assert woken
