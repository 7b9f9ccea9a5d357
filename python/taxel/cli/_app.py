"""Parts of every command: its class, and options that several share."""

from __future__ import annotations

import errno
import functools
import inspect
import re
from collections.abc import Callable, Iterable
from dataclasses import is_dataclass
from itertools import chain
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand

from taxel._core import Error, ProblemError

#: Arguments of Python that are typed as another option.
_TYPED_AS = {"registers": "preset"}

#: Exit codes: the user's input is wrong; board, socket or disk; stopped by Ctrl-C.
WRONG_INPUT, OUTSIDE, STOPPED = 2, 3, 130

#: Option of the commands that run until they are stopped.
SecondsOption = Annotated[
    float | None, typer.Option(min=0.001, help="End after this many seconds. Default: end with Ctrl-C.")
]


#: What a command prints, and whether it may replace what it writes.
JsonOption = Annotated[bool, typer.Option("--json", help="Print the result as JSON.")]
OverwriteOption = Annotated[bool, typer.Option("--overwrite", help="Replace output files that exist already.")]


#: What can be done instead of giving an option twice.
_INSTEAD = {
    "--readout": "; a command uses one readout: train one readout on the labels of both, or record the data and run "
    "taxel detect once with each"
}


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

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse what is typed; refuse an option of one value that is given twice, of which click takes the last."""
        self._check_repeated(ctx, args)
        return super().parse_args(ctx, args)

    def _check_repeated(self, ctx: Any, args: list[str]) -> None:
        parser: Any = self.make_parser(ctx)
        single = [o for o in {**parser._short_opt, **parser._long_opt}.values() if o.action == "store"]
        for option in single:
            option.action = "append"
        typed, _, _ = parser.parse_args(list(args))
        for option in single:
            if len(values := typed.get(option.dest, ())) > 1:
                name = max(option.obj.opts, key=len)
                raise ProblemError(f"{name} is given twice: {values[0]} and {values[1]}{_INSTEAD.get(name, '')}")

    def invoke(self, ctx: Any) -> Any:
        """Run it."""
        try:
            return super().invoke(ctx)
        except Error as error:
            if error.argument is not None:
                error.argument = self._typed(error.argument, with_value=error.hint is not None)
            raise
        except FileExistsError as error:
            if error.filename is None:
                raise
            replace = "give --overwrite, or another name" if "overwrite" in self._options() else "give another name"
            raise FileExistsError(errno.EEXIST, f"exists already; {replace}", error.filename) from error

    def _options(self) -> dict[str, Any]:
        """Return the options and arguments by the name of what they are in Python."""
        options = {p.name: p for p in self.params if p.name is not None and "--set" not in p.opts}
        return options | {python: options[name] for python, name in _TYPED_AS.items() if name in options}

    def _typed(self, argument: str, *, with_value: bool) -> str:
        """Return what is typed for an argument of Python: --readout-events for readout_events, FILE for file."""
        found = self._options().get(argument)
        if found is None:
            # Parameters of an encoder or a recipe have no options of their own.
            takes_parameters = any("--set" in p.opts for p in self.params)
            return f"--set {argument}{'=VALUE' * with_value}" if takes_parameters else argument
        if found.param_type_name != "option":
            return argument.upper()
        # A bar would be a pipe of the shell.
        value = f" {found.metavar}".replace("|", " or ") if with_value and found.metavar else ""
        return str(max(found.opts, key=len)) + value


class App(typer.Typer):
    """A group of such commands: without colours, completion or tracebacks."""

    def __init__(self, **options: Any) -> None:
        plain: dict[str, Any] = {
            "add_completion": False,
            "pretty_exceptions_enable": False,
            "rich_markup_mode": None,
            "context_settings": {"help_option_names": ["-h", "--help"]},
        }
        super().__init__(**(plain | options))

    def command(self, *names: Any, **options: Any) -> Callable[[Any], Any]:
        """Register a command, whose arguments of a dataclass are given by an option for each field."""
        register = super().command(*names, **{"cls": _Command, **options})
        return lambda work: register(_with_fields(work))


def as_command(
    call: Callable[..., None], work: Callable[..., None], parameters: Iterable[inspect.Parameter]
) -> Callable[..., None]:
    """Return `call` as the command that `work` is, but with these parameters: options may come before arguments."""
    functools.update_wrapper(call, work)
    keywords = [parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY) for parameter in parameters]
    call.__signature__ = inspect.Signature(keywords)  # type: ignore[attr-defined]
    call.__annotations__ = {}  # those of `work`, which the signature replaces
    return call


def _with_fields(work: Callable[..., None]) -> Callable[..., None]:
    """Return a command with the fields of each dataclass that it takes in place of that argument."""
    parameters = inspect.signature(work, eval_str=True).parameters
    groups: dict[str, Any] = {
        name: parameter.annotation for name, parameter in parameters.items() if is_dataclass(parameter.annotation)
    }
    if not groups:
        return work
    fields = {name: inspect.signature(group, eval_str=True).parameters for name, group in groups.items()}

    def call(**typed: Any) -> None:
        options = {name: group(**{field: typed.pop(field) for field in fields[name]}) for name, group in groups.items()}
        work(**typed, **options)

    each = [fields[name].values() if name in fields else [parameter] for name, parameter in parameters.items()]
    return as_command(call, work, chain.from_iterable(each))


def with_out(name: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Return a decorator that lets ``-o`` say where output goes too, which a command's argument `name` says."""
    upper = name.upper()
    out = Annotated[Path | None, typer.Option("--out", "-o", metavar=upper, help=f"The same as {upper}.")]

    def decorate(work: Callable[..., None]) -> Callable[..., None]:
        parameters = dict(inspect.signature(work, eval_str=True).parameters)
        parameters[name] = parameters[name].replace(default=None, annotation=_or_none(parameters[name].annotation))

        def call(ctx: typer.Context, typed_out: Path | None, **typed: Any) -> None:
            if typed_out is None and typed[name] is None:
                raise ProblemError(f"{upper} is missing; see {ctx.command_path} --help")
            if typed_out is not None and typed[name] is not None:
                raise ProblemError(f"{upper} is given twice: {typed[name]} and {typed_out}")
            work(**{**typed, name: typed[name] or typed_out})

        more = {"ctx": typer.Context, "typed_out": out}
        keyword = inspect.Parameter.KEYWORD_ONLY
        parameters |= {
            key: inspect.Parameter(key, keyword, default=None, annotation=kind) for key, kind in more.items()
        }
        return as_command(call, work, parameters.values())

    return decorate


def _or_none(annotation: Any) -> Any:
    """Return the annotation of an argument that may be left out."""
    return Annotated[annotation.__origin__ | None, *annotation.__metadata__]
