"""Parts of every command: its app, its page of help, and the line that says what was typed wrongly.

A command is a module with an `App`; its arguments and options are those of a function, and the fields of frozen
dataclasses that it takes (`Flat`). Their texts are the section Parameters of the docstrings.
"""

from __future__ import annotations

import contextlib
import inspect
import re
import shutil
import textwrap
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, TypeVar, get_args

import cyclopts
from cyclopts import Parameter

from taxel._base.arguments import finite, integer, shown
from taxel._core import ProblemError
from taxel.cli._say import WIDTH, say, table

__all__ = [
    "OUTSIDE",
    "STOPPED",
    "WRONG_INPUT",
    "App",
    "Flat",
    "JsonOption",
    "Limits",
    "SecondsOption",
    "say",
]

_T = TypeVar("_T")

#: Exit codes: the user's input is wrong; board, socket or disk; stopped by Ctrl-C.
WRONG_INPUT, OUTSIDE, STOPPED = 2, 3, 130

#: A frozen dataclass of options: each field is an option, with the text of the docstring.
Flat = Annotated[_T, Parameter(name="*")]

#: What commands that open recordings take from a layout file, and the command that converts as an option.
_OF_LAYOUTS = ("array", "rate_hz", "topic", "field", "count_ms")
#: What stands for a value on a page of help.
_VALUES = {int: "NUMBER", float: "NUMBER", Path: "FILE"}


@dataclass(frozen=True)
class Limits:
    """Refuse numbers outside a range, in the words of the checks of all arguments.

    Parameters
    ----------
    least, most : float, optional
    """

    least: float | None = None
    most: float | None = None

    def __call__(self, kind: Any, value: Any) -> None:
        """Refuse a number that is not within them; what is no number passes."""
        if isinstance(value, int | float) and not isinstance(value, bool):
            self.check("it", value, kind)

    def check(self, name: str, value: Any, kind: Any) -> None:
        """Refuse a value of an option of this name."""
        limits = {key: end for key, end in vars(self).items() if end is not None}
        try:
            (integer if kind is int else finite)(name, value, **limits)
        except ProblemError as error:
            raise ValueError(str(error)) from None


#: Option of the commands that print a result.
JsonOption = Annotated[bool, Parameter(name="--json", help="Print the result as JSON.")]
#: Option of the commands that run until they are stopped.
SecondsOption = Annotated[
    float | None,
    Parameter(name="--seconds", validator=Limits(0.001), help="End after this many seconds. Default: end with Ctrl-C."),
]


class App(cyclopts.App):
    """A command, or a group of them; `taxel.cli` prints its page of help."""

    def __init__(self, **options: Any) -> None:
        plain: dict[str, Any] = {"help_flags": (), "version_flags": (), "default_parameter": Parameter(negative=())}
        super().__init__(**(plain | options))


@dataclass(frozen=True)
class Row:
    """Hold what a page of help says of an argument or an option."""

    names: tuple[str, ...]
    value: str
    about: str
    is_argument: bool
    is_required: bool


def rows(app: cyclopts.App) -> list[Row]:
    """Return the arguments and options of a command."""
    if app.default_command is None:
        return []
    collection = app.assemble_argument_collection(parse_docstring=True)
    return [_row(argument) for argument in collection.filter_by(show=True)]


def _row(argument: Any) -> Row:
    is_argument = argument.index is not None
    names = tuple(name for name in argument.names if name.startswith("-"))
    if is_argument:
        several = "..." * argument.token_count()[1]
        names = (argument.field_info.name.upper() + several, *names)
    about, default = " ".join((argument.parameter.help or "").split()), argument.field_info.default
    if isinstance(default, str | int | float | Path) and not isinstance(default, bool) and default != "":
        about = f"{about} [default: {default}]".lstrip()
    return Row(names, "" if is_argument else _value(argument), about, is_argument, argument.required)


def _value(argument: Any) -> str:
    """Return what stands for the value of an option; "" of a flag."""
    kind = argument.resolved_hint
    if kind is bool:
        return ""
    return argument.parameter.metavar or _VALUES.get(next(iter(get_args(kind)), kind), "TEXT")


def about(app: cyclopts.App) -> list[str]:
    """Return the paragraphs that say what a command does; of an example each line stays."""
    text = re.split(r"\nParameters\n-+\n", inspect.cleandoc(app.help or ""))[0]
    paragraphs = re.split(r"\n\n+", text.strip())
    return [part if part.startswith("Example: ") else " ".join(part.split()) for part in paragraphs]


def own_commands(app: cyclopts.App) -> dict[str, cyclopts.App]:
    """Return the commands of a group, by name, that its page of help shows."""
    return {name: app[name] for name in app if not name.startswith("-") and app[name].show}


def page(app: cyclopts.App, path: str) -> list[str]:
    """Return a page of help as lines."""
    width = min(WIDTH, shutil.get_terminal_size().columns)
    each = rows(app)
    arguments, options = ([row for row in each if row.is_argument is kind] for kind in (True, False))
    named = (row.names[0] if row.is_required else f"[{row.names[0]}]" for row in arguments)
    usage = [*["[OPTIONS]"] * bool(options), *named]
    lines = [" ".join(["Usage:", path, *usage, *["COMMAND"] * bool(own_commands(app))])]
    for part in about(app):
        example = part.startswith("Example: ")
        lines += ["", *(part.splitlines() if example else textwrap.wrap(part, width))]
    for title, some in (("Arguments", arguments), ("Options", options)):
        cells = [(f"{', '.join(row.names)} {row.value}".rstrip(), row.about) for row in some]
        lines += table(title, cells, width)
    listed = [(name, about(one)[0]) for name, one in own_commands(app).items()]
    return [*lines, *table("Commands", listed, width)]


def typed(app: cyclopts.App, argument: str, *, with_value: bool) -> str:
    """Return what is typed for an argument of Python: --window-ms for window_ms, FILE for file."""
    options = {one.field_info.name: one for one in app.assemble_argument_collection()}
    found = options.get(argument)
    if found is None:
        if argument in _OF_LAYOUTS and "layout" in options:
            option = argument.replace("_", "-")
            return f"{argument} in a layout file, or convert the recording by taxel convert --{option}"
        # Parameters of an encoder or a recipe have no options of their own.
        takes_parameters = any("--set" in one.names for one in options.values())
        return f"--set {argument}{'=VALUE' * with_value}" if takes_parameters else argument
    if found.index is not None:
        return argument.upper()
    # A bar would be a pipe of the shell.
    value = f" {found.parameter.metavar}".replace("|", " or ") if with_value and found.parameter.metavar else ""
    return str(found.name) + value


def said(error: cyclopts.CycloptsError, path: str) -> str:
    """Return what is wrong with a command line: in the words of our own checks where a number is."""
    argument: Any = error.argument
    line = str(error).rstrip(".")
    if isinstance(error, cyclopts.RepeatArgumentError):
        line = f"{error.token.keyword} is given twice"
    elif isinstance(error, cyclopts.UnusedCliTokensError):
        line = f"{' '.join(error.unused_tokens or ())}: one argument too many"
    elif argument is not None:
        name = argument.field_info.name.upper() if argument.index is not None else max(argument.names, key=len)
        if isinstance(error, cyclopts.MissingArgumentError):
            line = f"{name}: needs a value" if error.keyword else f"{name} is missing"
        elif argument.tokens and (wrong := _wrong(name, argument, argument.tokens[-1].value)):
            return wrong
    return f"{line}; see {path} --help"


def _wrong(name: str, argument: Any, value: Any) -> str:
    """Return why a value is no number, or not within the limits of its option; "" of other options."""
    kind = argument.resolved_hint
    if kind not in (int, float):
        return ""
    with contextlib.suppress(ValueError):
        value = float(value)
    limits = next((one for one in argument.parameter.validator if isinstance(one, Limits)), Limits())
    try:
        limits.check(name, value, kind)
    except ValueError as error:
        return str(error)
    return f"{name} is {shown(value)}: must be another number"
