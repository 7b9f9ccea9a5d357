"""Writes large recordings of every kind, of about so many bytes of arrays, without holding them; measures an opening.

As a program it opens what each line of its input says, each in a child of its own, and prints for each what the arrays
take and the most memory that the child took, bytes. To load taxel takes longer than most openings: children have it.
"""

from __future__ import annotations

import gzip
import json
import os
import resource
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np

#: Frames of a table have as many columns.
COLUMNS = 64
RNG = np.random.default_rng(5)


def rows_of(size: int, columns: int = COLUMNS) -> int:
    return size // (4 * columns + 8)


def texts(rows: int, line: Callable[[int], str], head: str = "") -> Iterable[bytes]:
    yield head.encode()
    for begin in range(0, rows, 10_000):
        yield "".join(line(k) for k in range(begin, min(rows, begin + 10_000))).encode()


def write(path: Path, parts: Iterable[bytes]) -> Path:
    with gzip.open(path, "wb", compresslevel=1) if path.suffix == ".gz" else path.open("wb") as file:
        for part in parts:
            file.write(part)
    return path


CELLS = [",".join(map(str, RNG.integers(0, 4000, COLUMNS))) for _ in range(50)]


def table(folder: Path, size: int, name: str, separator: str = ",") -> Path:
    """A table of another program, with a time column and a layout beside it."""
    (folder / "layout.toml").write_text(
        f'rows = 8\ncolumns = 8\n[table]\nseparator = "{separator}"\ntime_column = "time"\n'
    )
    head = separator.join(["time", *(f"a{k}" for k in range(COLUMNS))]) + "\n"
    cells = [one.replace(",", separator) for one in CELLS]
    return write(folder / name, texts(rows_of(size), lambda k: f"{k / 100:.2f}{separator}{cells[k % 50]}\n", head))


def csv_frames(folder: Path, size: int) -> Path:
    head = ",".join(["t_us", *(f"x{k % 8}y{k // 8}" for k in range(COLUMNS))]) + "\n"
    return write(folder / "a.csv", texts(rows_of(size), lambda k: f"{1000 * k},{CELLS[k % 50]}\n", head))


def csv_events(folder: Path, size: int) -> Path:
    line = lambda k: f"{10 * k},{k % 64},{k // 64 % 64},{k & 1},{k % 999}\n"  # noqa: E731
    return write(folder / "a.csv", texts(size // 16, line, "t_us,x,y,p,intensity\n"))


def one_channel(folder: Path, size: int) -> Path:
    """One taxel, so that times take more than values."""
    (folder / "layout.toml").write_text('rows = 1\ncolumns = 1\n[table]\ntime_column = "time"\n')
    return write(folder / "a.txt", texts(size // 12, lambda k: f"{k / 1000:.3f},{k % 500}\n", "time,a\n"))


def frames(size: int) -> Any:
    import taxel

    n = size // (4 * 64 * 64 + 8)
    values = np.empty((n, 64, 64), np.float32)
    for k in range(n):
        values[k] = RNG.integers(0, 900, (64, 64))
    values[1:, :32] = 7.0
    return taxel.Frames(values, np.arange(n) * 1000)


def events(size: int) -> Any:
    import taxel

    n = size // 16
    k = np.arange(n)
    return taxel.Events(
        k * 10, k % 64, k // 64 % 64, k % 2 == 0, array=taxel.Array.thesis(), intensity=(k % 999).astype(np.uint16)
    )


def converted(name: str, make: Callable[[int], Any]) -> Callable[[Path, int], Path]:
    def one(folder: Path, size: int) -> Path:
        import taxel

        taxel.convert(make(size), folder / name)
        return folder / name

    return one


def plain_npy(folder: Path, size: int) -> Path:
    (folder / "layout.toml").write_text("rows = 64\ncolumns = 64\nrate_hz = 100\n")
    np.save(folder / "a.npy", frames(size).values)
    return folder / "a.npy"


def foreign_npz(folder: Path, size: int) -> Path:
    (folder / "layout.toml").write_text('rows = 64\ncolumns = 64\nrate_hz = 100\n[data]\narray = "pressure"\n')
    np.savez_compressed(folder / "a.npz", pressure=frames(size).values, other=np.arange(3))
    return folder / "a.npz"


def foreign_h5(folder: Path, size: int) -> Path:
    import h5py

    (folder / "layout.toml").write_text('rows = 64\ncolumns = 64\nrate_hz = 100\n[data]\narray = "run/pressure"\n')
    with h5py.File(folder / "a.h5", "w") as h5:
        h5.create_dataset("run/pressure", data=frames(size).values, compression="gzip", compression_opts=1)
    return folder / "a.h5"


def gaitpdb(folder: Path, size: int) -> Path:
    """Two feet of 8 sensors: 40 bytes a line and foot, and the totals."""
    line = lambda k: (  # noqa: E731
        f"{k / 100:.2f}\t"
        + "\t".join(["40" if k % 100 < 60 else "0"] * 16 + ["320" if k % 100 < 60 else "0"] * 2)
        + "\n"
    )
    return write(folder / "GaCo99_01.txt", texts(size // 80, line))


def gaitndd(folder: Path, size: int) -> Path:
    from formats.making import write_gaitndd

    write_gaitndd(folder, samples=size // 24 // 2 * 2)
    return folder / "control99.hea"


def moticon(folder: Path, size: int) -> Path:
    from formats.making import write_moticon

    rows: list[str] = []
    file = write_moticon(folder, lambda all_of_them: rows.extend(all_of_them) or all_of_them)
    cells = [row.split("\t", 1)[1] for row in rows[3:]]
    head = "\n".join(rows[:3]) + "\n"
    return write(file, texts(size // 150, lambda k: f"{k / 100:.2f}\t{cells[70 + k % 20]}\n", head))


def pedar(folder: Path, size: int) -> Path:
    head = (
        "total time\tscanning rate [Hz]:   100\npressure values in  kPa\n\ntime[secs]\t"
        + "\t".join(map(str, [*range(1, 100), *range(1, 100)]))
        + "\n"
    )
    cells = ["\t".join(map(str, RNG.integers(0, 400, 198))) for _ in range(50)]
    return write(folder / "walk.asc", texts(size // 808, lambda k: f"{k / 100:.2f}\t{cells[k % 50]}\n", head))


def icub(folder: Path, size: int) -> Path:
    from formats.making import ICUB

    cells = [",".join(map(str, [*([1.5] * 9), *([14] * 5), *RNG.integers(0, 255, 60)])) for _ in range(50)]
    line = lambda k: f"{k // 500},{k % 500},{cells[k % 50]}\n"  # noqa: E731
    return write(folder / "ball.csv.gz", texts(size // 248, line, ",".join(ICUB) + "\n"))


def popu(folder: Path, size: int) -> Path:
    from formats.making import write_popu

    poses = 40
    readings = RNG.integers(0, 9, (poses, size // poses // 4 // (64 * 27), 64, 27), np.uint8)
    return write_popu(folder, readings, [f"left{k}_0" for k in range(poses)])


def tekscan(folder: Path, size: int) -> Path:
    head = "DATA_TYPE MOVIE\nROWS 60\nCOLS 21\nROW_SPACING 5 mm\nCOL_SPACING 5 mm\nSECONDS_PER_FRAME 0.01\nUNITS kPa\n"
    row = ",".join(map(str, range(21)))
    frame = "\n".join([row] * 60)
    parts = texts(size // (4 * 60 * 21), lambda k: f"Frame {k + 1}\n{frame}\n\n", head + "ASCII_DATA @@\n\n")
    file = write(folder / "press.asf", parts)
    with file.open("a") as more:
        more.write("@@\n")
    return file


def emed(folder: Path, size: int) -> Path:
    cells = 5.0 * np.ones((30, 30))
    lines = ["\t" + "\t".join([*map(str, range(1, 31)), "Force"])]
    lines += ["\t".join([str(k + 1), *["5.00"] * 30, f"{5 * 30 * 0.025:.2f}"]) for k in range(30)]
    lines += ["Force\t" + "\t".join([*["3.75"] * 30, f"{cells.sum() * 0.025:.2f}"]), "\x0c"]
    page = "\n".join(lines)
    head = "\tMatrix: 40x40 \n\tSensor area: 0.25 cm2\tTime/picture:10.0 ms\n\tSensor size: 0.500x0.500 cm\n"
    return write(
        folder / "step.lst",
        texts(size // (4 * 1600), lambda k: f"{head}\tPict-No.: {k + 1}  Force[N]=sum\n\n{page}\n"),
    )


def plate(folder: Path, size: int) -> Path:
    from formats.making import write_plate

    return write_plate(folder, count=max(1, size // (4 * 26 * 12 * 41)))


def event_camera(folder: Path, size: int) -> Path:
    from formats.event_files import some_rows, write

    return write(folder / "a.dat", some_rows(size // 13), "dat")


def counted_events(folder: Path, size: int) -> Path:
    (folder / "layout.toml").write_text("[event_camera]\nwindow_ms = 10\n")
    from formats.event_files import some_rows, write

    # An event each 100 us.
    return write(folder / "a.dat", some_rows(size // (48 * 64 * 4) * 100), "dat")


def bag(ending: str) -> Callable[[Path, int], Path]:
    def one(folder: Path, size: int) -> Path:
        from formats import bags

        (folder / "layout.toml").write_text('[ros]\ntopic = "/palm"\n')
        palms = [bags.palm(RNG.integers(0, 900, 768)) for _ in range(20)]
        count = size // (4 * 768 + 8)
        return bags.write(
            folder / f"a{ending}", (("/palm", bags.PALM, 5.0 * k, 5.0 * k, palms[k % 20]) for k in range(1, count))
        )

    return one


#: How large files of each kind are written; the formats of other makers have their names.
KINDS: dict[str, Callable[[Path, int], Path]] = {
    "mcap of events": converted("a.mcap", events),
    "mcap of frames": converted("a.mcap", frames),
    "lsa": converted("a.lsa", events),
    "npz of events": converted("a.npz", events),
    "npz of frames": converted("a.npz", frames),
    "h5 of events": converted("a.h5", events),
    "h5 of frames": converted("a.h5", frames),
    "csv of events": csv_events,
    "csv of frames": csv_frames,
    "npy": plain_npy,
    "npz of another program": foreign_npz,
    "h5 of another program": foreign_h5,
    "txt": lambda folder, size: table(folder, size, "a.txt"),
    "csv.gz": lambda folder, size: table(folder, size, "a.csv.gz", ";"),
    "one channel": one_channel,
    "bag of ROS 1": bag(".bag"),
    "bag of ROS 2": bag(".mcap"),
    "database of ROS 2": bag(".db3"),
    "gaitpdb": gaitpdb,
    "gaitndd": gaitndd,
    "moticon": moticon,
    "pedar": pedar,
    "icub": icub,
    "popu": popu,
    "tekscan": tekscan,
    "emed": emed,
    "plate": plate,
    "event_camera": event_camera,
    "event_camera, counted": counted_events,
}
#: Those whose arrays are written and read in moments.
QUICK = (
    "mcap of events",
    "mcap of frames",
    "lsa",
    "npz of events",
    "npz of frames",
    "npy",
    "gaitndd",
    "popu",
    "event_camera",
    "event_camera, counted",
)


def arrays_of(every: Any) -> int:
    """Return the bytes of the arrays of recordings, each counted once."""
    import taxel

    held: dict[int, int] = {}
    for recording in [source for one in every for source in (one.sources.values() or [one])]:
        table = recording.events if recording.has_events else recording.frames()
        assert isinstance(table, taxel.Events | taxel.Frames)
        for column in vars(table).values():
            if isinstance(column, np.ndarray):
                held[column.__array_interface__["data"][0]] = column.nbytes
    return sum(held.values())


def peak() -> int:
    """Return the most memory that this process took so far."""
    status = Path("/proc/self/status").read_text()
    return 1024 * int(status.partition("VmHWM:")[2].split()[0])


def answer(path: str, at_most: int, how: dict[str, Any]) -> None:
    """Open a recording within so many bytes of addresses, and print what it took."""
    import taxel

    if at_most:
        resource.setrlimit(resource.RLIMIT_AS, (at_most, at_most))
    try:
        said = {"arrays": arrays_of(taxel.open_all(path, **how)), "peak": peak()}
    except taxel.Error as error:
        said = {"refused": str(error), "peak": peak()}
    print(json.dumps(said), flush=True)


if __name__ == "__main__":
    import h5py  # noqa: F401  # as taxel loads it with the first file of its kind

    import taxel.recording  # noqa: F401

    for line in sys.stdin:
        child = os.fork()
        if not child:
            answer(*json.loads(line))
            os._exit(0)
        if code := os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]):
            print(json.dumps({"ended": code}), flush=True)
