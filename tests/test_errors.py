"""Errors name their argument and their remedy as data; the command line puts its options in the place of arguments."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from shell import commands

import taxel
from taxel import _core
from taxel._base.arguments import finite, integer
from taxel._base.errors import Place, helped, placed, refused
from taxel._base.parameters import described
from taxel.cli import main
from taxel.cli.app import Limits

#: Values of encoders' parameters that have no default.
REQUIRED = {"levels": "[1.0]"}


def line_of(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """The one line of a command whose input is wrong."""
    with pytest.raises(SystemExit) as ended:
        main([*map(str, arguments)])
    assert ended.value.code == 2
    [line] = capsys.readouterr().err.splitlines()
    return line.removeprefix("taxel: ")


@pytest.mark.parametrize("kind", [taxel.FormatError, taxel.ProblemError, taxel.DeviceError, taxel.SceneError])
def test_an_error_shows_its_argument_once(kind: type[taxel.Error]) -> None:
    plain = kind("a.csv: is empty")
    assert (str(plain), plain.argument, plain.hint) == ("a.csv: is empty", None, None)
    wrong = refused("lambdas[2]", " is -1: must be 0 or more")
    assert (str(wrong), wrong.argument) == ("lambdas[2] is -1: must be 0 or more", "lambdas")
    lacking = helped(kind("a.csv: has no times"), "rate_hz", "give")
    assert str(lacking) == "a.csv: has no times; give rate_hz"
    for error in (plain, wrong, lacking, placed(copy.copy(lacking), "a.csv", line=3)):
        for again in (copy.copy(error), pickle.loads(pickle.dumps(error))):
            assert type(again) is type(error)
            assert (str(again), vars(again)) == (str(error), vars(error))


def test_the_text_of_an_error_begins_with_its_place() -> None:
    for error in (taxel.SceneError("is wrong"), refused("rows", " is 0"), helped(taxel.Error("no"), "rate_hz", "give")):
        said = str(error)
        of_text = placed(error, line=3)
        assert str(of_text) == f"line 3: {said}"
        of_file = placed(of_text, Path("a.csv"), byte=12)
        assert of_file is error
        assert of_file.place == Place("a.csv", line=3), "what an error knows of its place stays"
        assert str(placed(of_file, "b.zip")) == f"a.csv, line 3: {said}"


def test_errors_of_files_texts_and_bytes_have_their_place(tmp_path: Path) -> None:
    file = tmp_path / "a.json"
    file.write_text('{\n"array": x}')
    table = tmp_path / "found.csv"
    table.write_text("label,t_us,known_us,slope_mv_per_ms\na,1,2,soon\n")
    for call, place in (
        (lambda: taxel.Tare.load(file), Place(str(file), line=2)),
        (lambda: taxel.Calibration.load(file), Place(str(file), line=2)),
        (lambda: taxel.Calibration.from_json(file.read_text()), Place(line=2)),
        (lambda: taxel.simulate.SceneFile.open(file), Place(str(file), line=1)),
        (lambda: taxel.Detections.from_csv(table), Place(str(table), line=2)),
        (lambda: taxel.wire.Command.from_bytes(bytes([0x80, 0, 0x80, 0, 0])), Place(byte=2)),
        (lambda: taxel.SpikeTrains.load(file), Place(str(file))),
    ):
        with pytest.raises(taxel.FormatError) as caught:
            call()
        assert caught.value.place == place
        assert caught.value.argument is None


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("errors") / "walk.npz"
    t = np.arange(0, 100_000, 1000)
    events = taxel.Events(t, t // 1000 % 4, t // 4000 % 4, t % 2000 == 0, array=taxel.Array(4, 4), intensity=t // 1000)
    taxel.convert(events, path)
    return path


def ranged() -> Iterator[Any]:
    """Every number of every encoder that has limits."""
    for name in _core.encoder_names():
        for parameter, limits in described(name)["ranges"].items():
            yield pytest.param(name, parameter, limits, id=f"{name}.{parameter}")


@pytest.mark.parametrize(("encoder", "parameter", "limits"), list(ranged()))
def test_the_command_line_names_the_option_of_a_parameter(
    encoder: str, parameter: str, limits: dict[str, Any], recording: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    wrong = limits["least"] - 1 if "least" in limits else limits["most"] + 1
    is_list = isinstance(described(encoder)["defaults"].get(parameter), list)
    for value in (wrong, "soon"):
        settings = {name: REQUIRED[name] for name in described(encoder)["required"]}
        settings[parameter] = f"[{value}]" if is_list else f"{value}"
        typed = [f"--set={name}={each}" for name, each in settings.items()]
        line = line_of(capsys, "encode", recording, recording.with_name("s.npz"), "--encoder", encoder, *typed)
        assert line.startswith(f"--set {parameter}")


def limited() -> Iterator[Any]:
    """Every option of every command that the parser checks for limits."""
    for path, app in commands().items():
        collection = app.assemble_argument_collection()
        each = [one for one in collection if one.required and not one.children]
        needed = [word for one in each for word in (["x"] if one.index is not None else [one.name, "x"])]
        for argument in collection:
            for limits in argument.parameter.validator:
                if isinstance(limits, Limits) and limits != Limits():
                    yield pytest.param(path, argument, limits, needed, id=f"{path} {argument.name}".replace(" ", "-"))


@pytest.mark.parametrize(("command", "argument", "limits", "needed"), list(limited()))
def test_limits_have_one_voice(
    command: str, argument: Any, limits: Limits, needed: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    """What the parser refuses it refuses in the words of the checks of all arguments, and with their exit code."""
    for value in [end + by for end, by in ((limits.least, -1), (limits.most, 1)) if end is not None]:
        line = line_of(capsys, *command.split(), *needed, f"{argument.name}={value}")
        ends = {key: end for key, end in vars(limits).items() if end is not None}
        with pytest.raises(taxel.ProblemError) as caught:
            (integer if argument.resolved_hint is int else finite)(argument.name, value, **ends)
        assert line == str(caught.value)
