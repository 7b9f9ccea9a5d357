"""``taxel info``: what is in a recording."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer
from rich.console import Console

from taxel._core import ProblemError
from taxel.cli._app import app

if TYPE_CHECKING:
    from taxel.recording import Recording

__all__ = ["info"]

#: The stretch over which the highest rate is taken, us.
_PEAK_US = 10_000

_PICTURES = (".png", ".svg", ".pdf")


@app.command()
def info(
    file: Annotated[Path, typer.Argument(help="A recording: .mcap, .lsa, .npz or .csv.")],
    picture: Annotated[
        Path | None, typer.Option(help="Write rates and a map of the taxels to this .png, .svg or .pdf.")
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the picture where it exists.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
) -> None:
    """Say what is in a recording, what was lost, its rates, and which taxels are dead, stuck or noisy.

    Example: taxel info walk.mcap --picture walk.png
    """
    import taxel  # noqa: PLC0415  the command line starts quickly
    from taxel._files import write_whole  # noqa: PLC0415

    if picture is not None and picture.suffix.lower() not in _PICTURES:
        raise ProblemError(f"{picture}: a picture ends in {', '.join(_PICTURES)}")
    # Shown on a terminal only, and gone when done.
    with Console(stderr=True).status(f"reading {file}"):
        recording = taxel.open(file)
        said = about(recording)
    if picture is not None:
        import matplotlib as mpl  # noqa: PLC0415  loads slowly

        mpl.use("Agg")
        figure, kind = recording.plot(), picture.suffix.lower()[1:]
        write_whole(picture, lambda out: figure.savefig(out, format=kind), overwrite=overwrite)
        said["picture"] = str(picture)
    typer.echo(json.dumps(said) if as_json else _page(said))


def about(recording: Recording) -> dict[str, Any]:
    """Return all that `taxel info` says, as JSON holds it."""
    from taxel._health import health  # noqa: PLC0415

    array = recording.array
    table = recording.events if recording.has_events else recording.frames()
    span = (int(table.t.min()), int(table.t.max())) if len(table) else None
    seconds = (span[1] - span[0]) / 1e6 if span else 0.0
    said: dict[str, Any] = {
        "file": str(recording.path),
        "kind": recording.kind,
        "source": recording.source,
        "array": {"rows": array.rows, "columns": array.columns, "pitch_mm": array.pitch_mm, "name": array.name},
        "from_us": span[0] if span else None,
        "to_us": span[1] if span else None,
        "seconds": seconds,
    }
    if recording.has_events:
        events = recording.events
        said["events"] = len(events)
        said["intensities"] = 0 if events.present is None else int(events.present.sum())
        said["markers"] = [{"t_us": t, "start": start} for t, start in events.markers]
        said["events_per_s_board"] = len(events) / seconds if seconds else None
        said["peak_events_per_s_board"] = _peak(events.t)
    else:
        said["pictures"], said["unit"] = len(table), recording.frames().unit
        said["pictures_per_s"] = (len(table) - 1) / seconds if seconds else None
    clock = recording.clock
    if clock is not None and len(clock.board_us) > 1:
        host = (int(clock.arrived_ns.max()) - int(clock.arrived_ns.min())) / 1e9
        late = np.percentile(clock.delay_us, [50, 99])
        said |= {
            "seconds_host": host,
            "events_per_s_host": said["events"] / host if host else None,
            "datagrams_per_s_host": len(clock.arrived_ns) / host if host else None,
            "drift_ppm": clock.drift_ppm,
            "delay_us": {"median": float(late[0]), "p99": float(late[1])},
        }
    return said | {
        "notes": [{"t_us": note.t, "text": note.text} for note in recording.notes],
        "detections": {label: len(recording.detections[label]) for label in recording.detections.labels},
        "registers": None if recording.registers is None else json.loads(recording.registers._json()),
        "taxels": health(table).named(),
        "counts": recording.counts,
        "truncated": recording.truncated,
        "rebuilt": recording.rebuilt,
        "verdict": recording.verdict,
    }


def _peak(t: Any) -> float | None:
    """Return the highest rate in a stretch of 10 ms of board time, events/s."""
    if not len(t):
        return None
    _, counts = np.unique(t // _PEAK_US, return_counts=True)
    return float(counts.max() / (_PEAK_US / 1e6))


def _page(said: dict[str, Any]) -> str:
    """Return the same as lines for people."""
    head = f"{said['file']}: .{said['kind']}" + f", from {said['source']}" * bool(said["source"])
    rows = [*_contents(said), *_rates(said), *_losses(said), ("verdict", said["verdict"])]
    lines = [head, *(f"  {name:<20}{value}" for name, value in rows)]
    if "picture" in said:
        lines.append(f"picture written to {said['picture']}")
    return "\n".join(lines)


def _contents(said: dict[str, Any]) -> Iterator[tuple[str, str]]:
    array = said["array"]
    yield "array", f"{array['rows']} x {array['columns']} taxels, {array['pitch_mm']:g} mm, {array['name']}"
    if said["from_us"] is not None:
        yield "board time", f"{said['from_us']} to {said['to_us']} us ({said['seconds']:.3f} s)"
    if "events" in said:
        words = f"{said['intensities']} with intensity, {len(said['markers'])} markers"
        yield "events", f"{said['events']}, {words}"
    else:
        yield "pictures", f"{said['pictures']} ({said['unit']})"
    if said["notes"]:
        yield "notes", str(len(said["notes"]))
    if said["detections"]:
        yield "detections", ", ".join(f"{label} {n}" for label, n in said["detections"].items())
    for name, places in said["taxels"].items():
        shown = ", ".join(f"({x}, {y})" for x, y in places[:8]) + " ..." * (len(places) > 8)
        yield f"{name} taxels", f"{len(places)}" + f": {shown}" * bool(places)


def _rates(said: dict[str, Any]) -> Iterator[tuple[str, str]]:
    if said.get("events_per_s_board") is not None:
        peak = said["peak_events_per_s_board"]
        yield "rate, board", f"{said['events_per_s_board']:.0f} events/s, at most {peak:.0f} in 10 ms"
    if said.get("pictures_per_s") is not None:
        yield "rate", f"{said['pictures_per_s']:.1f} pictures/s"
    if said.get("events_per_s_host") is not None:
        host = f"{said['events_per_s_host']:.0f} events/s, {said['datagrams_per_s_host']:.0f} datagrams/s"
        yield "rate, host", f"{host} in {said['seconds_host']:.3f} s"
        late = said["delay_us"]
        delays = f"delays {late['median']:.0f} us median, {late['p99']:.0f} us 99 %"
        yield "clock", f"drift {said['drift_ppm']:+.1f} ppm; {delays}"


def _losses(said: dict[str, Any]) -> Iterator[tuple[str, str]]:
    counts = said["counts"]
    for name in ("datagrams", "bytes", "received", "dropped_by_kernel", "dropped_by_queue", "missing_numbers"):
        if counts.get(name) is not None:
            yield name.replace("_", " "), str(counts[name])
    sound = ("bytes", "words", "changes", "intensities", "markers")
    for name, n in {**counts.get("decoder", {}), **said["rebuilt"]}.items():
        if n and name not in sound:
            yield name.replace("_", " "), str(n)
