"""Files of other programs that taxel does not read, or that only a reader beside it does."""

from __future__ import annotations

from pathlib import Path

from taxel._base.errors import unreadable
from taxel._base.messages import installing

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


#: The first bytes of a .bag of ROS 1, and of a .db3 of ROS 2, which is a database of SQLite.
_BAGS = (b"#ROSBAG V", b"SQLite format 3\0")
#: The first bytes of a .mcap: its magic and the code of the header, before the header's length and its profile.
_MCAP = b"\x89MCAP0\r\n\x01"


def is_bag(path: Path) -> bool:
    """Return whether a path is a ROS bag, by its content: a file, or a folder with ``metadata.yaml`` and its files.

    Raises
    ------
    OSError : the file is not there, or cannot be read
    """
    if path.is_dir():
        return (path / "metadata.yaml").is_file()
    with open(path, "rb") as file:
        head = file.read(64)
    if head.startswith(_MCAP):
        profile = head[len(_MCAP) + 8 :]
        return profile[4 : 4 + int.from_bytes(profile[:4], "little")] in (b"ros1", b"ros2")
    return head.startswith(_BAGS)


def refuse_container(path: Path) -> None:
    """Refuse a file of another program that taxel does not read, by the line that says what to do instead.

    Raises
    ------
    FormatError : it is such a file
    """
    if is_bag(path):
        raise unreadable(f"is a ROS bag, which taxel_makers reads: {installing('makers,ros')}", path)
    if advice := CONTAINERS.get(path.suffix.lower()):
        raise unreadable(f"taxel does not read {path.suffix.lower()} files; {advice}", path)
