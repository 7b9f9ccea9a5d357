"""Files of other programs that taxel does not read."""

from __future__ import annotations

from pathlib import Path

from taxel._base.errors import unreadable

#: What to save instead of files of other programs that taxel does not read, by their endings.
CONTAINERS = {
    ".xls": "save it as .xlsx or .csv",
    **dict.fromkeys((".pkl", ".pickle"), "in Python, save the table with to_csv, or the array with numpy.save"),
    **dict.fromkeys((".pt", ".pth"), "in Python, save the tensor with numpy.save('FILE.npy', tensor.numpy())"),
    **dict.fromkeys((".joblib", ".zarr"), "in Python, save the array with numpy.save"),
    ".tdms": "save it as .csv or .xlsx, in LabVIEW or with nptdms' to_hdf",
    ".c3d": "export its analog channels as .csv",
    **dict.fromkeys((".rds", ".rdata"), "in R, save the table with write.csv"),
    ".sav": "save the table as .csv",
    ".feather": "save the table as .parquet or .csv",
    **dict.fromkeys((".zip", ".7z", ".zst", ".xz", ".bz2"), "unpack it first"),
    ".pdf": "save the table in it as .csv",
    ".mp4": "taxel reads no films; save the readings as .csv or .npy",
}


def refuse_container(path: Path) -> None:
    """Refuse a file of another program that taxel does not read, by the line that says what to save instead.

    Raises
    ------
    FormatError : it is such a file
    """
    if advice := CONTAINERS.get(path.suffix.lower()):
        raise unreadable(f"taxel does not read {path.suffix.lower()} files; {advice}", path)
