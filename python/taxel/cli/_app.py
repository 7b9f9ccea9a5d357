"""What every command is made of: its class, and options that several share."""

from __future__ import annotations

import errno
import functools
import inspect
import re
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, TypeVar

import typer
from typer.core import TyperCommand

from taxel._base.options import with_options
from taxel._core import Error, ProblemError

__all__ = ["OUTSIDE", "STOPPED", "WRONG_INPUT", "App", "SecondsOption", "with_out", "with_typed"]

_KEYWORD = inspect.Parameter.KEYWORD_ONLY
_Typed = TypeVar("_Typed")

#: Exit codes: the user's input is wrong; board, socket or disk; stopped by Ctrl-C.
WRONG_INPUT, OUTSIDE, STOPPED = 2, 3, 130

#: Option of the commands that run until they are stopped.
SecondsOption = Annotated[
    float | None, typer.Option(min=0.001, help="End after this many seconds; without it with Ctrl-C.")
]


class _Command(TyperCommand):
    """A command whose errors name options as they are typed, not as Python's arguments; an example is one line."""

    def __init__(self, *args: Any, help: str | None = None, **options: Any) -> None:  # noqa: A002  typer's name
        paragraphs = [
            # click keeps the lines of a paragraph that begins with \b.
            "\n".join(["\b", *(" ".join(line.split()) for line in re.split(r"\n(?=Example: )", part))])
            if part.startswith("Example: ")
            else part
            for part in (help or "").split("\n\n")
        ]
        super().__init__(*args, help="\n\n".join(paragraphs) or None, **options)

    def invoke(self, ctx: Any) -> Any:
        """Run it."""
        try:
            return super().invoke(ctx)
        except Error as error:
            line, *below = error.args or ("",)
            raise type(error)(self._as_typed(str(line)), *below) from error
        except FileExistsError as error:
            if error.filename is None:
                raise
            replace = "give --overwrite, or name another" if "overwrite" in self._options() else "name another"
            raise FileExistsError(errno.EEXIST, f"exists already; {replace}", error.filename) from error

    def _options(self) -> dict[str, str]:
        """Return what is typed for each parameter: --readout-events for readout_events, FILE for file."""
        return {
            p.name: max(p.opts, key=len) if p.param_type_name == "option" else p.name.upper()
            for p in self.params
            if p.name is not None
        }

    def _as_typed(self, text: str) -> str:
        """Return an error's text with the option in place of Python's argument."""
        options = self._options()
        # The argument `registers` can be typed as a preset only.
        options |= {"registers": options["preset"]} if "preset" in options else {}
        first = re.match(r"(\w+)(?=: | is )", text)
        if first and first[1] in options:
            text = options[first[1]] + text[first.end() :]
        if "tare" in options:
            text = re.sub(r"without a tare: .*", "without the taxels' rest: give --tare SECONDS or --tare FILE", text)
        if "rate_hz" in options:
            text = text.replace(", says what it is", f", or {options['rate_hz']} HZ, says what it is")
        if "--set" in options.values():
            text = re.sub(r"^(encoder \w+: (\w+) is missing)$", r"\1; give --set \2=...", text)
            text = re.sub(r"( ([\d.]+) ms after the last: .* period_ms, .*)$", r"\1; give --set period_ms=\2", text)
        return f"{text}{_laid_out(text)}" if "array" in options else text


def _laid_out(text: str) -> str:
    """Return what an error lacks that refuses a row of channels: the option that lays them out; else ""."""
    option = "; give --array {}, or rows and columns in a layout file, if they are a grid's taxels row by row"
    if re.search(r"\d+ x \d+ channels without a pitch$", text):
        return option.format("ROWSxCOLUMNS")
    trained = re.search(r"an array of 1 x (\d+) taxels: the readout was trained on (\d+) x (\d+)$", text)
    if trained and int(trained[1]) == int(trained[2]) * int(trained[3]):
        if trained[2] == "1":
            return f"; give --array 1x{trained[3]}xMM, MM the distance of the channels, or pitch_mm in a layout file"
        return option.format(f"{trained[2]}x{trained[3]}")
    return ""


class App(typer.Typer):
    """A group of such commands: no colours, no completion, no traceback of its own."""

    def __init__(self, **options: Any) -> None:
        plain: dict[str, Any] = {
            "add_completion": False,
            "pretty_exceptions_enable": False,
            "rich_markup_mode": None,
            "context_settings": {"help_option_names": ["-h", "--help"]},
        }
        super().__init__(**(plain | options))

    def command(self, *names: Any, **options: Any) -> Callable[[Any], Any]:
        """Register a command."""
        return super().command(*names, **{"cls": _Command, **options})


def with_typed(options: type[_Typed]) -> Callable[[Callable[[_Typed], None]], Callable[..., None]]:
    """Return a decorator that gives a command the fields of a dataclass as its arguments and options."""

    def decorate(work: Callable[[_Typed], None]) -> Callable[..., None]:
        command = with_options(options)(work)
        # typer reads annotations, not their text.
        command.__signature__ = inspect.signature(options, eval_str=True)  # type: ignore[attr-defined]
        return command

    return decorate


def with_out(name: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Return a decorator that lets ``-o`` say where output goes too, which a command's argument `name` says."""
    upper = name.upper()
    out = Annotated[Path | None, typer.Option("--out", "-o", metavar=upper, help=f"The same as {upper}.")]

    def decorate(work: Callable[..., None]) -> Callable[..., None]:
        own = dict(inspect.signature(work, eval_str=True).parameters)
        own[name] = own[name].replace(default=None, annotation=_or_none(own[name].annotation))

        def command(ctx: typer.Context, typed_out: Path | None, **typed: Any) -> None:
            if typed_out is None and typed[name] is None:
                raise ProblemError(f"{upper} is missing; see {ctx.command_path} --help")
            if typed_out is not None and typed[name] is not None:
                raise ProblemError(f"{upper} is given twice: {typed[name]} and {typed_out}")
            work(**{**typed, name: typed[name] or typed_out})

        functools.update_wrapper(command, work)
        more = {"ctx": typer.Context, "typed_out": out}
        own |= {key: inspect.Parameter(key, _KEYWORD, default=None, annotation=kind) for key, kind in more.items()}
        command.__signature__ = inspect.Signature([one.replace(kind=_KEYWORD) for one in own.values()])  # type: ignore[attr-defined]
        command.__annotations__ = {}  # those of `work`, which the signature replaces
        return command

    return decorate


def _or_none(annotation: Any) -> Any:
    """Return the annotation of an argument that may be left out."""
    return Annotated[annotation.__origin__ | None, *annotation.__metadata__]
