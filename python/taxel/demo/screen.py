"""The terminal display while the demo runs: pressure picture, counters, detections."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Group
from rich.live import Live as Drawing
from rich.panel import Panel
from rich.progress_bar import ProgressBar
from rich.style import Style
from rich.table import Table
from rich.text import Text

from taxel.demo.judging import LABELS
from taxel.detections import Detection
from taxel.live import delays
from taxel.simulate import Contact
from taxel.spikes import to_ms

__all__ = ["Screen"]


#: The picture's panel, and what else must find room beside and below it, characters.
_PICTURE_WIDTH, _PICTURE_HEIGHT, _LEAST_WIDTH, _LEAST_HEIGHT = 36, 18, 40, 5


class Screen:
    """The display: pressure picture, counters, detections."""

    def __init__(self, drawing: Drawing, contacts: list[Contact], seconds: float) -> None:
        self._drawing = drawing
        self._seconds = seconds
        self._true = {
            "contact": np.array([c.start_us for c in contacts]),
            "lift": np.array([c.stop_us for c in contacts]),
        }
        self._kinds = [c.kind for c in contacts]
        self._before: tuple[float, int] = (0.0, 0)
        self._rate = 0.0

    def draw(
        self, counters: dict[str, Any], frame: NDArray[np.uint16] | NDArray[np.float32], detections: list[Detection]
    ) -> None:
        """Draw counters, frame and detections so far."""
        now = (counters["board_us"] or 0) * 1e-6
        then, events = self._before
        if now > then:
            self._rate = (counters["events"] - events) / (now - then)
            self._before = (now, counters["events"])
        capture = counters["capture"]
        by_kernel = capture["dropped_by_kernel"]
        known = (by_kernel or 0) + capture["dropped_by_queue"] + counters["events_dropped"]
        lost = f"{known} or more" if by_kernel is None else known
        rows = Table.grid(padding=(0, 2))
        for name, value in (
            ("events/s", f"{self._rate:,.0f}"),
            ("on the wire", f"{self._rate * 80 / 1e3:,.0f} kbit/s"),
            ("as frames", "213,333 kbit/s"),
            ("events", f"{counters['events']:,}"),
            ("datagrams", f"{capture['datagrams']:,}, lost {lost}"),
            ("arrived to decoded", delays(counters["decode_latency"])),
            ("known to detected", delays(counters["report_latency"])),
            *((label, str(sum(detection.label == label for detection in detections))) for label in LABELS),
        ):
            rows.add_row(Text(name, style="dim"), value)
        state = "taring" if counters["taring"] else f"{min(now, self._seconds):5.1f} of {self._seconds:.1f} s"
        width, height = self._drawing.console.size
        if width < _PICTURE_WIDTH + _LEAST_WIDTH or height < _PICTURE_HEIGHT + _LEAST_HEIGHT:
            # No room for the picture: counters and detections alone.
            pictured, panel_height = [], len(rows.rows) + 2
        else:
            pictured, panel_height = [Panel(_blocks(frame), title="pressure", width=_PICTURE_WIDTH)], _PICTURE_HEIGHT
        above = Table.grid()
        above.add_row(*pictured, Panel(rows, title=state, height=panel_height))
        self._drawing.update(
            Group(
                above,
                ProgressBar(total=self._seconds, completed=min(now, self._seconds), width=min(80, width)),
                *self._newest(detections, width, height - panel_height - 2),
            )
        )

    def _newest(self, detections: list[Detection], width: int, rows: int) -> list[Text]:
        """Return the last lines that find room, the newest last; a long one takes more than one row."""
        lines: list[Text] = []
        for detection in reversed(detections):
            line = self._line(detection)
            rows -= -(-line.cell_len // width)
            if rows < 0 and lines:
                break
            lines.insert(0, line)
        return lines

    def _line(self, detection: Detection) -> Text:
        true = self._true[detection.label]
        colour = "red" if detection.label == "contact" else "blue"
        line = Text(f"{detection.t * 1e-6:8.3f} s  ").append(f"{detection.label:<8}", style=f"bold {colour}")
        if len(true):
            nearest = int(np.abs(true - detection.t).argmin())
            line.append(f"{self._kinds[nearest]:<7} known {to_ms(detection.known - true[nearest]):+6.2f} ms, ")
            line.append(f"output {to_ms(detection.reported - true[nearest]):+6.2f} ms after truth", style="dim")
        return line


def _blocks(frame: NDArray[np.uint16] | NDArray[np.float32]) -> Text:
    """Return a frame of ticks as half blocks: two rows a line; each cell is the largest of 2 x 2 taxels."""
    above = np.clip((frame.astype(float) - np.median(frame) - 6.0) / 80.0, 0.0, 1.0)
    rows, columns = (n // 2 for n in frame.shape)
    cells = np.sqrt(above[: 2 * rows, : 2 * columns].reshape(rows, 2, columns, 2).max(axis=(1, 3)))
    lines = []
    for upper, lower in zip(cells[::2], cells[1::2], strict=True):
        pairs = zip(upper, lower, strict=True)
        lines.append(Text.assemble(*(("▀", Style(color=_colour(a), bgcolor=_colour(b))) for a, b in pairs)))
    return Text("\n").join(lines)


def _colour(share: float) -> str:
    """Return the colours of a picture: from dark blue through red and yellow to white."""
    red, green, blue = (int(255 * min(1.0, max(0.0, 2.6 * share - k))) for k in (0.0, 0.8, 1.6))
    return f"#{max(red, 18):02x}{max(green, 16):02x}{max(blue, 26):02x}"
