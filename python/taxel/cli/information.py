"""``taxel information``: bits that labelled touches give, by sampling period, number of taxels and time."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

import taxel
from taxel._base.messages import counted
from taxel._core import ProblemError
from taxel.cli._say import say
from taxel.cli._task import Output, Reading, progress, say_warnings
from taxel.cli.app import App, Flat
from taxel.options import InformationOptions

if TYPE_CHECKING:
    from taxel.information import Answer, Estimate, Point

app = App(name="information")


@app.default
def information(
    recordings: list[Path],
    /,
    *,
    labels: Annotated[str | None, Parameter(metavar="FILE")] = None,
    report: Annotated[Path, Parameter(metavar="FILE")] = Path("information.html"),
    options: Flat[InformationOptions] = InformationOptions(),
    reading: Flat[Reading] = Reading(),
    output: Flat[Output] = Output(),
) -> None:
    """Estimate how many bits labelled touches give, by sampling period, time, number of taxels and data rate.

    Example: taxel information drops.mcap --labels drops.csv --window-ms 50

    Parameters
    ----------
    recordings
        Recordings, or folders of them: .mcap, .lsa, .npz, .csv, other makers' files.
    labels
        A CSV with a row for each trial: recording,t_us,label[,stop_us][,group] and columns of parameters; for a single
        recording the column recording may be left out. Or the word notes: each note of the recordings is a trial that
        begins at the time of the note, and the text of the note is the label. Default: each recording is a trial, and
        its folder's name is the label.
    report
        The report to write, an .html with pictures.
    """
    if report.suffix != ".html":
        raise ProblemError(f"--report {report}: the name of the report must end in .html")
    output.check(report)
    known = _KnownBits()
    try:
        with progress(output.json) as update:
            opened = []
            for path in recordings:
                update(f"reading {path}", 0, 0)
                opened += reading.opener.open_sensors([path])
            result = taxel.tasks.information(opened, labels, options, progress=update, watch=known.add)
            update("drawing", 0, 0)
            taxel.report.write_information(report, result.answer, overwrite=output.overwrite)
    except KeyboardInterrupt:
        say(known.line(options.draws), err=True)
        raise
    say_warnings(result.warned)
    output.say({**result.to_dict(), "report": str(report)}, *lines(result.answer), f"written to {report}")


class _KnownBits:
    """The bits of the settings of all taxels that are done, for a run that is stopped."""

    def __init__(self) -> None:
        self._bits: dict[float, dict[float, tuple[float, int]]] = {}

    def add(self, period_ms: float, window_ms: float, bits: float) -> None:
        """Note the bits of a setting by its draws so far."""
        by_window = self._bits.setdefault(period_ms, {})
        by_window[window_ms] = bits, by_window.get(window_ms, (0.0, 0))[1] + 1

    def line(self, draws: int) -> str:
        """Return one line of all settings so far."""
        if not self._bits:
            return "stopped before the bits of any setting were known"
        counts = sorted({count for by_window in self._bits.values() for _, count in by_window.values()})
        done = f"{counts[0]}" if len(counts) == 1 else f"{counts[0]} to {counts[-1]}"
        by_period = "; ".join(
            f"period {period:g} ms: "
            + ", ".join(f"{bits:.2f} within {window:g} ms" for window, (bits, _) in by_window.items())
            for period, by_window in self._bits.items()
        )
        return (
            f"stopped after {done} of {counted(draws, 'draw')}; bits so far, without confidence intervals: {by_period}"
        )


def lines(answer: Answer) -> list[str]:
    """Return the lines that are printed of an answer."""
    sizes = sorted(set(answer.labels.values()))
    each = f"{sizes[0]}" if len(sizes) == 1 else f"{sizes[0]} to {sizes[-1]}"
    trials, labels = counted(sum(answer.labels.values()), "trial"), counted(len(answer.labels), "label")
    full = answer.full
    text = [
        f"{trials}, {labels} x {each}, {counted(answer.groups, 'group') if answer.groups else 'no groups'}",
        f"labels shuffled: {answer.zero}",
        "controls: " + " | ".join(f"{c.name} {_bits(c.found)} ({c.about})" for c in answer.controls),
        f"full: {full.period_ms:g} ms, {counted(full.taxels, 'taxel')}, to {full.window_ms:g} ms: "
        f"{_interval(full.found)}, "
        f"{100 * full.found.right:.0f} % right"
        + "".join(f"; frames {e.bits:.2f}" for p, e in answer.frames.items() if p == full.period_ms)
        + "".join(f"; {name} {e.bits:.2f}" for name, e in answer.classifiers.items()),
        "in brackets: the range of the bits in 95 % of new draws of these trials, or of whole groups; with few trials, "
        "the true bits are outside this range more often",
    ]
    text += [f"warning: {warning}" for warning in answer.warnings]
    columns = ("bits", "events", "millibits/event", "kb/s", "silent")
    text += ["", _row("period", *columns, "keeps 95 % of the full bits?")]
    text += [_row(f"{p.period_ms:g} ms", *_figures(p), _verdict(p, answer)) for p in answer.by_period]
    if answer.taxels:
        text += ["", _row(f"taxels at {answer.taxels[0].period_ms:g} ms", *columns, "")]
        text += [_row(f"{p.taxels} {p.kind}", *_figures(p), "") for p in answer.taxels]
    text += [""]
    for window in sorted({p.window_ms for p in answer.points} - {full.window_ms}):
        here = [p for p in answer.points if p.window_ms == window]
        by_period = "; ".join(f"{p.period_ms:g} ms {p.found.bits:.2f}" for p in here)
        text.append(f"to {window:g} ms after contact: {by_period}")
    for name, points in answer.parameters.items():
        text.append(
            f"{name} ({points[0].found.most:.2f} bits at most): "
            + "; ".join(f"{p.period_ms:g} ms {p.found.bits:.2f}" for p in points)
        )
    text += [f"note: {note}" for note in answer.notes]
    text.append(f"rates are of {answer.wire}")
    return text


def _verdict(point: Point, answer: Answer) -> str:
    verdict = "the full setting" if point.verdict is None else str(point.verdict)
    return verdict + " <- cheapest" * (point is answer.cheapest and not answer.empty)


def _figures(point: Point) -> tuple[str, ...]:
    return (
        f"{point.found.bits:.2f}",
        f"{point.events:.4g}",
        f"{point.millibits_per_event:.3g}",
        f"{point.kbps:.3g}",
        f"{100 * point.silent:.0f} %",
    )


def _row(*cells: str) -> str:
    name, bits, events, each, rate, silent, verdict = cells
    return f"{name:<18} {bits:>6} {events:>8} {each:>16} {rate:>8} {silent:>7}  {verdict}".rstrip()


def _bits(estimate: Estimate | None) -> str:
    return "-" if estimate is None else f"{estimate.bits:.2f}"


def _interval(estimate: Estimate) -> str:
    low, high = estimate.interval
    return f"{estimate.bits:.2f} of {estimate.most:.2f} bits [{low:.2f} {high:.2f}]"
