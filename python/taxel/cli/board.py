"""Options and output that the commands that receive from a board share, with those of other distributions."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import Field, fields, make_dataclass
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from taxel._base.arguments import shown
from taxel._base.messages import counted
from taxel._base.options import about
from taxel._core import ProblemError
from taxel.array import Array, of_size
from taxel.cli._say import say
from taxel.cli.app import OUTSIDE, WRONG_INPUT, Limits
from taxel.cli.console import Console
from taxel.detect import PlainRule, Readout, load
from taxel.detect.drift import left_line
from taxel.detect.readout import used
from taxel.live import Summary
from taxel.live.options import LiveOptions
from taxel.tare import Tare, seconds_of
from taxel.verdict import in_words
from taxel.wire.registers import QUOTED_PRESETS

__all__ = ["REDRAW_S", "counters_line", "exit_code", "for_live", "received", "with_live_options"]

#: A first line may take so long, however short the command is to run, s.
_FIRST_LINE_S = 3.0
#: As long as it takes, s.
_ALWAYS_S = 1e9
#: Interval at which the display is redrawn and the end is checked, s.
REDRAW_S = 0.1


#: Types of options of `Live` that are typed as they are.
_TYPES = {"int": int, "float": float, "bool": bool, "str": str}


def _typed(field: Field[Any]) -> tuple[str, Any, Any]:
    """Return an option of `Live` as a field that the command line types: its name, kind and default."""
    words, kind, described = field.metadata["typed"], str(field.type), about(LiveOptions, field.name)
    plain = kind.removesuffix(" | None")
    default = field.default if plain in _TYPES else None
    read: Any = _TYPES.get(plain, str)
    if plain != kind or plain not in _TYPES:
        read |= None
    if "PathLike" in kind:
        read = Path | None
    elif "Sequence" in kind or "Mapping" in kind:
        read = list[str] | None
    option = Parameter(
        name=words.get("flag", "--" + field.name.replace("_", "-")),
        metavar=words.get("metavar"),
        help=described["help"].replace("`taxel.wire.PRESETS`", QUOTED_PRESETS),
        validator=Limits(described.get("min"), described.get("max")),
    )
    return field.name, Annotated[read, option], default


def with_live_options(command: str) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Return a decorator that gives a command its options of `Live`, as the fields of its argument `options`.

    Parameters
    ----------
    command : str
        The command whose options these are.
    """
    chosen = [
        field for field in fields(LiveOptions) if command in field.metadata["typed"].get("commands", "live").split()
    ]
    # A class of `types` would be taken for a value.
    options = make_dataclass("LiveOptions", map(_typed, chosen), frozen=True, namespace={"__module__": __name__})

    def decorate(work: Any) -> Callable[..., Any]:
        work.__annotations__["options"] = Annotated[options, Parameter(name="*")]
        work.__kwdefaults__["options"] = options()
        return work  # type: ignore[no-any-return]

    return decorate


def for_live(typed: Any, seconds: float | None = None) -> dict[str, Any]:
    """Return typed options as `Live` takes them: files are read.

    Each source of lines may be silent before its first line for `seconds`, by default as long as it takes.
    """
    options: dict[str, Any] = vars(typed)
    readout, size = options.get("readout"), options["array"]
    trained = None if readout is None else used(load(readout), options.get("use", "better"))
    array = None if size is None else of_size(size)
    read = {"readout": trained, "array": array, "tare": _rest(options.get("tare"))}
    first_line_s = _ALWAYS_S if seconds is None else max(_FIRST_LINE_S, seconds)
    given = {"send": options.get("send") or (), "sources": options["sources"] or None, "first_line_s": first_line_s}
    return options | read | given


def say_waiting(options: dict[str, Any], console: Console) -> None:
    """Say that sources of lines are opened, whose first lines show what is not stated."""
    if options["sources"]:
        console.print(f"waiting for the first line of {', then of '.join(options['sources'])}; Ctrl-C ends")


def _rest(value: str | None) -> Tare | float | None:
    """Return what --tare names: the tare of a file, or how long to take a fresh one, s."""
    if value is None:
        return None
    if (seconds := seconds_of(value)) is None:
        from taxel.recording.analysis.rest import tare_of  # noqa: PLC0415  the command line starts quickly

        return tare_of(Path(value))
    if not 1e-6 <= seconds <= 3600:
        raise ProblemError(f"--tare {value}: must be seconds from 1e-6 to 3600, or a file")
    return seconds


#: From this number and this share of all words on, words outside the array mean that the board has another array.
_OUTSIDE, _OUTSIDE_SHARE = 100, 0.01


def outside(counters: dict[str, Any], array: Array) -> str | None:
    """Return a warning if the board has more taxels than `array`, else None."""
    first, second = counters["wire"], counters["wire_v2"]
    beyond = first["outside"] + second["outside"]
    words = first["words"] + second["events"] + second["states"] + second["outside"]
    if beyond < max(_OUTSIDE, _OUTSIDE_SHARE * words):
        return None
    size = f"{array.rows} x {array.columns}"
    return (
        f"{beyond:,} of {words:,} words are of taxels outside {size}, and are dropped: give the board's size by --array"
    )


def doubts(counters: dict[str, Any]) -> Iterator[str]:
    """Yield why the drift or the delays of a board and of each other source cannot be, where they cannot."""
    sources = {"": counters, **counters["sources"]}
    for name, counts in sources.items():
        if (counts.get("pace") or {}).get("doubt"):
            yield f"{name}: {counts['pace']['doubt']}" if name else counts["pace"]["doubt"]


def exit_code(summary: Summary, array: Array) -> int:
    """Return the exit code for what was received and lost."""
    unsent = any(counts["lost"] for counts in summary.counters["sent"])
    is_lost = summary.lost or summary.verdict.lost.get("bytes_in_no_line") or summary.counters["events_dropped"]
    if summary.nothing_came or is_lost or unsent:
        return OUTSIDE
    return WRONG_INPUT if outside(summary.counters, array) else 0


def received(counters: dict[str, Any]) -> str:
    """Return what was received of a source, in words."""
    lines = counters["lines"]
    if lines is None:
        return f"{counted(counters['decoded'], 'datagram')}, {counted(counters['events'], 'event')}"
    unread = {"lines_that_could_not_be_read": lines["strange"], "bytes_in_no_line": lines["bytes_in_no_line"]}
    counts = in_words(unread)
    wrong = f", {counts}" * bool(counts) + (f"; {lines['trouble']}" if lines["trouble"] else "")
    return f"{counted(lines['lines'], 'line')}, {counted(counters['frames'], 'frame')}{wrong}"


#: Kinds of lines that are no part of a frame, by their keys in the counters.
_UNREAD = {
    "text": "of text",
    "other_length": "with another number of values",
    "no_text": "with bytes that are not text: is the speed of the line right?",
    "unfinished_frames": "of frames with missing lines",
    "repeated_stamps": "with a time that is not after the previous time: is a part of the time in another column "
    "(time=A+B for seconds and nanoseconds), or is the unit of the time wrong?",
}


def say_wrong(
    counters: dict[str, Any], array: Array, told: set[tuple[str, str]], readout: Readout | PlainRule | None = None
) -> None:
    """Print what is wrong with what arrives, each once: `told` holds what was; `readout` reads it, if any does."""
    say(*(f"taxel: {line}" for line in _unread(counters, told)), err=True)
    if ("", "outside") not in told and (wrong := outside(counters, array)):
        told.add(("", "outside"))
        say(f"taxel: {wrong}", err=True)
    left = counters["left_floor"]
    if readout is not None and left is not None and ("", "left_floor") not in told:
        told.add(("", "left_floor"))
        say(f"taxel: {left_line(readout, left['since_us'], left['taxels'])}", err=True)


def _unread(counters: dict[str, Any], told: set[tuple[str, str]]) -> Iterator[str]:
    """Yield what is wrong with lines of each source, each kind once: `told` holds those that were."""
    for source, counts in {"": counters, **counters["sources"]}.items():
        kinds = (counts["lines"] or {}).get("unread") or {}
        for kind, words in _UNREAD.items():
            found = kinds.get(kind, {"lines": 0})
            if found["lines"] and (source, kind) not in told:
                told.add((source, kind))
                noun = "frame" if kind == "repeated_stamps" else "line"
                first = f", the first: {shown(found['first'])}" * bool(found["first"])
                yield f"{source + ': ' * bool(source)}{counted(found['lines'], noun)} {words}{first}"


def counters_line(before: dict[str, Any], now: dict[str, Any]) -> str:
    """Return totals, rates since `before` and losses of a board, or of a source of lines, as one line."""
    passed = max(now["seconds"] - before["seconds"], 1e-9)
    lines, pace, verdict = now["lines"], now["pace"], now["verdict"]

    def flow(count: int, earlier: int, noun: str) -> str:
        return f"{count:,} {noun} ({(count - earlier) / passed:,.0f}/s)"

    if lines is not None:
        parts = [flow(lines["lines"], before["lines"]["lines"], "lines")]
        parts.append(flow(now["frames"], before["frames"], "frames"))
    else:
        parts = [flow(now["capture"]["datagrams"], before["capture"]["datagrams"], "datagrams")]
        parts.append(flow(now["events"], before["events"], "events"))
    parts.append(f"LOST: {in_words(verdict['lost'])}" if verdict["lost"] else "nothing lost")
    parts += [f"damaged: {in_words(verdict['damaged'])}"] * bool(verdict["damaged"])
    if now["board_us"] is not None:
        drift = "" if pace is None else f" ({pace['drift_ppm']:+.1f} ppm{', wrong' * bool(pace['doubt'])})"
        parts.append(f"clock {now['board_us'] / 1e6:.2f} s{drift}")
    return ", ".join(parts)
