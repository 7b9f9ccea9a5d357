"""What is said of files that are no recordings, and of live sources that are none."""

import gzip
import io

import h5py
import numpy as np
import pytest
from refusal import messages

import taxel
from taxel import FormatError


def npz(**columns: object) -> bytes:
    file = io.BytesIO()
    np.savez(file, **columns)
    return file.getvalue()


def h5_of_another_file() -> bytes:
    file = io.BytesIO()
    with h5py.File(file, "w") as h5:
        h5.create_dataset("pressure", (20, 3), "f8", external=[("secret", 0, 480)])
    return file.getvalue()


#: Files by name and content.
FILES = [
    ("a.mcap", gzip.compress(b"x", mtime=0)),
    ("a.mcap", b""),
    ("a.mcap", b"\x89MCA"),
    ("a.mcap", b"hello, world"),
    ("a.mcap", npz(t=[1])),
    ("a.npz", b"t_us,x,y,p\n"),
    ("a.npz", npz(t=[1])[:40]),
    ("a.npz", npz(t=[1], x=[2])),
    ("a.npz", npz(t=[1], x=[2], y=[3], p=[True, False])),
    ("a.npz", npz(t=[1], x=[2], y=[3], p=[True], array="{")),
    ("a.npz", npz(t=[1], values=np.zeros((2, 3, 3)))),
    ("a.csv", b"\x89PNG\r\n"),
    ("a.csv", b""),
    ("a.csv", b"time,x,y\n"),
    ("a.csv", b"\xff\xfe\x00"),
    ("a.csv", b"t_us,x,y,p,colour\n"),
    ("a.csv", b"t_us,x,y,p\n1,2,3\n"),
    ("a.csv", b"t_us,x,y,p\n1,2,3,1\n5,6,abc,1\n"),
    ("a.csv", b"t_us,x,y,p\n\n1,2,3,1\n\n5,6,,1\n"),
    ("a.csv", b"t_us,x,y,p\n1,2,3,2\n"),
    ("a.csv", b"t_us,x,y,p\n1,-2,3,0\n"),
    ("a.csv", b"t_us,x,y,p,intensity\n1,2,3,0,70000\n"),
    ("a.csv", b"t_us,x0y0,x0y0\n0,1,2\n"),
    ("a.csv", b"t_us,x0y0,heel\n0,1,2\n"),
    ("a.csv", b"t_us,x0y0\n0,1\n1,2,3\n"),
    ("a.csv", b"t_us,x9999y9999\n0,1\n"),
    ("a.txt", b"hello"),
    ("a.h5", b"\x89HDF\r\n\x1a\n"),
    ("a.h5", b"hello"),
    ("a.h5", h5_of_another_file()),
    ("a.bag", b"#ROSBAG V2.0"),
]


def test_messages_of_files(tmp_path, snapshot):
    said = []
    for name, content in FILES:
        path = tmp_path / name
        path.write_bytes(content)
        with pytest.raises(FormatError) as caught:
            taxel.open(path)
        path.unlink()
        said.append(str(caught.value).replace(str(tmp_path), "DIR"))
        assert name in said[-1]
        assert "\n" not in said[-1]
    assert said == snapshot


def recorded(sources):
    return lambda folder: taxel.live.Live(0, host="127.0.0.1", record=folder / "no.mcap", sources=sources)


CALLS = {
    "no place": recorded({"imu": "nowhere"}),
    "no columns": recorded({"imu": "given"}),
    "one name twice": recorded({"imu": "given,columns=a:a"}),
    "a time alone": recorded({"imu": "given,columns=t_us"}),
    "the board's name": recorded({"board": "given,columns=a"}),
    "a blank in a name": recorded({"a b": "given,columns=a"}),
    "no text": recorded({"imu": 3}),
    "no source": recorded(["imu"]),
    "an option": recorded({"imu": "given,columns=a,speed=3"}),
}


def test_messages_of_live_sources(tmp_path, snapshot):
    assert messages(CALLS, tmp_path) == snapshot
    assert not list(tmp_path.iterdir())
