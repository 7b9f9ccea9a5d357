"""The live panel: pictures a second beside 99 other clients, CPU of the server, seeking and opening recordings.

Sender and clients share this machine, over loopback, the sender a process of its own. The fast client reads all
messages and sends a credit for each picture; half of the others request pictures and never read. CPU is of
the thread `taxel-panel` alone. Times of a seek are from the request to the picture with its 5 s of raster.

Recordings of pictures are an hour of both insoles, 2 x 99 sensors at 100 Hz, as .mcap and .h5, and a text table of one
insole. Times of opening are from the request to the first picture and to the overview, the file in the page cache.

Peer: a hundred clients of its own, as nothing else speaks its protocol. Unit: pictures/s; cores; ms of a seek. Goal: 50
pictures/s beside 99 others, nothing lost, a GB indexed within 2 s, any time within 50 ms; an hour of insoles opens in
2 s and is complete within 5, a text table shows its first picture in 2 s.
"""

from __future__ import annotations

import json
import os
import pickle
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from _peer import missing
from _rounds import stamp, thread_seconds

import taxel
from taxel import ProblemError
from taxel.live import Live, Panel

if TYPE_CHECKING:
    from websockets.sync.client import ClientConnection

SIDES, CHANGES_PER_S, OTHERS = (64,), 1e5, 99
#: The modules that the clients of the panel need.
PEERS = {"all of it": "websockets"}

#: Bytes of a datagram: 19 changes and their values, 192 us of them.
EACH = 190

SEND = """
import pickle, sys
from taxel.live import send
send(pickle.load(open(sys.argv[1], "rb")), port=int(sys.argv[2]), period_us=190.0, seconds=float(sys.argv[3]))
"""


def events(side: int, count: int, seconds: float) -> taxel.Events:
    """Return changes spread over an array and over time, ten touches a second."""
    random = np.random.default_rng(18)
    t = np.sort(random.uniform(0, seconds * 1e6, count).astype(np.int64) // 100 * 100)
    middle = (t // 100_000 * 17) % side
    x, y = (np.clip(middle + random.integers(-6, 7, count), 0, side - 1) for _ in range(2))
    p = random.integers(0, 2, count) == 1
    return taxel.Events(
        t, x, y, p, intensity=random.integers(40, 140, count), array=taxel.Array(side, side, name="bench")
    )


def connected(panel: Panel) -> ClientConnection:
    """Connect a client that has requested two pictures."""
    from websockets.sync.client import connect  # noqa: PLC0415  an extra

    host = "{}:{}".format(*panel.address)
    client = connect(
        f"ws://{host}/socket",
        origin=f"http://{host}",
        subprotocols=["taxel.panel.1", f"token.{panel.token}"],
        max_size=None,
        open_timeout=60,
    )
    client.send(json.dumps({"type": "credit", "n": 2}))
    return client


def following(side: int, others: int, seconds: float, scratch: Path) -> dict[str, Any]:
    """Count the pictures of a fast client while events arrive."""
    words = taxel.wire.encode(events(side, round(CHANGES_PER_S), 1.0))
    cut = [words[k : k + EACH] for k in range(0, len(words), EACH)]
    payload = scratch / f"{side}.pickle"
    payload.write_bytes(pickle.dumps(cut))
    array = taxel.Array(side, side, name="bench")
    with Live(0, host="127.0.0.1", array=array) as live, Panel(live, folder=scratch) as panel:
        crowd = [connected(panel) for _ in range(others)]
        good = connected(panel)
        arguments = [str(payload), str(live.address[1]), str(seconds + 1.0)]
        sender = subprocess.Popen([sys.executable, "-c", SEND, *arguments])
        time.sleep(0.5)
        pictures, before, begun = 0, thread_seconds().get("taxel-panel", 0.0), time.perf_counter()
        while time.perf_counter() - begun < seconds:
            if isinstance(good.recv(timeout=60), bytes):
                pictures += 1
                good.send(json.dumps({"type": "credit", "n": 1}))
        wall = time.perf_counter() - begun
        cpu = thread_seconds()["taxel-panel"] - before
        sender.wait()
        for one in [good, *crowd]:
            one.socket.close()
        capture = live.counters["capture"]
    return {
        "side": side,
        "others": others,
        "pictures_per_s": pictures / wall,
        "server_cores": cpu / wall,
        "lost": capture["dropped_by_kernel"] + capture["dropped_by_queue"],
    }


def seeking(version: int, count: int, seeks: int, scratch: Path) -> dict[str, Any]:
    """Seek in a recording of this number of changes, in the words of a version of the wire."""
    path, made = scratch / f"seek{version}.mcap", events(64, count, count / CHANGES_PER_S)
    if version == 1:
        raw = scratch / "seek.lsa"
        raw.write_bytes(taxel.wire.encode(made))
        taxel.convert(raw, path)
    else:
        taxel.convert(made, path)
    size, random = path.stat().st_size, np.random.default_rng(1)
    with Panel(path) as panel:
        client = connected(panel)
        client.send(json.dumps({"type": "watch", "taxel": [32, 32]}))
        cpu = time.process_time()
        begun = time.perf_counter()
        client.send(json.dumps({"type": "open", "name": path.name, "id": 1}))
        opened: dict[str, Any] = {}
        while opened.get("type") != "opened":
            message = client.recv(timeout=600)
            opened = {} if isinstance(message, bytes) else json.loads(message)
        index = {"wall_s": time.perf_counter() - begun, "cpu_s": time.process_time() - cpu}
        walls, cpus = [], []
        for t_us in random.integers(opened["start_us"], opened["stop_us"], seeks):
            cpu, begun = time.process_time(), time.perf_counter()
            client.send(json.dumps({"type": "seek", "t_us": int(t_us)}))
            while True:
                message = client.recv(timeout=60)
                if isinstance(message, bytes):
                    client.send(json.dumps({"type": "credit", "n": 1}))
                    if int.from_bytes(message[16:24], "little", signed=True) == t_us:
                        break
            walls.append(1e3 * (time.perf_counter() - begun))
            cpus.append(1e3 * (time.process_time() - cpu))
        client.socket.close()
    return {
        "version": version,
        "file_mb": size / 1e6,
        "changes": count,
        "index": {**index, "cpu_s_per_gb": index["cpu_s"] / size * 1e9, "wall_s_per_gb": index["wall_s"] / size * 1e9},
        "seek_ms": {"median": float(np.median(walls)), "max": max(walls), "cpu_median": float(np.median(cpus))},
    }


def insoles(seconds: float) -> taxel.Recording:
    """Return a walk on two insoles of 99 sensors at 100 Hz: steps of a second, in kPa with fractions."""
    from taxel.recording.contents import Contents, several  # noqa: PLC0415  a recording in memory
    from taxel.recording.opening import FEET  # noqa: PLC0415

    random, n = np.random.default_rng(7), round(100 * seconds)
    t, array = np.arange(n, dtype=np.int64) * 10_000, taxel.Array(1, 99, name="bench insole")
    sources: dict[str, Contents] = {}
    for k, foot in enumerate(FEET):
        phase = (np.arange(n) / 100 + k / 2) % 1.0
        load = np.where(phase < 0.6, np.sin(np.pi * phase / 0.6), 0.0)[:, None] * random.random(99) * 300
        values = np.round(load * (1 + 0.05 * random.standard_normal((n, 1))), 1).astype(np.float32)
        frames = taxel.Frames(values[:, None], t, unit="kPa", array=array)
        sources[foot] = Contents(Path("insoles"), f"insoles {foot}", "pedar", array, label=foot, frames=frames)
    return taxel.Recording(several({foot: one.but(sources=sources) for foot, one in sources.items()}))


def opening(path: Path) -> dict[str, Any]:
    """Open a recording of pictures; measure the time to the first picture, to the overview and to all of it."""
    with Panel(path) as panel:
        client = connected(panel)
        begun = time.perf_counter()
        client.send(json.dumps({"type": "open", "name": path.name}))
        client.send(json.dumps({"type": "overview"}))
        times: dict[str, float] = {}
        left_s: float | None = 0.0
        while not {"picture_s", "overview_s", "complete_s"} <= times.keys():
            message = client.recv(timeout=600)
            now = time.perf_counter() - begun
            if isinstance(message, bytes):
                client.send(json.dumps({"type": "credit", "n": 1}))
                if left_s != 0.0:
                    times.setdefault("picture_s", now)
                continue
            told = json.loads(message)
            if told["type"] == "opened":
                left_s = told["pictures"]["left_s"]
                if left_s is None:
                    times["complete_s"] = now
            elif told["type"] == "overview":
                times.setdefault("overview_s", now)
        client.socket.close()
    return {"file": path.name, "file_mb": path.stat().st_size / 1e6, **times}


def openings(seconds: float, table_seconds: float, scratch: Path) -> list[dict[str, Any]]:
    """Open both insoles from a .mcap, one from a .h5, and one from a text table."""
    both = insoles(seconds)
    files = [scratch / "insoles.mcap", scratch / "insole.h5", scratch / "insole.csv"]
    taxel.convert(both, files[0])
    taxel.convert(both.sources["left"], files[1])
    taxel.convert(insoles(table_seconds).sources["left"], files[2])
    return [opening(file) for file in files]


def run(*, quick: bool) -> dict[str, Any]:
    absent = missing(PEERS)
    if absent:
        if not quick:
            raise ProblemError("panel: its clients need websockets: pip install websockets")
        return stamp() | {"left out": absent, "ratios": {}}
    seconds = 1.0 if quick else 5.0
    load = os.getloadavg()[0]
    with tempfile.TemporaryDirectory() as folder:
        scratch = Path(folder)
        rows = [following(side, others, seconds, scratch) for side in SIDES for others in (0, OTHERS)]
        sought = [seeking(v, 200_000 if quick else 20_000_000, 5 if quick else 50, scratch) for v in (1, 2)]
        opened = openings(10.0 if quick else 3600.0, 5.0 if quick else 600.0, scratch)
    table = opened[-1]
    return {
        "question": (__doc__ or "").splitlines()[0],
        **stamp(),
        "load_before": load,
        "load_after": os.getloadavg()[0],
        "following": rows,
        "seeking": sought,
        "opening": opened,
        "ratios": {
            f"{row['side']} x {row['side']}, {row['others']} others: pictures/s over 50": row["pictures_per_s"] / 50
            for row in rows
        },
        "goals": {
            "50 pictures/s beside 99 others": all(row["pictures_per_s"] >= 50 for row in rows),
            "nothing lost": not any(row["lost"] for row in rows),
            "an hour of insoles opens in 2 s": all(
                max(one["picture_s"], one["overview_s"]) < 2 for one in opened if one is not table
            ),
            "an hour of insoles is complete within 5 s": all(
                one["complete_s"] < 5 for one in opened if one is not table
            ),
            "a text table shows its first picture in 2 s": table["picture_s"] < 2,
            **{
                f"version {one['version']}: {goal}": met
                for one in sought
                for goal, met in {
                    "a GB indexed within 2 s": one["index"]["wall_s_per_gb"] < 2,
                    "any time within 50 ms": one["seek_ms"]["max"] < 50,
                }.items()
            },
        },
        "stable": load < (os.cpu_count() or 1),
    }
