"""Sound calls of `taxel.device`."""

from collections.abc import Callable
from typing import Any

from sound.things import Sound

#: A sound call of everything public that takes anything, by its full name.
SOUND: dict[str, Sound] = {}

#: How a call returns one of each type that taxel alone makes.
RESULTS: dict[str, Callable[[], Any]] = {}

#: What is not tried, and why.
LEFT_OUT: dict[str, str] = {
    "taxel.device.Cable": "needs a board; tried in tests/live/test_device.py",
    "taxel.device.Cable.command": "needs a board; tried in tests/live/test_device.py",
    "taxel.device.Cable.floor": "needs a board; tried in tests/live/test_device.py",
    "taxel.device.Cable.read": "needs a board; tried in tests/live/test_device.py",
    "taxel.device.Cable.reopen": "needs a board; tried in tests/live/test_device.py",
    "taxel.device.Device": "needs a board; tried in tests/live/test_device.py",
    "taxel.device.Device.apply": "needs a board; tried in tests/live/test_device.py",
    "taxel.device.Device.record": "needs a board; tried in tests/live/test_device.py",
    "taxel.device.Greeting": "a result",
    "taxel.device.Port": "a result",
}
