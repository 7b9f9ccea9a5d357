"""The options of the tasks, each declared here and nowhere else: Python, the command line and the page read them.

A field is an option of the command line: its name with hyphens, its default, and the text of the docstring. An
annotation says how it is typed where that differs. What checks values loads slowly, and is imported when it is needed.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from taxel._base.arguments import (
    checked_path,
    finite,
    flag,
    integer,
    mapping,
    parameters,
    several,
    short,
    text,
)
from taxel._base.documents import of_toml
from taxel._base.errors import refused
from taxel._core import FormatError, ProblemError, encoder_names
from taxel.tare import GivenTare, check_absorb, check_tare

if TYPE_CHECKING:
    from taxel.detect import Recipe
    from taxel.encode import ChangeEvents, Encoder
    from taxel.recording import Recording

__all__ = [
    "CalibrateOptions",
    "DetectOptions",
    "EncodeOptions",
    "FullReading",
    "GivenTare",
    "InformationOptions",
    "Reading",
    "Settings",
    "TrainOptions",
]


def settings(_: Any, tokens: Sequence[Any]) -> dict[str, Any]:
    """Return the values of an option KEY=VALUE, such as ``--set``; a VALUE that is not TOML is text."""
    values = {}
    for token in tokens:
        key, equals, value = token.value.partition("=")
        if not equals or not key.strip():
            raise ProblemError(f"{token.keyword} {short(token.value)}: must be KEY=VALUE")
        # People type .5, which TOML has not.
        toml = f"value = {'0' * value.startswith('.')}{value}"
        try:
            values[key.strip()] = of_toml(f"{token.keyword} {short(key.strip())}", toml)["value"]
        except FormatError:
            values[key.strip()] = value.strip()
    return values


def _typed(_: Any, tokens: Sequence[Any]) -> str:
    return str(tokens[0].value)


def _between_commas(number_of: Callable[[str], Any], must: str) -> Callable[[Any, Sequence[Any]], list[Any]]:
    """Return what reads values between commas."""

    def read(_: Any, tokens: Sequence[Any]) -> list[Any]:
        token = tokens[0]
        try:
            return [number_of(cell) for cell in token.value.split(",")]
        except ValueError:
            raise ProblemError(f"{token.keyword} {token.value}: must be {must}") from None

    return read


#: How the parameters of an encoder or a recipe are typed: ``--set KEY=VALUE``, as often as is needed.
Settings = Annotated[
    Mapping[str, Any],
    Parameter(name="--set", metavar="KEY=VALUE", n_tokens=-1, accepts_keys=False, converter=settings),
]
_TypedTare = Annotated[
    GivenTare | None, Parameter(metavar="SECONDS|FILE", n_tokens=1, accepts_keys=False, converter=_typed)
]
_FLOATS = _between_commas(float, "numbers, for example 1,2,5")
_INTS = _between_commas(int, "whole numbers, for example 10,30")
_Path = Annotated[
    str | os.PathLike[str] | None, Parameter(metavar="FILE", n_tokens=1, accepts_keys=False, converter=_typed)
]


def check_shift(shift_ms: float) -> None:
    """Refuse a shift of labels that is not a number of ms within 41 days."""
    finite("shift_ms", shift_ms, least=-3.6e9, most=3.6e9)


def encoder_of(name: str | None, values: Mapping[str, Any]) -> Encoder:
    """Return the encoder of a name with its parameters, of which `name` may be one."""
    from taxel.encode import Encoder  # noqa: PLC0415  loads slowly

    return Encoder.from_json(parameters({**mapping("parameters", values), **({"name": name} if name else {})}))


@dataclass(frozen=True)
class Reading:
    """Hold how recordings are opened.

    Parameters
    ----------
    layout : path, optional
        Layout file with the facts that a recording lacks: sensor, unit, rate, columns of a table. Default:
        NAME.layout.toml or layout.toml beside the recording.
    label_column : str, optional
        Column of a table, or feature of a data set of robots, whose value becomes a label where it changes; it is no
        taxel.

    Examples
    --------
    >>> Reading(label_column="state").words()
    ['--label-column', 'state']
    """

    layout: Annotated[Path | None, Parameter(metavar="FILE")] = None
    label_column: Annotated[str | None, Parameter(metavar="NAME")] = None

    def open_trials(self, path: str | os.PathLike[str]) -> list[Recording]:
        """Open a file or a folder; of a folder, or of another maker's file, all trials in it.

        Raises
        ------
        ProblemError : an `array` that differs from the sensor that a file holds; a `rate_hz` of one with times
        """
        from taxel.recording.opening import open_trials  # noqa: PLC0415  loads slowly

        return open_trials(path, **vars(self))

    def open_sensors(self, paths: Sequence[str | os.PathLike[str]]) -> list[Recording]:
        """Open recordings one after the other; of a folder, or of another maker's file, all trials in it.

        Each sensor of a file with several is a separate recording (`Recording.title`).
        """
        from taxel.recording.opening import sensors  # noqa: PLC0415  loads slowly

        trials = (trial for path in several("paths", paths) for trial in self.open_trials(path))
        return [sensor for trial in trials for sensor in sensors(trial)]

    def open_one(self, path: str | os.PathLike[str]) -> Recording:
        """Open a file that holds one recording.

        Raises
        ------
        ProblemError : it holds several
        """
        recordings = self.open_trials(path)
        if len(recordings) != 1:
            some = ", ".join(recording.name for recording in recordings[:3]) + ", ..." * (len(recordings) > 3)
            raise ProblemError(f"{path}: contains {len(recordings)} recordings ({some}); must contain one")
        return recordings[0]

    def given(self) -> dict[str, Any]:
        """Return the options that differ from their defaults, as JSON holds them."""
        given = {name: value for name, value in vars(self).items() if value not in (None, [], ())}
        return {name: str(value) if isinstance(value, Path) else value for name, value in given.items()}

    def words(self) -> list[str]:
        """Return the options as words of a command line."""
        words: list[str] = []
        for name, value in self.given().items():
            for entry in value if isinstance(value, list | tuple) else [value]:
                words += [f"--{name.replace('_', '-')}", str(entry)]
        return words


@dataclass(frozen=True)
class FullReading(Reading):
    """Hold all that can be said of files that do not hold it themselves.

    Parameters
    ----------
    array : list of str, optional
        Rows, columns and pitch (mm) of the sensor, for example 24x20x5, for files that do not state them (.csv, .lsa,
        ROS bags), and for frames of one row that list these taxels row by row. Default: 64x64x2.67, or a larger array
        if events are outside it; for a bag, the size of its messages. If no pitch is given, it is 2.67 mm for events of
        the board, otherwise unknown.
    topic : list of str, optional
        Open this topic of a ROS bag as frames; taxel info lists the topics. May be repeated: each topic is a source;
        give --field and --array once for all topics, or once for each.
    field : list of str, optional
        The topic's field, for example left.taxels. Default: the only field with numbers.
    ros : str, optional
        The ROS release, for example humble, whose message definitions are used if the bag lacks them.
    region : str, optional
        Read columns A to B - 1 and rows C to D - 1 of an event camera's file, for example 100:420,60:300.
    bin : int, optional
        Side, in pixels of an event camera, of the square that becomes one taxel.
    count_ms : float, ms, optional
        Read an event camera's file as frames of counts, each over this many ms.
    polarity : str, optional
        Which events of an event camera are read: both (default), on or off.
    rate_hz : float, Hz, optional
        Frames per second, for recordings whose frames have no times.

    Examples
    --------
    >>> FullReading(count_ms=2.5, topic=["/palm"]).words()
    ['--topic', '/palm', '--count-ms', '2.5']
    """

    array: Annotated[list[str] | None, Parameter(metavar="ROWSxCOLUMNS[xMM]")] = None
    topic: Annotated[list[str] | None, Parameter(metavar="NAME")] = None
    field: Annotated[list[str] | None, Parameter(metavar="NAME")] = None
    ros: Annotated[str | None, Parameter(metavar="NAME")] = None
    region: Annotated[str | None, Parameter(metavar="A:B,C:D")] = None
    bin: Annotated[int | None, Parameter(metavar="PIXELS")] = None
    count_ms: Annotated[float | None, Parameter(metavar="MS")] = None
    polarity: Annotated[str | None, Parameter(metavar="NAME")] = None
    rate_hz: Annotated[float | None, Parameter(metavar="HZ")] = None


@dataclass(frozen=True)
class TrainOptions:
    """Hold how a readout is trained.

    Parameters
    ----------
    recipe : str, optional
        The recipe to start from. touch: for events of a board, and for frames of a grid if labels are not of steps;
        event_counts: for counts of an event camera; gait_plate, gait_insole, gait_channel: for steps, in counts, in N,
        and in other units. Or the path (with a dot or a slash) of a TOML or JSON file with [encoder] or
        [encoders.NAME], [learner], [neurons.LABEL], run_threshold and align. Default: that of the encoder; without
        one, the recipe that fits the recordings and labels.
    changes : mapping of str to value
        What differs from the recipe (TOML), by dotted keys, as neurons.contact.kappa, encoder.name or align. May be
        repeated.
    tare : Tare, path or float (s), optional
        The rest of the taxels: a saved tare, a recording of the sensor at rest (taxel cut makes one), or the seconds at
        rest at the beginning of each recording. Default: its first quiet half second.
    absorb_s : float, s, optional
        After how many seconds a load that stays becomes rest, in frames of numbers, whose rest follows drift; 0: the
        rest stays as it was measured. Default: 60, but 0 in units of force and pressure and for counts of events,
        and where values fall from their rest.
    folds : int, optional
        Number of folds for scores on held-out data: folds of recordings, or of blocks of time in a single recording;
        0: score on the training data. Default: at most 5, as many as the recordings and the rarest label allow.
    hold_out : str, optional
        A column of the table of labels, or of recordings.csv (with the column recording) beside the recordings: those
        of one person, object or sensor are held out together. Default: person where there is one, else group.
    window_ms : float, ms
        Largest distance of a detection from its event, ms.
    shift_ms : float, ms
        By how many ms all labels are moved before all else, for example if their times are of another clock; later is
        positive.

    Raises
    ------
    ProblemError : values that no recordings and labels could make valid; a recipe that is none

    Examples
    --------
    >>> TrainOptions("touch", {"neurons.contact.kappa": 1.5}, tare=0.05).changes
    {'neurons.contact.kappa': 1.5}
    """

    recipe: str | None = None
    changes: Settings = field(default_factory=dict)
    tare: _TypedTare = None
    absorb_s: float | None = None
    folds: int | None = None
    hold_out: Annotated[str | None, Parameter(metavar="COLUMN")] = None
    window_ms: float = 50.0
    shift_ms: float = 0.0

    def __post_init__(self) -> None:
        """Refuse values that no recordings and labels could make valid, before these are read."""
        mapping("changes", self.changes)
        check_tare(self.tare)
        check_absorb(self.absorb_s)
        check_shift(self.shift_ms)
        finite("window_ms", self.window_ms, least=0.0)
        if self.folds is not None and integer("folds", self.folds, 0) == 1:
            raise refused("folds", " is 1: must be 2 or more, or 0 for none")
        if self.hold_out is not None and not text("hold_out", self.hold_out):
            raise refused("hold_out", " is empty: must name a column")
        self._plan()

    def _plan(self, labels: Sequence[str] | None = None, noise_floor: float | None = None) -> Recipe | None:
        """Return the recipe that is named, or that of the encoder that is; None of neither."""
        if self.recipe is None and "encoder.name" not in self.changes:
            return None
        from taxel.detect import Recipe  # noqa: PLC0415  loads slowly
        from taxel.detect.recipe import change_values, with_floor  # noqa: PLC0415

        if self.recipe is not None:
            return Recipe.load(self.recipe, self.changes, labels, noise_floor)
        values = change_values({}, self.changes)
        return Recipe.from_dict(values if noise_floor is None else with_floor(values, noise_floor))


@dataclass(frozen=True)
class DetectOptions:
    """Hold how events are detected and scored.

    Parameters
    ----------
    tare : Tare, path or float (s), optional
        The rest of the taxels: a saved tare, a recording of the sensor at rest (taxel cut makes one), or the seconds at
        rest at the beginning of each recording. Default: 0 for force and pressure, else the first quiet stretch.
    absorb_s : float, s, optional
        After how many seconds a load that stays becomes rest, in frames of numbers, whose rest follows drift; 0: the
        rest stays as it was measured. Default: as in the training.
    frame_us : float, us, optional
        Length of the board's frame, us. Default: from the registers or the frames, else 192.
    window_ms : float, ms
        Largest distance of a detection from its event, ms.
    shift_ms : float, ms
        By how many ms all labels of the truth are moved before all else, for example if their times are of another
        clock; later is positive.
    use : {"better", "rule", "neuron"}
        What detects each label: better (the better one in training), rule (its plain rule) or neuron. A label with no
        rule is not detected by rule.

    Raises
    ------
    ProblemError : values that no recordings could make valid

    Examples
    --------
    >>> DetectOptions(tare=0.5).window_ms
    50.0
    """

    tare: _TypedTare = None
    absorb_s: float | None = None
    frame_us: float | None = None
    window_ms: float = 50.0
    shift_ms: float = 0.0
    use: Annotated[str, Parameter(metavar="better|rule|neuron")] = "better"

    def __post_init__(self) -> None:
        """Refuse values that no recordings could make valid, before these are read."""
        check_tare(self.tare)
        check_absorb(self.absorb_s)
        finite("frame_us", 1.0 if self.frame_us is None else self.frame_us, least=1.0, most=3.6e9)
        finite("window_ms", self.window_ms, least=0.0)
        check_shift(self.shift_ms)
        if not isinstance(self.use, str) or self.use != "better":
            from taxel.detect.readout import USES  # noqa: PLC0415  loads slowly

            text("use", self.use, USES)


@dataclass(frozen=True)
class EncodeOptions:
    """Hold how a recording is encoded.

    Parameters
    ----------
    encoder : str
        The encoder's name, as "fa1".
    parameters : mapping of str to value
        A parameter of the encoder and its value (TOML); a key with dots sets a nested parameter. May be repeated.
    tare : Tare, path or float (s), optional
        The rest of the taxels: a saved tare, a recording of the sensor at rest (taxel cut makes one), or the seconds at
        rest at the beginning of the recording. Default: 0 of frames in a unit of force or pressure, else none.

    Raises
    ------
    ProblemError : an encoder or parameters that are none

    Examples
    --------
    >>> EncodeOptions("level_crossing", {"levels": [40.0, 80.0]}).encoder
    'level_crossing'
    """

    encoder: Annotated[str, Parameter(metavar="NAME", help=f"The encoder's name, one of {', '.join(encoder_names())}.")]
    parameters: Settings = field(default_factory=dict)
    tare: _TypedTare = None

    def __post_init__(self) -> None:
        """Refuse anything but an encoder, before the recording is read."""
        check_tare(self.tare)
        self._chosen()

    def _chosen(self) -> Encoder:
        """Return the encoder, without the tare."""
        return encoder_of(text("encoder", self.encoder), self.parameters)


@dataclass(frozen=True)
class InformationOptions:
    """Hold how bits are estimated; what is left out is as of `taxel.information.answer`, where each is described.

    Parameters
    ----------
    parameters : mapping of str to value
        A parameter of `taxel.encode.ChangeEvents` and its value (TOML), as noise_floor=5. May be repeated.
    window_ms : float, ms, optional
        Time after contact in which events count, ms; needed if trials have no stop_us.
    windows_ms : sequence of float, ms, optional
        Further windows: times after contact, ms, for example 10,20,50.
    periods_ms : sequence of float, ms, optional
        Sampling periods, ms, for example 1,2,5.
    taxels : sequence of int, optional
        Sizes of subsets of taxels, drawn at random, for example 10,30,100.
    draws : int, 1 or more
        Number of random phases of the sampling; the results are means over these phases.
    shuffles : int, 1 or more
        Number of shuffles of the labels, for the test against zero.
    folds : int, 2 or more
        Number of folds; all trials of a group are in the same fold.
    seed : int, 0 or more
        Seed of the random phases, folds, taxels and bootstrap.

    Raises
    ------
    ProblemError : parameters that change events have not

    Examples
    --------
    >>> InformationOptions(window_ms=50.0).folds
    10
    """

    parameters: Settings = field(default_factory=dict)
    window_ms: Annotated[float | None, Parameter(metavar="MS")] = None
    windows_ms: Annotated[Sequence[float] | None, Parameter(name="--windows", n_tokens=1, converter=_FLOATS)] = None
    periods_ms: Annotated[Sequence[float] | None, Parameter(name="--periods", n_tokens=1, converter=_FLOATS)] = None
    taxels: Annotated[Sequence[int] | None, Parameter(n_tokens=1, converter=_INTS)] = None
    draws: int = 5
    shuffles: int = 20
    folds: int = 10
    seed: int = 0

    def __post_init__(self) -> None:
        """Refuse other parameters, before the recordings are read."""
        self._chosen()

    def _chosen(self) -> ChangeEvents | None:
        """Return the change events that parameters state; None of those which the answer chooses by itself."""
        if not mapping("parameters", self.parameters):
            return None
        encoder = encoder_of("change_events", self.parameters)
        assert encoder.name == "change_events"
        return encoder  # type: ignore[return-value]


@dataclass(frozen=True)
class CalibrateOptions:
    """Hold by what and how readings are calibrated, beside known loads.

    Parameters
    ----------
    table : path, optional
        A .csv of reading,value (above rest). Loads, if given, correct the gain of this table.
    unit : {"N", "kPa"}
        Unit of the calibrated values: N or kPa, at a taxel.
    each : bool
        Fit a gain for each taxel (needs uniform kPa, or loads on single taxels).
    exponent : float, above 0, optional
        A fixed exponent, which is then not fitted.
    tare : Tare, path or float (s), optional
        The rest of the taxels: a saved tare, a recording of the sensor at rest (taxel cut makes one), or the seconds at
        rest at the beginning. Default: that of a quiet stretch.
    date : str, optional
        Date of the calibration, for example 2026-11-21. Default: today.
    note : str
        A note: which sensor, which weights.

    Raises
    ------
    ProblemError : options that contradict each other, or values that are none

    Examples
    --------
    >>> CalibrateOptions(exponent=1.0, unit="kPa").each
    False
    """

    table: _Path = None
    unit: str = "N"
    each: bool = False
    exponent: float | None = None
    tare: _TypedTare = None
    date: str | None = None
    note: str = ""

    def __post_init__(self) -> None:
        """Refuse options that contradict each other, before the recording is read."""
        flag("each", self.each)
        check_tare(self.tare)
        if self.table is not None:
            checked_path("table", self.table)
