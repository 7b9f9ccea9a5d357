"""HTML of the data classes for notebooks: the text line and a small plot."""

from __future__ import annotations

import base64
import io
from html import escape

from matplotlib.figure import Figure

from taxel._base.arguments import shown
from taxel._base.errors import refused
from taxel.detections import Detections
from taxel.events import Events
from taxel.frames import Frames
from taxel.plot.nouns import detections, event_picture, pressure_map, raster
from taxel.plot.recordings import health_map, overview
from taxel.recording import Recording
from taxel.recording.analysis.health import Health
from taxel.spikes import SpikeTrains

Drawn = Events | Frames | SpikeTrains | Detections | Recording | Health


def html(noun: Drawn) -> str:
    """Return the text line of an object and a small plot of it as HTML; only the line if there is nothing to draw.

    Parameters
    ----------
    noun : Events, Frames, SpikeTrains, Detections, Recording or Health

    Returns
    -------
    str

    Raises
    ------
    ProblemError : another object

    Examples
    --------
    >>> import taxel
    >>> html(taxel.SpikeTrains.from_lists([[1.0, 5.0], [3.0]], stop=10.0)).startswith("<code>SpikeTrains(")
    True
    """
    if not isinstance(noun, Drawn):
        raise refused("noun", f" is {shown(noun)}: must be an object that draws itself, for example taxel.Events")
    line = f"<code>{escape(repr(noun))}</code>"
    # A figure without pyplot, so that no window or notebook shows it a second time.
    figure = Figure(figsize=(7.0, 2.6) if isinstance(noun, Recording) else (4.2, 2.8), layout="constrained")
    match noun:
        case Recording():
            overview(noun, figure)
        case Frames() if not len(noun):
            return line
        case Events():
            event_picture(noun, figure.add_subplot())
        case Frames():
            pressure_map(noun, ax=figure.add_subplot())
        case SpikeTrains():
            raster(noun, figure.add_subplot())
        case Detections():
            detections(noun, figure.add_subplot())
        case Health():
            health_map(noun, figure.add_subplot())
    file = io.BytesIO()
    figure.savefig(file, format="png", dpi=80)
    picture = base64.b64encode(file.getvalue()).decode()
    return f'{line}<br><img alt="{escape(repr(noun))}" src="data:image/png;base64,{picture}">'
