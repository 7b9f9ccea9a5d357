"""Files as people have them: tables, arrays, workbooks and bags, by a name each; each stands for a kind."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pandas as pd

from . import bags
from .making import write_emed, write_event_camera, write_moticon, write_pedar, write_tekscan

#: Readings of eight sensors of a hand that is pressed now and then.
RANDOM = np.random.default_rng(81)
READINGS = np.round(RANDOM.gamma(2.0, 3.0, (200, 8)) + 40 * (np.arange(200) % 50 > 30)[:, None], 2)


def lines(line: Callable[[int], str], count: int = 60, head: str = "") -> str:
    """Return lines of a table below a line of names, if it has one."""
    return head + "\n" * bool(head) + "".join(f"{line(k)}\n" for k in range(count))


def rows(k: int, count: int = 8, separator: str = ",") -> str:
    """Return some readings of one time."""
    return separator.join(map(str, READINGS[k % len(READINGS), :count]))


NAMES = ",".join(f"s{k}" for k in range(1, 9))
#: Tables of text, by what each shows. Numbers are those of the inputs of the note on strangers' files.
TEXTS: dict[str, str] = {
    "named by number": lines(lambda k: f"{k * 10},{rows(k)}", 200, f"time_ms,{NAMES}"),
    "no names": lines(lambda k: f"{k * 10},{rows(k)}", 200),
    "no names, no times": lines(rows),
    "fingers by name": lines(lambda k: f"{k / 50},{rows(k, 3)}", 60, "timestamp,thumb,index,middle"),
    "a count of lines first": lines(lambda k: f"{k},{k * 20},{rows(k, 4)}", 60, ",time_ms,a,b,c,d"),
    "German": lines(lambda k: f"{k / 100:.2f};{rows(k, 4, ';')}".replace(".", ","), 60, "Zeit [s];A;B;C;D"),
    "sides": lines(lambda k: f"{k / 100},{rows(k, 6)}", 60, "t_s,left_1,left_2,left_3,right_1,right_2,right_3"),
    "keys of JSON": lines(lambda k: f'{{"t": {k / 50}, "p": [{rows(k, 4)}], "battery": 87}}'),
    "brackets": lines(lambda k: f"{k / 50} -> [{rows(k, 4)}]"),
    "hexadecimal": lines(lambda k: f"{k % 200:02X} 1E {(7 * k) % 256:02X}"),
    "frames between empty lines": lines(lambda k: rows(k, 4) + "\n" * (k % 3 == 2)),
    "3 two sensors by key": lines(lambda k: f"{k * 10},L:{k % 9},2\n{k * 10 + 5},R:900,800", 20),
    "3 two sensors in JSON": lines(
        lambda k: f'{{"t":{k / 100},"left":[{k % 9},2]}}\n{{"t":{k / 100 + 0.005},"right":[900,800]}}', 20
    ),
    "3 two sensors by prefix": lines(lambda k: f"left: {k % 9},2,3\nright: 900,800,700", 20),
    "4 an unnamed time": lines(lambda k: f"{k * 10},{k % 5},{k % 3}", 50),
    "7 milliseconds behind a comma": lines(
        lambda k: f"2024-05-01 10:00:{k // 50:02},{k % 50 * 20:03},{rows(k, 2)}", 99
    ),
    "7 a finer time": lines(lambda k: f"{k // 50},{k * 20_000},{rows(k, 2)}", 99, "time_s,board,a,b"),
    "8 times nearly all the same": lines(lambda k: f"1.71E+12,{rows(k, 2)}", 60, "timestamp,a,b"),
    "8 a stamp before a pause": "t_ms,a\n0,1\n10,1\n20,1\n20,2\n5000,1\n5010,1\n",
    "9 labels": lines(lambda k: f"{k * 10},{rows(k)},{100 * (k // 20 % 2)}", 200, f"time_ms,{NAMES},heel_strike"),
    "9 a counter": lines(lambda k: f"{k * 10},{rows(k)},{k % 100}", 200, f"time_ms,{NAMES},iter"),
    "9 a mean": lines(lambda k: f"{k * 10},{rows(k)},{READINGS[k].mean():.2f}", 200, f"time_ms,{NAMES},Mean"),
    "9 a foot's total": lines(
        lambda k: f"{k * 10},{rows(k)},{READINGS[k, :4].sum():.2f},{READINGS[k, 4:].sum():.2f}",
        200,
        f"time_ms,{NAMES},L,R",
    ),
    "9 places": lines(lambda k: f"{k * 10},{rows(k)},{k % 7}.5,{k % 5}.25,{k % 3}", 200, f"time_ms,{NAMES},X,Y,area"),
    "9 a constant": lines(lambda k: f"{k * 10},{rows(k)},5", 200, f"time_ms,{NAMES},gain"),
    "10 blanks as thousands": lines(lambda k: f"{k * 10};1 {200 + k},5;{k % 9}", 60, "t_ms;a;b"),
    "10 a minus of Unicode": lines(lambda k: f"{k * 10};\N{MINUS SIGN}{k % 9 + 1};{k % 9}", 60, "t_ms;a;b"),
    "2 lists that are cut": lines(lambda k: f'{k / 10},"[1 2 {k} ... 7 8 9]"', 20, "t,p"),
    "15 three digits": "192,154,092\n169,143,086\n159,134,082\n",
    "15 a pause": lines(lambda k: f"{(k + (k > 29) * 9000) * 2000},{k % 5},{k % 3}"),
    "15 days": lines(lambda k: f"{45413.41 + k / 864000:.8f},{rows(k, 2)}", 60, "time,a,b"),
    "15 a position that rises": lines(lambda k: f"{k * 0.5 + READINGS[k, 0] / 99:.3f},{rows(k, 2)}", 60, "pos,a,b"),
    "16 numbers with the separators of frames": (
        "name,,\n3,,\n,,\nFrame 0 (0.00 ms),,\n0,1,2\n0,1,3\n,,\nFrame 1 (2.00 ms),,\n0,1,2\n0,1,3\n"
    ),
    "17 empty ends": lines(lambda k: f"{k * 10};1;{k % 7}", 20, "t_ms;a;b") + ";;\n" * 5,
    "18 cells of spreadsheets": lines(lambda k: f"{k * 10},{'#N/A' if k % 5 == 3 else k},{k % 7}", 60, "t_ms,a,b"),
    "18 one odd cell": lines(lambda k: f"{k * 10},{'OVF' if k == 7 else k % 9},{k % 7}", 60, "t_ms,a,b"),
    "events without a size": lines(lambda k: f"{k % 9},{k % 5},{k % 2},{k * 10}", 60, "x,y,p,t_us"),
    # Each is read by a rule of its own.
    "units behind decimal commas": lines(lambda k: f"{k * 20} ms; {k % 9},5N; {k % 7},25N"),
    "thousands in quotes": lines(lambda k: f'{k * 20},"1,{200 + 37 * k % 90}.5","2,{300 - k % 7}.5"', 60, "t_ms,a,b"),
    "a hand that stays": lines(lambda k: f"{k * 20},left,{rows(k, 2)}", 60, "t_ms,hand,a,b"),
    "columns by number": "1,2,3,4\n" + lines(lambda k: rows(k, 4)),
    "one taxel that is named as a label": lines(lambda k: f"{k * 20},{k % 2}", 60, "t_ms,contact"),
    "dates between marks": lines(lambda k: f"2024-05-01 10:00:{k:02}.5 -> {rows(k, 2)}"),
    "thousands or decimals, and times": lines(lambda k: f"{k * 20};1.{200 + k}", 60, "time;a"),
    "events without names": lines(lambda k: f"{k * 9},{k % 9},{k % 5},{k % 2}"),
    "a document of JSON": '{\n "p": [1, 2]\n}\n',
}


def _arrays(path: Path, **arrays: object) -> Path:
    if path.suffix == ".npy":
        np.save(path, np.asarray(arrays["one"]))
    elif path.suffix == ".npz":
        np.savez(path, **arrays)  # type: ignore[arg-type]
    else:
        with h5py.File(path, "w") as file:
            file.update(arrays)
    return path


def _workbook(path: Path) -> Path:
    with pd.ExcelWriter(path) as book:
        for name, count in (("walk", 60), ("run", 40)):
            t = np.arange(count) / 50
            pd.DataFrame({"time": t, **{f"s{k}": READINGS[:count, k] for k in range(3)}}).to_excel(
                book, sheet_name=name, index=False
            )
        pd.DataFrame({"subject": ["A"], "age": [31]}).to_excel(book, sheet_name="about", index=False)
    return path


def _times_of_day(path: Path) -> Path:
    times = pd.to_datetime(np.arange(60), unit="s").time
    pd.DataFrame({"when": times, "a": READINGS[:60, 0], "b": READINGS[:60, 1]}).to_excel(path, index=False)
    return path


def _spans_of_time(path: Path) -> Path:
    spans = pd.to_timedelta(np.arange(60) * 20, unit="ms")
    pd.DataFrame({"since": spans, "a": READINGS[:60, 0], "said": "so, so"}).to_parquet(path)
    return path


def _lists(path: Path) -> Path:
    table = pd.DataFrame({"timestamp": np.arange(9) / 30, "p": list(np.arange(10800.0).reshape(9, 1200))})
    table.to_parquet(path)
    return path


def _bag(path: Path) -> Path:
    return bags.write(path, [("/palm", bags.PALM, 10 * k, 10 * k, bags.palm(np.arange(768) + k)) for k in range(9)])


TIMES = np.arange(100) * 0.02
GRID = np.arange(100 * 6 * 5.0).reshape(100, 6, 5) % 97
#: Functions that write a file of another kind into a folder, and return its path.
FILES: dict[str, Callable[[Path], Path]] = {
    "moticon": write_moticon,
    "pedar": write_pedar,
    "emed": write_emed,
    "tekscan": write_tekscan,
    "event camera": write_event_camera,
    "bag": lambda to: _bag(to / "palm.mcap"),
    "array and times": lambda to: _arrays(to / "a.npz", palm=GRID, time=TIMES),
    "array alone": lambda to: _arrays(to / "a.npy", one=GRID),
    "data sets": lambda to: _arrays(to / "a.h5", palm=GRID[:, 0], t_s=TIMES),
    "6 long second axis": lambda to: _arrays(to / "a.npy", one=np.zeros((45, 450, 52))),
    "6 several arrays": lambda to: _arrays(to / "a.npz", left=GRID[:, 0], right=GRID[:, 1], time=TIMES),
    "6 three axes": lambda to: _arrays(to / "a.npz", skin=GRID[..., :3], time=TIMES),
    "6 trials": lambda to: _arrays(to / "a.npz", X=np.zeros((20, 500, 16)), y=np.zeros(20)),
    "2 lists in cells": lambda to: _lists(to / "p.parquet"),
    "11 sheets": lambda to: _workbook(to / "a.xlsx"),
    "times of day in a sheet": lambda to: _times_of_day(to / "a.xlsx"),
    "spans of time in Parquet": lambda to: _spans_of_time(to / "p.parquet"),
    "an empty array": lambda to: _arrays(to / "a.npy", one=np.zeros((0, 3))),
}


def written(name: str, folder: Path) -> Path:
    """Write one of the files into a folder; return its path."""
    if name in FILES:
        return FILES[name](folder)
    path = folder / ("a.json" if "document" in name else "a.csv")
    path.write_text(TEXTS[name], "utf-8")
    return path
