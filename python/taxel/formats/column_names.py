"""What the names of columns say: times and their unit, counters, labels, other quantities, units, sides and axes."""

from __future__ import annotations

import re
from collections.abc import Sequence

AXES = ("x", "y", "z")
#: What a layout may say of them.
AXIS_CHOICES = (*AXES, "shear", "all", "xyz")

#: Units of time as people write them.
_UNITS_OF_TIME = {
    "s": ("s", "sec", "secs", "second", "seconds", "sek", "sekunden"),
    "ms": ("ms", "msec", "millis", "milliseconds", "millisekunden"),
    "us": ("us", "µs", "μs", "usec", "micros", "microseconds"),
    "ns": ("ns", "nsec", "nanos", "nanosec", "nanosecs", "nanoseconds", "nsecs"),
    "min": ("min", "minute", "minutes", "minuten"),
    "h": ("h", "hour", "hours", "stunden"),
    "d": ("day", "days", "tage", "datenum"),
}
_UNIT_OF_TIME = "|".join(word for words in _UNITS_OF_TIME.values() for word in words)
#: Those that are nothing else: a name may end in [min] for the least value.
_SHORT_UNIT_OF_TIME = "|".join(_UNITS_OF_TIME[unit][k] for unit in ("s", "ms", "us", "ns") for k in (0, 1))
#: What people call times, in some languages.
_TIME = (
    r"t|ts|(?:%|rel|abs|host|device|sample|frame|recv|unix|epoch|system|header)?[ ._]*(?:time|stamp|time[ _]?stamp)s?"
    r"|elapsed(?:[ _]time)?|(?:mess|uhr|system)?zeit(?:stempel|punkt)?|temps|tiempo|tempo|tijd|tid"
    r"|datetime|date[ _]time|epoch|clock|ticks?|millis|micros|ms|msec|us|usec|n(?:ano)?secs?|secs?|seconds|sekunden"
    r"|datenum"
)
#: Names of columns that hold times, with or without a unit: time, timestamp_us, Time (ms), t [s].
_TIMES = re.compile(
    rf"(?:{_TIME})"
    rf"(?:[ _.]*[\[(/] *(?P<within>{_UNIT_OF_TIME}) *[\])]?|(?:, *(?:in )?| in |[ _.]+)(?P<after>{_UNIT_OF_TIME}))?",
    re.IGNORECASE,
)
#: A name of any language with a unit of time: 時間(ms), Czas [s]; but not Sensor(s).
_WITH_UNIT_OF_TIME = re.compile(
    rf".*?(?:\[ *(?P<square>{_SHORT_UNIT_OF_TIME}) *\]|(?<![a-z])\( *(?P<round>{_SHORT_UNIT_OF_TIME}) *\))",
    re.IGNORECASE,
)
#: A name with the word: SampleTimeFine, time_of_board.
_WITH_WORD = re.compile(r".*?(?:\b|_|(?<=[a-z]))(?:[Tt]ime|TIME|[Tt]imestamp|[Zz]eit)(?:\b|_|(?=[A-Z])).*")

_TAXEL = r"sensor|channel|taxel|cell|electrode|node|pad"
#: What columns are that hold no readings, by what they are called.
_KINDS = {
    "counter": r"(?:frame|sample|record|packet|line|row|msg|message)?[ ._]*"
    r"(?:seq(?:uence)?|frames?|index|idx|samples?|records?|id|no|nr|num|number|count(?:er)?|#|bild|lfd)[ ._]*"
    r"(?:nr|no|num|number|id|#|count(?:er)?|index)?\.?",
    "label": r"(?:.*[ ._])?(?:labels?|class(?:es)?|slip|slipped|slipping|contact|in_contact|touch(?:ed)?|state|status|"
    r"flags?|targets?|events?|phase|annotations?|markers?|trigger|ground[ _]?truth|gt|activity|gesture|grasp(?:ed)?)"
    r"(?:[ ._](?:id|label|class|code))?",
    "taxel": rf"(?:{_TAXEL})(?:[ ._]?(?:id|name|no|nr))?",
    "sensor": rf"(?:{_TAXEL}|hand|foot|side|finger|device|board|insole|limb|topic|source|module"
    r"|trial|session|run|subject|person|participant|versuch|proband)(?:[ ._]?(?:id|name|no|nr))?",
    # A lateral sensor of a foot is no latitude.
    "other": r"(?:[agm][ ._]?[xyz])|(?:g[pn]ss?[ ._])?(?:lat|lon)|(?:.*[ ._])?"
    r"(?:acc(?:el(?:eration)?)?|gyro?(?:scope)?|mag(?:netometer)?|imu|temp(?:erature)?|temperatur|"
    r"(?:total|sum|net|mean|avg|average|summe|gesamt)[ ._-]?(?:force|load|weight|pressure|kraft|last|druck)|"
    r"batt?(?:ery)?|akku|vbat|hum(?:idity)?|latitude|longitude|quat(?:ernion)?|roll|pitch|yaw|crc|checksum|cop|total|sum|summe)"
    r"(?:[ ._\[(]*(?:x|y|z|w|\d+)[\])]?)?(?:[ ._]?[\[(][^\])]*[\])])?",
}
#: A cell that says a unit, as N, [kPa] or (m/s^2).
_UNITS = re.compile(r"[\[(]?[^\d\s\[\]()]{0,8}[²³2]?[\])]?")
#: A unit of a force, a pressure or a voltage that ends a name behind a low line, "in" or alone: thumb_mN, mV.
_BARE = r"[mk]?N|kgf?|gf|[hkM]?Pa|m?bar|psi|mmHg|[mµu]?V"
_BARE_UNIT = re.compile(rf"(?:^|(?<=_)|(?<= in ))({_BARE})$")
#: A unit behind the number of a cell: 12.3N, 5 ms.
UNIT_BEHIND = re.compile(rf"(?<=\d) ?({_BARE}|{_SHORT_UNIT_OF_TIME}|min|N/cm[2²]|%|°C|g|mm)(?![\w/])")
_IN_BRACKETS = re.compile(r"[\[(]\s*([^\s\d\[\]()][^\s\[\]()]{0,7})\s*[\])]$")
#: Units of forces, of pressures and of counts, and of other quantities.
FORCES = re.compile(r"[mk]?N|kgf?|gf?|[hkM]?Pa|m?bar|psi|N/(?:cm|mm|m)[²2]|mmHg|counts|raw|adc", re.IGNORECASE)
OTHER_UNITS = re.compile(r"°[CF]?|deg(?:/s)?|rad(?:/s)?|dps|m/s(?:\^?[2²])?|Hz|bpm", re.IGNORECASE)
_AXIS = re.compile(r"(.+?)[ _.\-]?[\[(]?([xyzXYZ])[\])]?(?: *[\[(][^\])]*[\])])?")
_AXIS_OF_LIST = re.compile(r"(.+)\[([012])\]")
_PLACE = re.compile(r"\D*?(\d+)\D+(\d+)\D*")


def time_unit(name: str) -> str | None:
    """Return the unit of time that the name of a column or an array states, "" if none; None of another name.

    Examples
    --------
    >>> time_unit("Time (ms)"), time_unit("run1/time"), time_unit("stamp.sec"), time_unit("palm")
    ('ms', '', 's', None)
    """
    last = last_part(name)
    found = _TIMES.fullmatch(last)
    if found is not None:
        word = (found["within"] or found["after"] or last).lower()
    else:
        of_any = _WITH_UNIT_OF_TIME.fullmatch(name)
        if of_any is None:
            return None if _WITH_WORD.fullmatch(name) is None else ""
        word = (of_any["square"] or of_any["round"]).lower()
    return next((unit for unit, words in _UNITS_OF_TIME.items() if word in words), "")


def is_time(name: str) -> bool:
    """Return whether a column is called a time; a duration may have a unit of time too.

    Examples
    --------
    >>> is_time("Time (ms)"), is_time("Kontakt [ms]"), time_unit("Kontakt [ms]"), time_unit("Sensor(s)")
    (True, False, 'ms', None)
    """
    return _TIMES.fullmatch(last_part(name)) is not None


def last_part(name: str) -> str:
    """Return the last part of a path within a file or a message: header.seq, run1/time."""
    return re.split(r"[/.](?=[^\W\d])", name.strip("\"' "))[-1]


def says(kind: str, name: str) -> bool:
    """Return whether the name of a column says that it is of a kind.

    Parameters
    ----------
    kind : {"counter", "label", "sensor", "taxel", "other"}
        "counter" numbers the lines; "label" holds labels or states; "sensor" says which sensor a line is of, and
        "taxel" which taxel, if each has one reading a line; "other" is of another quantity than force or pressure.
    name : str

    Examples
    --------
    >>> says("counter", "sample_no"), says("label", "contact state"), says("sensor", "hand"), says("other", "acc_x")
    (True, True, True, True)
    """
    return re.fullmatch(_KINDS[kind], last_part(name), re.IGNORECASE) is not None


def unit_of(name: str) -> str:
    """Return the unit of readings that the name of a column states; "" if none.

    Examples
    --------
    >>> unit_of("Heel [N]"), unit_of("thumb_mN"), unit_of("acc (m/s2)"), unit_of("p[0]"), unit_of("thumb")
    ('N', 'mN', 'm/s2', '', '')
    """
    found = _IN_BRACKETS.search(name) or _BARE_UNIT.search(name)
    return "" if found is None or found[1].lower() in AXES else found[1]


def are_units(names: Sequence[str], below: Sequence[str]) -> bool:
    """Return whether the cells below names say units: each of a name, none a number or the name of times.

    Examples
    --------
    >>> are_units(["time", "thumb"], ["[ms]", "N"]), are_units(["time", "thumb"], ["2024-05-01", "0.5"])
    (True, False)
    >>> are_units(["Trial 1", ""], ["time", "thumb"])
    False
    """
    are_texts = any(map(str.isalpha, "".join(below))) and all(_UNITS.fullmatch(cell) for cell in below)
    pairs = list(zip(names, below, strict=False))
    return are_texts and all(name for name, cell in pairs if cell) and not any(map(time_unit, below[1:]))


def axes_of(names: Sequence[str]) -> dict[str, dict[str, int]] | None:
    """Return the columns of each taxel by their axis, if all names are of taxels with three axes; else None.

    Examples
    --------
    >>> axes_of(["l0_x", "l0_y", "l0_z"])
    {'l0': {'x': 0, 'y': 1, 'z': 2}}
    >>> axes_of(["left[0][0]", "left[0][1]", "left[0][2]"]), axes_of(["x", "y", "z"]), axes_of(["p[0]", "p[1]", "p[2]"])
    ({'left[0]': {'x': 0, 'y': 1, 'z': 2}}, {'': {'x': 0, 'y': 1, 'z': 2}}, None)
    """
    found: dict[str, dict[str, int]] = {}
    for k, name in enumerate(names):
        if of_list := _AXIS_OF_LIST.fullmatch(name):
            stem, axis = of_list[1], AXES[int(of_list[2])]
        elif name.lower() in AXES:
            stem, axis = "", name.lower()
        elif of_name := _AXIS.fullmatch(name):
            stem, axis = of_name[1], of_name[2].lower()
        else:
            return None
        if axis in found.setdefault(stem, {}):
            return None
        found[stem][axis] = k
    # A single list of three numbers is one of three taxels.
    is_list = len(found) == 1 and all(map(_AXIS_OF_LIST.fullmatch, names)) and not next(iter(found)).endswith("]")
    return found if found and not is_list and all(len(axes) == len(AXES) for axes in found.values()) else None


def places_of(names: Sequence[str]) -> tuple[int, int] | None:
    """Return the rows and columns of names with two numbers each that run row by row; else None.

    Examples
    --------
    >>> places_of(["r0c0", "r0c1", "r1c0", "r1c1"]), places_of(["p[0][0]", "p[0][1]"]), places_of(["a1", "a2"])
    ((2, 2), (1, 2), None)
    """
    found = [_PLACE.fullmatch(name) for name in names]
    pairs = [(int(place[1]), int(place[2])) for place in found if place is not None]
    if not pairs or len(pairs) != len(names):
        return None
    (top, left), (bottom, right) = pairs[0], pairs[-1]
    rows, columns = bottom - top + 1, right - left + 1
    expected = [(row, column) for row in range(top, bottom + 1) for column in range(left, right + 1)]
    return (rows, columns) if pairs == expected else None
