"""Any bytes in a file of any kind: an answer, or one `taxel.Error` of one line. ``make fuzz`` runs it.

The first byte of an input chooses the ending of the file's name and whether a layout stands beside it. What the library
of HDF5 or of MATLAB's files crashes at is not ours: those kinds are left out.
"""

import importlib
import pkgutil
import sys
import tempfile
import warnings
from pathlib import Path

import atheris

with atheris.instrument_imports(include=["taxel.formats", "taxel.recording"]):
    import taxel
    import taxel.formats
    import taxel.recording

    for package in (taxel.formats, taxel.recording):  # readers are imported when they are needed
        for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            importlib.import_module(module.name)

ENDINGS = (
    ".mcap",
    ".npz",
    ".csv",
    ".lsa",
    ".txt",
    ".bag",
    ".db3",
    ".asc",
    ".json",
    ".jsonl",
    ".xdf",
    ".tsv",
    ".npy",
    ".fsx",
    ".gz",
)
LAYOUT = 'rows = 4\ncolumns = 5\n[table]\ntime_column = "time"\n[data]\narray = "values"\n[ros]\ntopic = "/palm"\n'
FOLDER = Path(tempfile.mkdtemp(prefix="taxel-fuzz-"))


def seeds() -> Path:
    """Write a whole file of each kind that taxel writes, as inputs to begin with, and return their folder."""
    folder = FOLDER / "seeds"
    folder.mkdir()
    frames = taxel.Frames([[[k % 7 for _ in range(5)] for _ in range(4)] for k in range(50)], range(0, 500_000, 10_000))
    for number, ending in enumerate(ENDINGS):
        whole = FOLDER / f"seed{ending}"
        if ending in (".mcap", ".npz", ".csv"):
            taxel.convert(frames, whole)
        else:
            whole.write_text("time;thumb;index\n" + "".join(f"{k / 100:g};{k % 7};{k % 5}\n" for k in range(50)))
        (folder / f"seed{number}").write_bytes(bytes([number]) + whole.read_bytes())
        whole.unlink()
    return folder


def read(data: bytes) -> None:
    """Read a file of these bytes."""
    if not data:
        return
    path, layout = FOLDER / f"file{ENDINGS[data[0] % len(ENDINGS)]}", FOLDER / "layout.toml"
    path.write_bytes(data[1:])
    if data[0] >= 128:
        layout.write_text(LAYOUT)
    try:
        for recording in taxel.open_all(path):
            for source in recording.sources.values():
                assert len((source.events if source.has_events else source.frames()).t) >= 0
            assert recording.verdict
    except taxel.Error as error:
        if len(error.args) == 1 and "\n" in str(error):
            raise AssertionError("an error has several lines") from error
    finally:
        path.unlink()
        layout.unlink(missing_ok=True)


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    atheris.Setup([*sys.argv, str(seeds())], read)
    atheris.Fuzz()
