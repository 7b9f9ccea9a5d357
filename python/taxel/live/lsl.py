"""The lab streaming layer: its streams as sources of a recording, and detections as one of its streams.

Its library listens on every address of the machine, TCP and UDP, at port 16572 and above. taxel cannot change that, so
it loads the library only if a stream is named, and then warns.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from typing import Any

from taxel._base.arguments import text
from taxel._base.limits import VALUE
from taxel._base.messages import installing, warn
from taxel._core import Error, ProblemError, now_ns

#: How long a stream is searched for, and a sample waited for, s.
_LOOK_S, _WAIT_S = 3.0, 0.05


def _pylsl() -> Any:
    try:
        import pylsl  # noqa: PLC0415  an extra
    except ImportError:
        raise ImportError(f"pylsl is not installed: {installing('lsl')}") from None
    warn(
        "the lab streaming layer listens on all addresses of this machine, TCP and UDP, at port 16572 and above",
        stacklevel=3,
    )
    return pylsl


class LslInlet:
    """Receive a stream of numbers of the lab streaming layer.

    Parameters
    ----------
    name : str
        The stream's name.

    Attributes
    ----------
    columns : list of str
        First its time stamp, `t_s` (s of the sender's clock), then its channels, named by their labels if there are
        any.

    Raises
    ------
    ProblemError : no stream of that name within 3 s, or a stream of texts
    ImportError : pylsl is not installed (``pip install 'taxel[lsl]'``)
    """

    def __init__(self, name: str) -> None:
        lsl = _pylsl()
        streams = lsl.resolve_byprop("name", text("name", name), 1, _LOOK_S)
        if not streams:
            raise ProblemError(f"lsl:{name}: no stream of that name was found within {_LOOK_S:g} s")
        if streams[0].channel_format() == lsl.cf_string:
            raise ProblemError(f"lsl:{name}: the stream contains texts; must contain numbers")
        self.name = name
        # Labels arrive with the connection; the time stamps stay the sender's own.
        self._inlet = lsl.StreamInlet(streams[0], processing_flags=lsl.proc_none)
        try:
            labels = self._inlet.info(_LOOK_S).get_channel_labels() or []
        except Exception as error:  # its library's errors have no base of their own
            raise ProblemError(f"lsl:{name}: the stream does not name its channels ({error})") from None
        count = streams[0].channel_count()
        names = [str(label) for label in labels if label]
        plain = len(set(names)) == count and not any(set(name) & set(",:=") for name in names) and "t_s" not in names
        self.columns = ["t_s", *(names if plain else [f"channel_{k}" for k in range(count)])]
        self._ends = threading.Event()
        self._thread: threading.Thread | None = None

    def begin(self, receive: Callable[[list[float], int], object]) -> None:
        """Call `receive` with time stamp and values, and their arrival (ns since 1970), in a separate thread."""

        def run() -> None:
            while not self._ends.is_set():
                values, stamp = self._inlet.pull_sample(_WAIT_S)
                if values is None:
                    continue
                try:
                    # Infinity, and what does not fit 32 bits, is a missing value, and counted as one.
                    finite = [value if abs(value) <= VALUE else math.nan for value in map(float, values)]
                    receive([stamp, *finite], now_ns())
                except (Error, OSError):
                    # The recording has ended; its own end reports why.
                    return

        self._thread = threading.Thread(target=run, name="taxel-lsl", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Close the stream."""
        self._ends.set()
        if self._thread is not None:
            self._thread.join()
        self._inlet.close_stream()


class LslOutlet:
    """Send detections as a stream of markers of the lab streaming layer: the label of each, at the time of its event.

    Parameters
    ----------
    name : str
        The stream's name; its type is Markers.

    Raises
    ------
    ImportError : pylsl is not installed (``pip install 'taxel[lsl]'``)
    """

    def __init__(self, name: str) -> None:
        lsl = _pylsl()
        about = lsl.StreamInfo(text("name", name), "Markers", 1, lsl.IRREGULAR_RATE, lsl.cf_string, f"taxel {name}")
        self._clock, self._outlet = lsl.local_clock, lsl.StreamOutlet(about)

    def __call__(self, detection: Any) -> None:
        """Send a `taxel.Detection`."""
        ago_s = (now_ns() - detection.reported_ns) * 1e-9 + (detection.reported - detection.t) * 1e-6
        self._outlet.push_sample([detection.label], self._clock() - ago_s)
