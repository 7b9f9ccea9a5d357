"""Numbers in tables: ASCII digits without underscores, whichever reader turns the text into a number."""

import numpy as np
import pytest

import taxel
from taxel import FormatError
from taxel._base.number_text import float_of, int_of
from taxel.formats import text
from taxel.information import read_trials
from taxel.labels import Labels

#: What Python reads as 10, and no other program.
STRANGE = ["1_0", "\u0661\u0660", "\uff11\uff10", "1\u0660", "\u096710", "10_", "_10"]


def events_table(number):
    return f"t_us,x,y,p\n{number},1,2,1\n"


def frames_table(number):
    return f"t_us,x0y0,x1y0\n0,1,{number}\n"


def named_table(number):
    return f"t_us,x0y{number}\n0,1\n"


def open_one(file):
    return taxel.open(file).frames().values if "x0y" in file.read_text() else taxel.open(file).events.t


def open_laid_out(file):
    file.with_name("one.layout.toml").write_text('[table]\ntime_column = "time"\n')
    return taxel.open(file).frames().values


def open_trials(file):
    taxel.convert(
        taxel.Events([0, 50], [0, 1], [0, 0], [True, True], array=taxel.Array(1, 2)),
        file.parent / "two.npz",
        overwrite=True,
    )
    return read_trials(file, [taxel.open(file.parent / "two.npz")], window_ms=0.01)


READERS = {
    "a table of events": (events_table, open_one),
    "a table of frames": (frames_table, open_one),
    "a table of another program": (lambda n: f"time,a,b\n0.0,1,2\n0.1,1,{n}\n", open_laid_out),
    "times of another program": (lambda n: f"time,a,b\n0.0,1,2\n{n},1,3\n", open_laid_out),
    "a table of labels": (lambda n: f"label,t_us\nheel,{n}\n", lambda file: Labels(file).rows),
    "what a label replaces": (
        lambda n: f"label,t_us,replaces_us\nheel,5,{n}\n",
        lambda file: Labels(file).rows,
    ),
    "detections": (lambda n: f"label,t_us,known_us,slope_mv_per_ms\nheel,5,{n},0.5\n", taxel.Detections.from_csv),
    "the slope of detections": (
        lambda n: f"label,t_us,known_us,slope_mv_per_ms\nheel,5,9,{n}\n",
        taxel.Detections.from_csv,
    ),
    "a table of trials": (lambda n: f"recording,t_us,label\ntwo.npz,{n},a\n", open_trials),
}


@pytest.mark.parametrize("reader", READERS)
@pytest.mark.parametrize("number", STRANGE)
def test_a_number_that_only_python_reads_is_refused(tmp_path, reader, number):
    table, read = READERS[reader]
    file = tmp_path / "one.csv"
    file.write_text(table("10"), encoding="utf-8")
    read(file)
    file.write_text(table(number), encoding="utf-8")
    with pytest.raises(FormatError, match=r"one\.csv.*(line|column)") as refused:
        read(file)
    assert "\n" not in str(refused.value)


def test_a_name_with_other_digits_is_no_taxel(tmp_path):
    file = tmp_path / "one.csv"
    file.write_text(named_table("\u0663"), encoding="utf-8")
    assert taxel.open(file).array.names == ("x0y\u0663",)


@pytest.mark.parametrize("number", STRANGE)
def test_a_block_of_cells_is_read_as_each_of_them(tmp_path, number):
    with pytest.raises(FormatError, match="line 3: column 'b' is"):
        text.numbers([["1", "2"], ["3", "4"], ["5", number]], tmp_path / "a.txt", 1, ["a", "b"])
    read = text.numbers([["1", "-2e3"], [" 3.", ".5\u00a0"]], tmp_path / "a.txt", 1, ["a", "b"])
    assert np.array_equal(read, [[1, -2000], [3, 0.5]])


@pytest.mark.parametrize("number", STRANGE)
def test_no_number_is_made_of_it(number):
    for read in (float_of, int_of):
        with pytest.raises(ValueError, match="ASCII"):
            read(number)
        assert read(" 10 ") == 10


def test_a_folder_of_files_with_strange_digits_in_their_names_is_listed(tmp_path):
    for name in ("a1\u00b22", "a\u0663", "a1", "a10"):
        (tmp_path / f"{name}.csv").write_text(events_table(1), encoding="utf-8")
    assert [one.path.name for one in taxel.open_all(tmp_path)][:2] == ["a1.csv", "a1\u00b22.csv"]
