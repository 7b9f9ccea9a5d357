"""The table of roles: what each column, axis, array or field is, why, and how sure that is; and what is open of it.

It is made once for any file. The one line that says what was assumed, questions, ``taxel info``, the layout file and
the page are views of it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any, TypeAlias

from taxel._base.errors import placed
from taxel._core import FormatError
from taxel.formats.layout import Layout, advice, changed, of_layout, without

#: How sure a role is: it cannot be anything else; it is assumed, and said; nothing is read before it is answered.
SURE, LIKELY, OPEN = "sure", "likely", "open"
#: What an answer changes in a layout: keys of it or of its table, None for those that it states no more; `left` and
#: `read` are columns more or fewer to leave out.
Changes: TypeAlias = Mapping[str, Any]
#: So many first values of a column are shown.
FIRST = 3
_RATE_NOT_SAID = "# rate_hz = 100  # frames per second, which the file does not state"
_MARKS = {SURE: " ", LIKELY: "~", OPEN: "?"}


@dataclass
class Role:
    """Hold what a column of a table, an axis of an array, an array or a field is.

    Parameters
    ----------
    name : str
    first : sequence of str
        Its first values.
    role : str
        "taxel", "time", "label", "counter", "total", "sensor" (which sensor a line is of), "taxel's name", "row",
        "column", "axis" (x, y, z), "trial", or "no taxel".
    why : str
        What shows it.
    certainty : {"sure", "likely", "open"}
    axis, unit, source : str
        "" where there is none.
    """

    name: str
    first: Sequence[str] = ()
    role: str = "taxel"
    why: str = ""
    certainty: str = SURE
    axis: str = ""
    unit: str = ""
    source: str = ""

    @property
    def is_left(self) -> bool:
        """Whether it is none of what is read as values or times."""
        return self.role not in ("taxel", "time")


@dataclass(frozen=True)
class Question:
    """Hold what is open: why, the keys of a layout of which one answers it, and the answers, each with what it says.

    Without an answer nothing is read.
    """

    why: str
    keys: frozenset[str]
    choices: Mapping[str, Changes] = field(default_factory=dict)


#: What is asked of taxels with three axes.
OF_AXES = Question(
    "taxels with the axes x, y and z",
    frozenset({"axis"}),
    {
        'axis = "z"; or "x", "y"': {"axis": "z"},
        'axis = "all": each axis a source': {"axis": "all"},
        'axis = "shear": the length of x and y': {"axis": "shear"},
        'axis = "xyz": all axes as one sensor': {"axis": "xyz"},
    },
)


def of_unit(rates: Mapping[str, float]) -> Question:
    """Return the question which unit times have, by the rate of frames, Hz, in each."""
    choices = {f"{unit}: {hz:.4g} frames/s": {"time_unit": unit} for unit, hz in rates.items()}
    return Question("the unit of the time", frozenset({"time_unit"}), choices)


class OpenRolesError(FormatError):
    """A file cannot be read before questions are answered.

    Attributes
    ----------
    layout : Layout
        The rest of how it is read.
    roles : sequence of Role
    questions : sequence of Question
    """

    layout: Layout
    roles: Sequence[Role]
    questions: Sequence[Question]


def refuse_open(path: Path, about: str, layout: Layout, roles: Sequence[Role], questions: Sequence[Question]) -> None:
    """Refuse a file of which something is open: with the table of its roles, and the layout by each first answer.

    Each layout leaves out the keys of the questions that are still open then.

    Raises
    ------
    OpenRolesError : there is a question (the table and the layouts are below its first line)
    """
    if not questions:
        return
    (why, keys, choices), *others = ((each.why, each.keys, each.choices) for each in questions)
    also = "".join(f"; also open: {other}" for other, _, _ in others)
    ways = f"{about} {len(choices)} ways ({why})" if len(choices) > 1 else why
    later = frozenset[str]().union(*(keys for _, keys, _ in others)) - keys
    lines = [f"# {line}" for line in lines_of(roles)]
    for number, (name, changes) in enumerate(choices.items(), 1):
        full = without(changed(layout, changes), later)
        times = (getattr(full.table, "time_column", None), getattr(full.table, "frame_time", None))
        found = any(role.role == "time" for role in roles) and full.data is not None
        timed = found or any((*times, full.rate_hz, getattr(full.data, "time", None)))
        lines += [f"# {number}. {name}", *([] if timed else [_RATE_NOT_SAID]), of_layout(full)]
    right = advice(path, f"write {'one of these' if len(choices) > 1 else 'this'}")
    error = placed(OpenRolesError(f"{ways}{also}; {right}:", "\n".join(lines).rstrip()), path)
    error.layout, error.roles, error.questions = layout, roles, questions
    raise error


def lines_of(roles: Sequence[Role]) -> Iterator[str]:
    """Yield a table of the roles that are likely or open; of the others a line.

    Examples
    --------
    >>> for line in lines_of([Role("t_ms", ("0", "10"), "time"), Role("s1", ("3", "4")), Role("x", ("5", "6"),
    ...                       why="is named otherwise", certainty="open")]):
    ...     print(line)
      name  first values  role   why
    ? x     5 6           taxel  is named otherwise
      sure: t_ms time; s1 taxel
    """
    doubted = [role for role in roles if role.certainty != SURE]
    shown = list(islice(doubted, 40))
    rows = [("name", "first values", "role", "why")]
    rows += [
        (role.name, " ".join(role.first)[:24], " ".join(filter(None, (role.role, role.axis, role.unit))), role.why)
        for role in shown
    ]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    marks = [" ", *(_MARKS[role.certainty] for role in shown)]
    for mark, row in zip(marks, rows, strict=True):
        yield f"{mark} {'  '.join(map(str.ljust, row, widths))}".rstrip()
    if len(doubted) > len(shown):
        yield f"  and {len(doubted) - len(shown)} more"
    sure: dict[str, list[str]] = {}
    for role in roles:
        if role.certainty == SURE:
            sure.setdefault(role.role, []).append(role.name)
    if sure:
        yield "  sure: " + "; ".join(f"{named(names)} {role}" for role, names in sure.items())


def named(names: Sequence[str]) -> str:
    """Return the first of some names.

    Examples
    --------
    >>> named(["a", "b"]), named("abcdefghij")
    ('a, b', 'a, b, c, d, e, f, g, h, ...')
    """
    return ", ".join(islice(names, 8)) + ", ..." * (len(names) > 8)
