"""Small files of every format that taxel.formats reads, made here: one function a format, named for it."""

from __future__ import annotations

import gzip
import os
from pathlib import Path

import h5py
import numpy as np
import pytest

from . import event_files

SHARED = Path(os.environ.get("TAXEL_DATA", Path(__file__).parents[3] / "shared" / "data"))


def shared(name: str) -> Path:
    if not (SHARED / name).is_dir():
        pytest.skip(f"no {name} in {SHARED}: set TAXEL_DATA")
    return SHARED / name


def interpolated(sensors: np.ndarray, start: int, rows: int) -> np.ndarray:
    """Three image rows from two sensor rows, as the plate's file has them."""
    s = np.concatenate([sensors, np.zeros((2, *sensors.shape[1:]), sensors.dtype)]).astype(np.int64)
    image = np.zeros((rows, *sensors.shape[1:]), np.int64)
    for k in range((len(sensors) + 1) // 2):
        a, b, c = s[2 * k], s[2 * k + 1], s[2 * k + 2]
        for row, value in enumerate((a, (a + 2 * b) // 3, (2 * b + c) // 3)):
            if start + 3 * k + row < rows:
                image[start + 3 * k + row] = value
    return image


def footfall(seed: int) -> np.ndarray:
    """Sensors x columns x frames: a blob that rolls from the heel to the toes."""
    rng = np.random.default_rng(seed)
    rows, columns, t = np.mgrid[0:20, 0:12, 0:40]
    load = 300 * np.exp(-(((rows - t / 2.2) / 3) ** 2) - ((columns - 6) / 2.5) ** 2) * np.sin(np.pi * (t + 1) / 41)
    return np.where(load > 20, load + rng.integers(0, 9, load.shape), 0).astype(np.int64)


def elsewhere(file: h5py.File, name: str, how: str) -> None:
    """Let the values of a data set be those of another file, beside or anywhere."""
    values = file[name][()]
    del file[name]
    if how == "external":
        place = Path(file.filename).with_name("secret")
        place.write_bytes(values.tobytes())
        file.create_dataset(name, values.shape, values.dtype, external=[(str(place), 0, values.nbytes)])
        return
    with h5py.File(Path(file.filename).with_name("secret.h5"), "w") as secret:
        secret["values"] = values
        layout = h5py.VirtualLayout(values.shape, values.dtype)
        layout[...] = h5py.VirtualSource(secret["values"])
    file.create_virtual_dataset(name, layout)


def write_plate(folder: Path, person: str = "subj900", count: int = 2) -> Path:
    file = folder / f"{person}.h5"
    with h5py.File(file, "w") as h5:
        for k in range(count):
            image = np.zeros((40, 12, 60), np.uint16)
            image[:, :, :40] = interpolated(footfall(k), 4 + k % 3, 40)
            h5[f"img{k:03d}"] = image
    return file


def write_gaitpdb(folder: Path, name: str = "GaCo99_01.txt", change=lambda rows: rows) -> Path:
    k = np.arange(600)
    left = np.where(k % 100 < 60, 40.0, 0.0)[:, None] * np.ones(8)
    right = np.where((k + 50) % 100 < 60, 40.0, 0.0)[:, None] * np.ones(8)
    values = np.column_stack([k / 100, left, right, left.sum(axis=1), right.sum(axis=1)])
    rows = change(["\t".join(f"{v:g}" for v in row) for row in values])
    file = folder / name
    data = ("\n".join(rows) + "\n").encode()
    file.write_bytes(gzip.compress(data) if name.endswith(".gz") else data)
    return file


def pack_212(values: np.ndarray) -> bytes:
    v = np.asarray(values, np.int64) & 0xFFF
    a, b = v[0::2], v[1::2]
    return np.stack([a & 255, (a >> 8) | ((b >> 8) << 4), b & 255], axis=1).astype(np.uint8).tobytes()


def write_gaitndd(folder: Path, name: str = "control99", samples: int = 3000) -> Path:
    left = np.where(np.arange(samples) % 300 < 180, 500, -1900)
    right = left.copy()
    right[0] = -2048

    def int16(v):
        return (int(np.where(v == -2048, -32768, v).sum()) + 32768) % 65536 - 32768

    (folder / f"{name}.let").write_bytes(pack_212(left))
    (folder / f"{name}.rit").write_bytes(pack_212(right))
    (folder / f"{name}.hea").write_text(
        f"{name} 2 300 {samples}\r\n"
        f"{name}.let 212 3000 12 0 {left[0]} {int16(left)} 0 left-foot\r\n"
        f"{name}.rit 212 3000 12 0 -32768 {int16(right)} 0 right-foot\r\n"
    )
    rows = [[k, 1.0, 1.0, 0.4, 0.4, 40, 40, 0.6, 0.6, 60, 60, 0.2, 20] for k in range(3, 9)]
    (folder / f"{name}.ts").write_text("\n".join("\t".join(f"{c:.4f}" for c in row) for row in rows) + "\n")
    return folder / f"{name}.hea"


def write_moticon(folder: Path, change=lambda rows: rows) -> Path:
    names = ["time"]
    for foot in ("left", "right"):
        names += [f"{foot} pressure {k}[N/cm²]" for k in range(1, 17)]
        names += [f"{foot} acceleration {a}[g]" for a in "XYZ"] + [f"{foot} angular {a}[dps]" for a in "XYZ"]
        names += [f"{foot} total force[N]", f"{foot} center of pressure X[-0.5...+0.5]", f"{foot} cop Y"]
    names += ["right steps[]", "left steps[]"]
    rows = []
    for k in range(200):
        if k == 120:  # a whole row is missing
            continue
        loaded = (k // 50) % 2
        left = [f"{2.5 * loaded:.2f}"] * 16 + ["0.1"] * 6 + [f"{400.0 * loaded:.2f}", "0", "0"]
        right = list(left)
        if k < 10 or k == 60:  # the left foot joins late, and drops out in stance
            left = [""] * 25
        marks = ["", {50: "11", 100: "15"}.get(k, "")]
        rows.append("\t".join([f"{k / 100:.2f}", *left, *right, *marks]))
    head = ["# Start time: 1.1.2024", "# Sensor insoles: Left SN1, Right SN2", "# " + "\t".join(names)]
    file = folder / "240101_000000.txt"
    file.write_text("\n".join(change(head + rows)) + "\n", encoding="utf-8")
    return file


def write_pedar(folder: Path, change=lambda rows: rows) -> Path:
    head = [
        "file name:  x.sol\tdate/time 1.1.24",
        "total time [secs]:  2.00\ttime per frame [secs]:  0.01000\tscanning rate [Hz]:   100",
        "pressure values in  kPa",
        "",
        "time[secs]    \t" + "\t".join(f"{k:7d}" for k in [*range(1, 6), *range(1, 6)]),
    ]
    rows = []
    for k in range(1, 201):
        load = 100.0 if k % 50 >= 20 else 0.0
        rows.append(f"{k / 100:12.5f}\t" + "\t".join(f"{load:7.3f}" for _ in range(10)))
    file = folder / "walk.asc"
    file.write_bytes("\n".join(change(head + rows)).replace("date", "\u00e4date").encode("latin-1"))
    return file


#: The columns of a table of grasps.
ICUB = ["trial", "slice", *(f"joint{k}" for k in range(7, 16))]
ICUB += [f"max_{finger}" for finger in ("thumb", "index", "middle", "ring", "little")]
ICUB += [f"{finger}_{k}" for finger in ("thumb", "index", "middle", "ring", "little") for k in range(1, 13)]


def write_icub(folder: Path, name="ball", trials=None, packed=True) -> Path:
    """Write grasps of one object by number, each slices of 60 raw values."""
    rows = [",".join(ICUB)]
    for number, slices in ({1: 242 - np.arange(180).reshape(3, 60) // 9} if trials is None else trials).items():
        for k, values in enumerate(slices):
            rows.append(",".join(map(str, [number, k, *([1.5] * 9), *([14] * 5), *values])))
    text = ("\n".join(rows) + "\n").encode()
    file = folder / f"{name}.csv{'.gz' if packed else ''}"
    file.write_bytes(gzip.compress(text) if packed else text)
    return file


def write_popu(folder: Path, readings=None, names=("left1_0", "supine2_1")) -> Path:
    """Write readings, poses x snapshots x rows x columns, with a name a pose."""
    file = folder / "poses.npz"
    given = np.arange(48).reshape(2, 2, 4, 3) if readings is None else readings
    np.savez(file, readings=np.asarray(given, np.uint8), pose=np.array(names))
    return file


def write_tekscan(folder: Path, change=lambda rows: rows, unit="raw", name="press.csv") -> Path:
    """Write a movie of 6 frames of 4 x 5 cells, one of which does not exist; frame 4 is missing."""
    head = [
        "DATA_TYPE MOVIE",
        "VERSION made here",
        "SENSOR_TYPE 6900",
        "ROWS 4",
        "COLS 5",
        "ROW_SPACING 0.2 centimeters",
    ]
    head += [
        "COL_SPACING 5 mm",
        "SECONDS_PER_FRAME 0.032",
        "COMMENTS:",
        "a thumb",
        f"UNITS {unit}",
        "ASCII_DATA @@",
        "",
    ]
    rows = []
    for number in (1, 2, 3, 5, 6):
        cells = (np.arange(20).reshape(4, 5) * number) % 50
        cells[0, 0] = 0
        told = f", {0.032 * (number - 1):g},, 1/2/2024,,,Raw Sum=,,{cells.sum()}" if unit == "raw" else ""
        rows.append(f"Frame {number}{told}")
        rows += [
            ",".join("B" if (r, c) == (0, 0) else str(v) for c, v in enumerate(row)) for r, row in enumerate(cells)
        ]
        rows.append("")
    file = folder / name
    file.write_text("\n".join(change([*head, *rows[:-1], "@@"])) + "\n")
    return file


def write_emed(folder: Path, change=lambda rows: rows) -> Path:
    """Write a step of 3 frames, of which rows 3 to 6 and columns 2 to 4 of 8 x 10 sensors are printed."""
    lines = []
    for page in (1, 2, 3):
        lines += [
            f"\t\t\t\tPage {page}",
            "",
            "\tFile: 2.dat \tMatrix: 8x10 ",
            "\tSensor area: 0.25 cm²\tTime/picture:10.0 ms",
        ]
        lines += ["\tSensor size: 0.500x0.500 cm", f"\tPict-No.: {page}  Force[N]=sum*sensor_area in row/column", ""]
        cells = 5.0 * page * np.array([[0, 1, 0], [2, 3, 1], [4, 6, 2], [1, 2, 0]])
        lines.append("\t" + "\t".join(["2", "3", "4", "Force"]))
        for row, values in zip(range(3, 7), cells, strict=True):
            lines.append("\t".join([str(row), *(f"{v:.2f}" for v in values), f"{values.sum() * 0.025:.2f}"]))
        forces = [*(cells.sum(axis=0) * 0.025), cells.sum() * 0.025]
        lines += ["Force\t" + "\t".join(f"{v:.2f}" for v in forces), "\x0c"]
    file = folder / "step.lst"
    file.write_bytes("\n".join(change(lines)).encode("latin-1"))
    return file


def write_event_camera(folder: Path) -> Path:
    return event_files.write(folder / "skin.raw", event_files.some_rows())
