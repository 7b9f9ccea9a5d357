"""``taxel detect``: the detections of a readout in a recording."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

import taxel
from taxel._base.files import write_whole
from taxel._base.messages import collected
from taxel._base.parallel import Workers
from taxel._base.times import begun
from taxel.cli._say import say
from taxel.cli.app import App, Flat
from taxel.cli.task import OutOption, Output, one_or_several, paths_text, progress, say_warnings
from taxel.detect.readout import used
from taxel.detections import Detections
from taxel.options import DetectOptions, Reading
from taxel.spikes import to_ms

if TYPE_CHECKING:
    from collections.abc import Iterator

    from taxel.detect import PlainRule, Readout
    from taxel.tasks import Detected, Detecting

app = App(name="detect")

#: Rows of the table that is printed without --list; all go to --out and --json.
_ROWS = 40


@app.default
def detect(
    recordings: list[Path],
    /,
    *,
    readout: Annotated[Path, Parameter(metavar="FILE")],
    truth: Annotated[Sequence[str], Parameter(metavar="FILE")] = (),
    lists: Annotated[bool, Parameter(name="--list")] = False,
    out: OutOption = None,
    report: Annotated[Path | None, Parameter(metavar="FOLDER")] = None,
    options: Flat[DetectOptions] = DetectOptions(),
    workers: Flat[Workers] = Workers(),
    reading: Flat[Reading] = Reading(),
    output: Flat[Output] = Output(),
) -> None:
    """Detect events in recordings, or in each of a folder, by a trained readout or a plain rule.

    Example: taxel detect walk.mcap --readout gait.json --truth steps.csv -o found.csv
    Example: taxel detect monday/ friday.mcap --readout gait.json --truth steps.csv

    Parameters
    ----------
    recordings
        Recordings: .mcap, .lsa, .npz, .csv or .h5, a ROS bag or a file of a sensor's maker, or folders of them.
    readout
        A file that taxel train wrote: a readout or a plain rule.
    truth
        Score against a CSV with the columns label,t_us or recording,label,t_us, or (notes) against the recordings'
        notes. May be repeated, as --labels of taxel train.
    lists
        Print all detections. Default: the first 40 of each recording, and with --truth none.
    out
        Write the detections to this .csv; those in a data set of robots, by frames of its episodes, or to a .parquet.
    report
        Write a report to this folder, with potential, weights, errors and the worst events.
    """
    output.check(out)
    output.check_report(report)
    given = one_or_several(truth) if truth else None
    loaded = taxel.detect.load(readout)
    with progress(output.json) as update:
        update(f"reading {paths_text(recordings)}", 0, 0)
        with collected() as unread:
            opened = reading.open_sensors(recordings)
        _check_target(out, opened)
        found = taxel.tasks.detect(loaded, opened, given, options, progress=update, workers=workers)
        found = replace(found, warnings=(*unread, *found.warnings))
    running = used(loaded, options.use)
    if out is not None:
        write_whole(out, lambda file: file.write(_table(found, out.suffix.lower())), overwrite=output.overwrite)
    say_warnings(found.warnings)
    against = paths_text(list(map(Path, truth))) if truth else None
    printed = list(_lines(found, running, recordings, against, given=options.tare is not None, lists=lists))
    written = {"written": out, "report": None if report is None else report / "report.html"}
    files_written = {name: str(path) for name, path in written.items() if path is not None}
    output.say(
        _result(recordings, readout, found.to_dict()) | files_written,
        *printed,
        *[] if out is None else [f"written to {out}"],
    )
    if report is not None:  # last, so that nothing is lost where it fails
        place = taxel.report.write_detections(
            report,
            running,
            found.outcomes,
            title=f"Detections of {readout} in {paths_text(recordings)}",
            warnings=[*found.unreliable, *found.warnings, *_remarks(found)],
            printed=printed,
            overwrite=output.overwrite,
        )
        say(*[] if output.json else [f"report: {place}"])


def _check_target(file: Path | None, recordings: Sequence[taxel.Recording]) -> None:
    """Refuse to write a table of detections into a data set, or as Parquet if it is of anything else.

    Raises
    ------
    ProblemError : it is so
    """
    if file is None:
        return
    if file.suffix.lower() == ".parquet" and any(each.episode is None for each in recordings):
        raise taxel.ProblemError(f"{file}: is only for detections in a data set of robots; write a .csv")
    if any(each.episode is not None and each.path.absolute() in file.absolute().parent.parents for each in recordings):
        raise taxel.ProblemError(f"{file}: is among the tables of a data set; write it elsewhere")


def _lines(
    found: Detecting,
    readout: Readout | PlainRule,
    recordings: Sequence[Path],
    truth: str | None,
    *,
    given: bool,
    lists: bool,
) -> Iterator[str]:
    """Yield score and detections as lines; `given`: whether a tare is."""
    several = _are_several(recordings) or len(found.each) > 1
    if found.score is not None:
        yield from found.unreliable
        yield from _score_lines(found, readout.labels, truth, several=several)
    remarks = _remarks(found)
    for each in found.each:
        if found.score is None or lists or not several:
            rows = None if lists else _ROWS * (found.score is None)
            yield from _detection_lines(
                each, remarks if len(found.each) == 1 else (), given=given, named=several, rows=rows
            )
    if len(found.each) > 1:
        yield from remarks
    if found.score is not None and not lists:
        yield "--list prints the detections"


def _remarks(found: Detecting) -> list[str]:
    """Return the remarks on all recordings, those on several once."""
    return _of_names([(each.outcome.name, remark) for each in found.each for remark in each.remarks], len(found.each))


def _of_names(named: Sequence[tuple[str, str]], total: int) -> list[str]:
    """Return texts, each once, with the names of the recordings that have it; of a single recording without a name."""
    names: dict[str, list[str]] = {}
    for name, text in named:
        names.setdefault(text, []).append(name)
    if total == 1:
        return list(names)
    return [f"{f'all {total}' if len(of) == total else ', '.join(of)}: {text}" for text, of in names.items()]


def _are_several(recordings: Sequence[Path]) -> bool:
    """Return whether several recordings are named, or a folder, which may hold several."""
    return len(recordings) > 1 or recordings[0].is_dir()


def _result(recordings: Sequence[Path], readout: Path, found: dict[str, Any]) -> dict[str, Any]:
    """Return the result for JSON; that of a single recording is not in a list."""
    each = found.pop("recordings")
    if len(each) == 1 and not _are_several(recordings):
        return {"readout": str(readout), **each[0], **found}
    # A folder is the place of all of them; several that are named have none.
    place = {"recording": str(recordings[0])} if len(recordings) == 1 else {}
    return {"readout": str(readout), **place, "recordings": each, **found}


def _table(found: Detecting, ending: str) -> bytes:
    """Return the detections as a table; of several recordings each row begins with its recording's name.

    Of a data set it joins with its tables, by episode and frame.
    """
    outcomes = found.outcomes
    if (of_episodes := found.by_frame()) is not None:
        written: bytes = (
            of_episodes.to_parquet(index=False) if ending == ".parquet" else of_episodes.to_csv(index=False).encode()
        )
        return written
    if len(outcomes) == 1:
        return outcomes[0].found._csv().encode()
    # All recordings share one header.
    repaired = any(outcome.found.repaired.any() for outcome in outcomes)
    tables = [outcome.found._csv(repaired, Path(outcome.name).name) for outcome in outcomes]
    return (tables[0] + "".join(table.partition("\n")[2] for table in tables[1:])).encode()


def _score_lines(found: Detecting, labels: Sequence[str], truth: str | None, *, several: bool) -> Iterator[str]:
    """Yield the score of all recordings, by label, and that of each."""
    from taxel.detect.scoring import score_rows  # noqa: PLC0415  a command loads what it needs

    count, left_out = len(found.each), len(found.left_out)
    read = f", in {count} of {count + left_out} recordings (the others are left out)" if left_out else ""
    shift = f", labels moved by {found.shift_ms:+g} ms" if found.shift_ms else ""
    yield f"against {truth} (window {found.window_ms:g} ms{shift}){read}:"
    yield from repr(found.score).split("\n")
    if found.unlabelled:
        yield f"not scored, because no row of {truth} names it: {', '.join(found.unlabelled)}"
    if found.not_scored:
        yield f"not scored, because the readout has only {', '.join(labels)}: {', '.join(found.not_scored)}"
    if several:
        yield from score_rows([(Path(outcome.name).name, outcome.score) for outcome in found.outcomes])


def _detection_lines(
    each: Detected, remarks: Sequence[str], *, given: bool, named: bool, rows: int | None
) -> Iterator[str]:
    """Yield detections, with times from the recording's beginning on, and before them what may have kept others away.

    `rows`: how many at most; None for all.
    """
    found, begin_us = each.outcome.found, each.outcome.begin_us
    detections = Detections._of(found.label, found.t - begin_us, found.known - begin_us, found.slope)
    if named:
        yield f"{each.outcome.name}:"
    yield repr(detections)
    if each.rest is not None and not given:
        yield f"rest taken: {each.rest}; --tare sets another rest"
    yield from remarks
    first = detections[:rows]
    if not len(first):
        return
    if begin_us:
        yield f"times are counted from {begun(begin_us)}"
    width = max(5, *(len(label) for label in detections.labels))
    # A plain rule has no slope; levels of frames come in steps, and may give one for all.
    slopes = [f"{slope:.4g}".replace("nan", "") for slope in first.slope]
    sloped = len({f"{slope:.4g}" for slope in detections.slope if not isnan(slope)}) > 1
    yield f"{'label':<{width}}  {'t (ms)':>12}  {'known (ms)':>12}" + f"  {'slope (mV/ms)':>13}" * sloped
    for label, t, known, slope in zip(first.label, first.t, first.known, slopes, strict=True):
        yield f"{label:<{width}}  {to_ms(t):>12.3f}  {to_ms(known):>12.3f}" + f"  {slope:>13}".rstrip() * sloped
    if len(detections) > len(first):
        yield f"... and {len(detections) - len(first)} more; --list prints all, --out and --json write all"
