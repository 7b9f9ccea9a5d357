"""``taxel info``: what is in a recording."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from itertools import chain
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from cyclopts import Parameter

import taxel
from taxel._base.files import write_whole
from taxel._base.messages import counted, plain, warn
from taxel._base.parallel import Workers
from taxel._base.times import beginning_us, begun
from taxel._core import ProblemError
from taxel.array import Array
from taxel.cli._say import in_columns, say
from taxel.cli.app import OUTSIDE, App, Flat
from taxel.cli.task import Output, progress, say_failures, say_warnings
from taxel.clock import doubt
from taxel.options import FullReading

if TYPE_CHECKING:
    from taxel.recording import Recording
    from taxel.recording.analysis.pressure import Series

app = App(name="info")

#: Verdicts that name no fault.
_SOUND = ("complete", "complete after arrival", "unknown")
#: Columns of the table of several recordings: how many taxels do not work.
_TAXELS = ("dead", "stuck", "noisy")


@app.default
def info(
    file: Path,
    /,
    *,
    table: Annotated[Path | None, Parameter(metavar="FILE")] = None,
    tare: Annotated[str | None, Parameter(metavar="SECONDS|FILE")] = None,
    regions: Annotated[Path | None, Parameter(metavar="FILE")] = None,
    range_end: float | None = None,
    each: bool = False,
    workers: Flat[Workers] = Workers(),
    reading: Flat[FullReading] = FullReading(),
    output: Flat[Output] = Output(),
) -> int:
    """Summarise a recording: contents, losses, rates, pressure, and dead, stuck or noisy taxels.

    For a ROS bag without --topic: the topics that hold numbers, with shapes and rates.

    For several recordings, such as a folder: a row for each, and their sum. Files that cannot be read are named at the
    end, with exit code 2; --jobs reads several at once. Exit code 3: a recording was cut off, as where a disk was full.

    Example: taxel info walk.mcap --table walk.csv
    Example: taxel info grasp.db3 --topic /palm --field taxels --array 24x32

    Parameters
    ----------
    file
        A recording, a file of a sensor's maker, or a folder.
    table
        Write contact area, peak, sum and centre of pressure over time to this .csv; with --regions those of each region
        too.
    tare
        The rest of the taxels: a saved tare, a recording of the sensor at rest (taxel cut makes one), or the seconds at
        rest at the beginning. Default: measured in a quiet part of the recording.
    regions
        Measure the load of each region of this .json, such as NAME.regions.json (docs/files.md).
    range_end
        With --regions: the value at which the range of a taxel ends; taxels that reach it are counted. Default: that
        which the file states (F-Scan).
    each
        Print all facts about each recording of a folder.
    """
    from taxel.recording.kinds import is_folder, recordings_in  # noqa: PLC0415
    from taxel.recording.opening import topics_in  # noqa: PLC0415
    from taxel.tasks.labels import are_trials, trial_name  # noqa: PLC0415

    if table is not None and table.suffix.lower() != ".csv":
        raise ProblemError(f"{table}: the name of a table must end in .csv")
    output.check(table)
    parts = () if regions is None else taxel.read_regions(regions)
    as_json = output.json
    files = recordings_in(file, reading.layout) if file.exists() and is_folder(file) else []
    if len(files) > 1 and table is None and regions is None:
        return _of_files(file, files, partial(_infos, reading, tare), workers, each=each, as_json=as_json)
    with progress(as_json) as show:
        show(f"reading {file}", 0, 0)
        if file.exists() and (listed := topics_in(file, reading.topic, reading.ros, reading.layout)) is not None:
            title, rows, facts = listed
            say(*([json.dumps(facts)] if as_json else [title, *(f"  {row}" for row in in_columns(rows))]))
            return 0
        recordings = reading.open_trials(file)
        recording = recordings[0]
        if len(recordings) > 1 or len(recording.sources) > 1:
            if table is not None or (regions is not None and len(recordings) > 1):
                raise ProblemError(_several(file, recordings))
            infos = [taxel.tasks.info(each, tare, parts, range_end) for each in recordings]
            of_each = [found.facts for found in infos]
            say(*_of_several(file, of_each, as_json=as_json, each=each))
            if are_trials(recordings) and not as_json:
                example = trial_name(recordings[0])
                say(f"labels of these trials need a column recording with the trial's name, for example {example}")
            say_warnings(dict.fromkeys(text for found in infos for text in found.warnings))
            return _code(of_each)
        found = taxel.tasks.info(recording, tare, parts, range_end)
        facts, pressed = found.facts, found.pressed
        facts["array_assumed"] &= not reading.array
    say_warnings(found.warnings)
    if table is not None:
        if pressed is None:
            raise ProblemError(f"{file}: contains events without intensities, so no pressure can be written to a table")
        text = "".join(f"{line}\n" for line in _lines(pressed))
        write_whole(table, lambda out: out.write(text.encode()), overwrite=output.overwrite)
        facts["table"] = str(table)
    say(*([json.dumps(facts)] if as_json else _page(facts)))
    return _code([facts])


def _code(of_each: Iterable[dict[str, Any]]) -> int:
    """Return the exit code: whether a recording was cut off."""
    sources = (source for facts in of_each for source in facts.get("sources", {"": facts}).values())
    return OUTSIDE if any(source["truncated"] for source in sources) else 0


def _infos(reading: FullReading, tare: str | None, file: Path) -> list[dict[str, Any]]:
    """Return the facts of the recordings of a file; their warnings are warned of again."""
    found = [taxel.tasks.info(each, tare) for each in reading.open_trials(file)]
    for text in (text for one in found for text in one.warnings):
        warn(text)
    return [one.facts for one in found]


def _of_files(
    folder: Path, files: Sequence[Path], work: Callable[[Path], Any], workers: Workers, *, each: bool, as_json: bool
) -> int:
    """Print the facts of the files of a folder, and which of them cannot be read; return an exit code."""
    with progress(as_json) as show:
        found = workers.tried(work, files, lambda k, done: show(str(files[k]), done, len(files)))
    facts = [one for of_file in found if not of_file.failure for one in of_file.result]
    if as_json:
        failed = [{"file": str(f), "error": one.failure} for f, one in zip(files, found, strict=True) if one.failure]
        say(json.dumps([*facts, *failed]))
    elif facts:
        say(*_of_several(folder, facts, as_json=False, each=each))
    return say_failures(files, found) or _code(facts)


def _several(file: Path, recordings: Sequence[Recording]) -> str:
    """Return why there is not a table of several recordings, or of one with several sources."""
    if len(recordings) > 1:
        alone = f"taxel convert {quote(str(file))} FOLDER writes each to a separate file"
        alone = f"taxel info {quote(str(recordings[0].path))} --table FILE.csv" if file.is_dir() else alone
        return f"{file}: contains {len(recordings)} recordings; a table can contain only one recording: {alone}"
    names = ", ".join(recordings[0].sources)
    return (
        f"{file}: contains {len(recordings[0].sources)} sources ({names}); a table can contain only one source: "
        "taxel convert --source NAME writes a source to a separate file"
    )


def _of_several(place: Path, of_each: Sequence[dict[str, Any]], *, as_json: bool, each: bool) -> Iterable[str]:
    """Return the facts of several recordings, or of one with several sources, as JSON or as lines for people."""
    if as_json:
        return [json.dumps(of_each if len(of_each) > 1 else of_each[0])]
    return chain.from_iterable(map(_pages, of_each)) if each or len(of_each) == 1 else _overview(place, of_each)


def _overview(place: Path, of_each: Sequence[dict[str, Any]]) -> list[str]:
    """Return a row for each sensor of recordings, then their sum, as lines for people."""
    sensors = [sensor for facts in of_each for sensor in _sensors(facts)]
    sums = {noun: sum(facts.get(f"{noun}s", 0) for facts in sensors) for noun in ("event", "frame")}
    # Those of several sources are those of the first that has any.
    noted: list[Any] = [
        next((notes for sensor in _sensors(facts) if (notes := sensor["notes"])), []) for facts in of_each
    ]
    notes = Counter(note["text"] for of in noted for note in of)
    faults = Counter(str(facts["verdict"]) for facts in of_each if facts["verdict"].status not in _SOUND)
    last = {
        "recording": "sum",
        "time (s)": f"{sum(facts['seconds'] for facts in sensors):.3f}",
        "contents": ", ".join(counted(total, noun) for noun, total in sums.items() if total),
        "notes": str(notes.total()),
        **{name: str(sum(len(facts["taxels"][name]) for facts in sensors)) for name in _TAXELS},
    }
    rows = [*map(_row, sensors), last]
    # What no recording has to say is no column.
    names = [name for name in rows[0] if any(row.get(name) not in (None, "", "unknown") for row in rows)]
    cells = [names, *([row.get(name, "") for name in names] for row in rows)]
    of_notes = ", ".join(f"{text} {count}" for text, count in sorted(notes.items()))
    return [
        f"{place}: {counted(len(of_each), 'recording')}",
        *(f"  {line}" for line in in_columns(cells)),
        *([f"notes: {of_notes}"] if notes else []),
        *(f"{counted(count, 'recording')}: {verdict}" for verdict, count in faults.items()),
        "--each prints all facts about each recording",
    ]


def _sensors(facts: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the facts of each source of a recording, or of its only one."""
    return list(facts["sources"].values()) if "sources" in facts else [facts]


def _row(facts: dict[str, Any]) -> dict[str, str]:
    """Return the cells of a sensor in the table of several recordings."""
    array, events, gaps = Array._from_geometry(facts["array"]), facts.get("events"), facts["gaps"]
    rate = facts["frames_per_s"] if events is None else facts["events_per_s_board"]
    return {
        "recording": Path(facts["file"]).name,
        "array": f"{array.rows} x {array.columns}",
        "time (s)": f"{facts['seconds']:.3f}" if facts["timed"] else "none",
        "contents": f"{counted(facts['frames'], 'frame')} ({facts['unit']})"
        if events is None
        else counted(events, "event"),
        "rate (1/s)": "" if rate is None else f"{rate:.4g}",
        "notes": str(len(facts["notes"])),
        **{name: str(len(facts["taxels"][name])) for name in _TAXELS},
        "gaps": "" if gaps is None else f"{gaps['count']} ({plain(gaps['total_us'] / 1e6, 3)} s)",
        "verdict": facts["verdict"].status,
    }


def _pages(facts: dict[str, Any]) -> list[str]:
    """Return the facts of a recording, or of each source of one, as lines for people."""
    if "sources" not in facts:
        return _page(facts)
    pages = {name: _page(source) for name, source in facts["sources"].items()}
    return [line for name, (head, *rows) in pages.items() for line in (f"{name}: {head}", *rows)]


def _lines(pressed: Series) -> Iterator[str]:
    """Yield the lines of a table of pressure over time; the centre is empty where nothing is loaded."""
    columns = {name: values for name, values in pressed.columns.items() if name != "force_N"}
    for region, loads in pressed.regions.items():
        columns |= {f"{region} {name}": values for name, values in loads.items()}
    yield ",".join(["t_us", *(f'"{name}"' if "," in name else name for name in columns)])
    for t, *values in zip(*(column.tolist() for column in (pressed.t, *columns.values())), strict=True):
        yield ",".join([str(t), *("" if np.isnan(value) else f"{value:.10g}" for value in values)])


def _page(facts: dict[str, Any]) -> list[str]:
    """Return the facts of a recording as lines for people."""
    from taxel.formats.roles import SURE, Role, lines_of  # noqa: PLC0415
    from taxel.recording import kind_of_file  # noqa: PLC0415

    head = f"{facts['file']}: {kind_of_file(facts['kind'])}" + f", from {facts['source']}" * bool(facts["source"])
    rows = [*_contents(facts), *_rates(facts), *_losses(facts), ("verdict", facts["verdict"])]
    rows += [("remark", line) for line in facts["remarks"]]
    missing = [("not in file", line) for line in facts["lost"]]
    # Remarks on data left out of a bag, or on other times, concern all rows that follow.
    rows = [*missing, *rows] if facts["kind"] == "ros" else [*rows, *missing]
    lines = [head, *(f"  {name:<19} {value}" for name, value in rows)]
    if any(role["certainty"] != SURE for role in facts["roles"]):
        lines += ["roles of its columns; ~ is assumed:", *lines_of([Role(**role) for role in facts["roles"]])]
    if facts["layout"]:
        lines += [
            f"read by this layout, which {facts['layout_file']} may state:",
            *facts["layout"].splitlines(),
        ]
    return [*lines, *([f"table written to {facts['table']}"] if "table" in facts else [])]


def _contents(facts: dict[str, Any]) -> Iterator[tuple[str, str]]:
    from taxel.recording import kind_of_file  # noqa: PLC0415

    array = Array._from_geometry(facts["array"])
    size = f"{array.rows} x {array.columns} taxels, {array._apart()}"
    # The default's name, and that of --array, say nothing more.
    size += "" if re.fullmatch(r"array|\d+x\d+\S*", array.name) else f", {array.name}"
    yield (
        "array",
        size
        + f"; assumed, because a {kind_of_file(facts['kind'])} does not state it: give --array"
        * facts["array_assumed"],
    )
    names = array.names or ()
    of_it = {"names": ", ".join(names[:8]) + " ..." * (len(names) > 8), "side": facts["side"], "heel": facts["heel"]}
    yield from ((name, value) for name, value in of_it.items() if value)
    yield from _time(facts)
    if "events" in facts:
        words = f"{facts['intensities']} with intensity, {counted(len(facts['markers']), 'marker')}"
        if facts.get("on_share") is not None:
            words = f"{100 * facts['on_share']:.1f} % on"
        yield "events", f"{facts['events']}, {words}"
        if facts["bursts_us"]:
            yield "resolution", f"times come in bursts {facts['bursts_us'] / 1e3:.3g} ms apart, and are no finer"
    else:
        yield ("samples" if "columns" in facts else "frames"), f"{facts['frames']} ({facts['unit']})"
        yield from _flaws(facts)
    if "columns" in facts:
        yield "columns", ", ".join(facts["columns"])
    if "against" in facts:
        reference = facts["against"]
        yield (
            f"clock of {reference['source']}",
            f"ahead by {reference['offset_us']:+d} us at the beginning, faster by {reference['drift_ppm']:+.1f} ppm",
        )
        # A source of events states its own drift, and its doubt, below.
        if "events" not in facts and (wrong := doubt(reference["drift_ppm"], 0.0)):
            yield "", wrong
    if facts["calibration"] is not None:
        yield "calibration", facts["calibration"]
    if facts["pressure"] is not None:
        yield "rest", facts["rest"]["text"]
        yield from _pressure(facts["pressure"], _begin_us(facts), timed=facts["timed"])
    elif facts["rest"] is not None and facts["rest"]["falls"]:
        yield "rest", facts["rest"]["text"]
    if facts["notes"]:
        yield "notes", str(len(facts["notes"]))
    if facts["detections"]:
        yield "detections", ", ".join(f"{label} {n}" for label, n in facts["detections"].items())
    yield from _taxels(facts)


def _flaws(facts: dict[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield what frames lack: values and times, and new values."""
    if (rate := facts["values_per_s"]) and facts["frames_per_s"] > 1.5 * rate:
        yield "repeated values", f"frames repeat their values, which change at {rate:.3g} Hz at most: the sensor's rate"
    if facts["missing"]["values"]:
        yield "missing values", f"{facts['missing']['values']} of {facts['missing']['of']}"
    if (gaps := facts["gaps"]) is not None and "gaps" not in facts["verdict"].noted:
        yield "gaps", gaps["text"]


def _taxels(facts: dict[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield which taxels do not work; people count rows first."""

    def at(taxels: list[tuple[int, int]], count: int) -> str:
        shown = ", ".join(f"({y}, {x})" for x, y in taxels[:8]) + " ..." * (count > 8)
        return f", at (row, column) {shown}" * bool(taxels)

    for name, taxels in facts["taxels"].items():
        yield f"{name} taxels", f"{len(taxels)}{at(taxels, len(taxels))}"
    # Each touch is seen by few pixels of a camera.
    if "on_share" in facts:
        return
    if untested := facts["taxels_untested"]:
        # The places of most of an array say nothing.
        few = 2 * untested <= Array._from_geometry(facts["array"]).taxels
        where = at(facts["taxels_untested_at"], untested) if few else ""
        yield "other taxels", f"{untested} not touched enough to say whether they work{where}"


def _time(facts: dict[str, Any]) -> Iterator[tuple[str, str]]:
    if not facts["timed"]:
        yield "time", "none: the frames have only numbers; give --rate-hz if a command needs times"
    elif facts["from_us"] is not None:
        begin = _begin_us(facts)
        yield "time", f"{facts['from_us'] - begin} to {facts['to_us'] - begin} us ({facts['seconds']:.3f} s)"
        if begin:
            yield "from", f"{begun(begin)}, {begin} us since 1970"


def _begin_us(facts: dict[str, Any]) -> int:
    """Return the time that text counts times from."""
    return beginning_us(np.array([] if facts["from_us"] is None else [facts["from_us"]], np.int64))


def _pressure(pressed: dict[str, Any], begin_us: int, *, timed: bool) -> Iterator[tuple[str, str]]:
    for name, words, unit in (
        ("area_mm2", "contact area", "mm2"),
        ("area_taxels", "contact area", "taxels"),
        ("peak", "peak", pressed["unit"]),
        ("force_n", "force", "N") if "force_n" in pressed else ("sum", "sum", pressed["unit"]),
    ):
        if name in pressed:
            most = pressed[name]["most"]
            size = counted(int(most), "taxel") if unit == "taxels" else f"{most:g} {unit}"
            at = pressed[name]["t_us"] - begin_us
            yield words, f"at most {size}, at {f'{at} us' if timed else f'frame {at}'}"
    for unit, more in (("mm", " mm"), ("taxels", ""), ("places", " in the unit of the places")):
        across, down = ("column", "row") if unit == "taxels" else ("x", "y")
        if pressed.get(f"centre_{unit}") is not None:
            x, y = (f"{low:.1f} to {high:.1f}{more}" for low, high in pressed[f"centre_{unit}"].values())
            yield "centre of pressure", f"{across} {x}, {down} {y}"
    for region, loads in pressed["regions"].items():
        most = (f"{name.partition('_')[0]} {value:g} {name.partition('_')[2]}" for name, value in loads.items())
        yield f"region {region}", f"at most {', '.join(most)}, of taxels above {pressed['above']:g} {pressed['unit']}"


def _rates(facts: dict[str, Any]) -> Iterator[tuple[str, str]]:
    if facts.get("events_per_s_board") is not None:
        peak = f"{facts['peak_events_per_s_board']:.0f} events/s in the busiest 10 ms"
        before = ", before the start marker, where a board sends the rest of every taxel" * facts["peak_before_start"]
        name = "rate" if "on_share" in facts else "rate, board"
        yield name, f"{facts['events_per_s_board']:.0f} events/s; {peak}{before}"
    if facts.get("frames_per_s") is not None:
        yield "rate", f"{facts['frames_per_s']:.1f} frames/s"
    if facts.get("events_per_s_host") is not None:
        host = f"{facts['events_per_s_host']:.0f} events/s, {facts['datagrams_per_s_host']:.0f} datagrams/s"
        yield "rate, host", f"{host} in {facts['seconds_host']:.3f} s"
        late = facts["delay_us"]
        delays = f"delays {late['median']:.0f} us median, {late['p99']:.0f} us 99 %"
        yield "clock", f"drift {facts['drift_ppm']:+.1f} ppm; {delays}"
        if facts["clock_doubt"] is not None:
            yield "", facts["clock_doubt"]


def _losses(facts: dict[str, Any]) -> Iterator[tuple[str, str]]:
    counts = facts["counts"]
    always = ("datagrams", "bytes", "received", "dropped_by_kernel", "dropped_by_queue")
    for name in always:
        if counts.get(name) is not None:
            # Those of what arrived are counted apart from the recording, and saved now and then.
            old = ", when counts were last saved" * (facts["truncated"] and name not in ("datagrams", "bytes"))
            yield name.replace("_", " "), f"{counts[name]}{old}"
        elif name == "dropped_by_kernel" and name in counts:
            yield name.replace("_", " "), "unknown: the system does not count them"
    if counts.get("frames_that_could_not_be_read"):
        yield "frames that could not be read", str(counts["frames_that_could_not_be_read"])
