"""The live panel: frames a second beside nine other clients, seeking and opening recordings.

Sender and clients share this machine, over loopback, the sender a process of its own. The fast client reads all
messages and sends a credit for each frame, as the others do in a process of their own. CPU is of the threads
`taxel-panel`, which serves, and `taxel-view`, which takes the events. Times of a seek are from the request to the frame
with its 5 s of raster.

Recordings of frames are an hour of both insoles, 2 x 99 sensors at 100 Hz, as .mcap, one of them as .h5 and as a text
table, all in the page cache. A client's times of opening are from its request to the first frame and the
overview. CPU is of this process and its children, medians of rounds.

Peer: none but ten clients, as nothing else speaks its protocol. Unit: frames; cores; ms of a seek; s. Goal: 50 frames
a second beside nine others, nothing lost, .06 core of the server alone and .14 with the others, a GB
indexed within 2 s (scaled from 218 and 135 MB), any time within 50 ms; an hour of insoles opens in 2 s, a text table
shows its first frame in 2 s; taxel view answers within 1 s.
"""

from __future__ import annotations

import json
import pickle
import resource
import tempfile
import time
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from subprocess import Popen
from typing import TYPE_CHECKING, Any

import numpy as np

import taxel
from taxel.live import Live
from taxel.panel import Panel
from taxel_benchmarks._goals import Goal
from taxel_benchmarks._rounds import ALL, script, thread_seconds

if TYPE_CHECKING:
    from websockets.sync.client import ClientConnection

SIDE, CHANGES_PER_S = 64, 1e5
#: The modules that the clients of the panel need.
PEERS = {ALL: "websockets"}
#: Goals for the server's cores, by the number of other clients.
CORES = {0: 0.06, 9: 0.14}

#: Bytes of a datagram: 19 changes and their values, 192 us of them.
EACH = 190

SEND = """
import pickle, sys
from taxel.live import send
send(pickle.load(open(sys.argv[1], "rb")), port=int(sys.argv[2]), period_us=190.0, seconds=float(sys.argv[3]))
"""


#: Other clients, which read all messages and send a credit for each frame.
CROWD = """
import asyncio, sys
from websockets.asyncio.client import connect
host, token, count = sys.argv[1], sys.argv[2], int(sys.argv[3])
async def one():
    kinds = ["taxel.panel.1", f"token.{token}"]
    async with connect(f"ws://{host}/socket", origin=f"http://{host}", subprotocols=kinds, max_size=None) as client:
        await client.send('{"type":"credit","n":2}')
        async for message in client:
            if isinstance(message, bytes):
                await client.send('{"type":"credit","n":1}')
async def all():
    await asyncio.gather(*[one() for _ in range(count)])
asyncio.run(all())
"""


def events(count: int, seconds: float) -> taxel.Events:
    """Return changes spread over an array and over time, ten touches a second."""
    random = np.random.default_rng(18)
    t = np.sort(random.uniform(0, seconds * 1e6, count).astype(np.int64) // 100 * 100)
    middle = (t // 100_000 * 17) % SIDE
    x, y = (np.clip(middle + random.integers(-6, 7, count), 0, SIDE - 1) for _ in range(2))
    p = random.integers(0, 2, count) == 1
    return taxel.Events(
        t, x, y, p, intensity=random.integers(40, 140, count), array=taxel.Array(SIDE, SIDE, name="bench")
    )


def connected(panel: Panel) -> ClientConnection:
    """Connect a client that has requested two frames."""
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


def sending(port: int, seconds: float, scratch: Path) -> Popen[str]:
    """Send events to a port, by a process of its own."""
    words = taxel.wire.encode(events(round(CHANGES_PER_S), 1.0))
    payload = scratch / "events.pickle"
    payload.write_bytes(pickle.dumps([words[k : k + EACH] for k in range(0, len(words), EACH)]))
    return script(SEND, payload, port, seconds)


def server_seconds() -> float:
    """Return the CPU time of the panel's threads so far."""
    return sum(seconds for name, seconds in thread_seconds().items() if name in ("taxel-panel", "taxel-view"))


def following(others: int, seconds: float, scratch: Path) -> dict[str, Any]:
    """Count the frames of a fast client while events arrive."""
    array = taxel.Array(SIDE, SIDE, name="bench")
    with Live(0, host="127.0.0.1", array=array) as live, Panel(live, folder=scratch) as panel:
        address = "{}:{}".format(*panel.address)
        crowd = script(CROWD, address, panel.token, others)
        good = connected(panel)
        while panel.viewers <= others:
            time.sleep(0.05)
        sender = sending(live.address[1], seconds + 1.0, scratch)
        time.sleep(0.5)
        frames, before, begun = 0, server_seconds(), time.perf_counter()
        while time.perf_counter() - begun < seconds:
            if isinstance(good.recv(timeout=60), bytes):
                frames += 1
                good.send(json.dumps({"type": "credit", "n": 1}))
        wall = time.perf_counter() - begun
        cpu = server_seconds() - before
        sender.wait()
        crowd.kill()
        crowd.wait()
        good.socket.close()
        capture = live.counters["capture"]
    return {
        "others": others,
        "frames_per_s": frames / wall,
        "server_cores": cpu / wall,
        "lost": capture["dropped_by_kernel"] + capture["dropped_by_queue"],
    }


def seeking(version: int, count: int, seeks: int, scratch: Path) -> dict[str, Any]:
    """Seek in a recording of this number of changes, in the words of a version of the wire."""
    path, made = scratch / f"seek{version}.mcap", events(count, count / CHANGES_PER_S)
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
    from taxel.reading import Facts, InMemory  # noqa: PLC0415  a recording in memory

    random, n = np.random.default_rng(7), round(100 * seconds)
    y, x = np.divmod(np.arange(99), 9)
    array = taxel.Array(1, 99, name="bench insole", places=taxel.Places(10.0 * x, 24.0 * y, unit="mm"))
    t = np.arange(n, dtype=np.int64) * 10_000
    feet: list[InMemory] = []
    for k, foot in enumerate(("left", "right")):
        phase = (np.arange(n) / 100 + k / 2) % 1.0
        load = np.where(phase < 0.6, np.sin(np.pi * phase / 0.6), 0.0)[:, None] * random.random(99) * 300
        values = np.round(load * (1 + 0.05 * random.standard_normal((n, 1))), 1).astype(np.float32)
        frames = taxel.Frames(values[:, None], t, unit="kPa", array=array)
        feet.append(InMemory(Facts(path=Path("insoles"), array=array, kind="pedar", label=foot, side=foot), frames))
    return taxel.Recording.of(*feet)


def opening(path: Path) -> dict[str, Any]:
    """Open a recording of frames; measure the time to the first frame and to the overview."""
    with Panel(path) as panel:
        client = connected(panel)
        cpu, begun = used_s(), time.perf_counter()
        client.send(json.dumps({"type": "open", "name": path.name}))
        client.send(json.dumps({"type": "overview"}))
        times: dict[str, float] = {}
        is_open = False
        while not {"frame_s", "overview_s"} <= times.keys():
            message = client.recv(timeout=600)
            now = time.perf_counter() - begun
            if isinstance(message, bytes):
                client.send(json.dumps({"type": "credit", "n": 1}))
                if is_open:
                    times.setdefault("frame_s", now)
                continue
            kind = json.loads(message)["type"]
            is_open |= kind == "opened"
            if kind == "overview":
                times.setdefault("overview_s", now)
        cpu = used_s() - cpu
        client.socket.close()
    return {**times, "cpu_s": cpu}


def used_s() -> float:
    """Return the CPU time of this process and of its children that have ended."""
    of = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in of)


def medians(rounds: int, measured: Callable[[], dict[str, Any]]) -> dict[str, float]:
    """Measure several times; return the median of each number."""
    every = [measured() for _ in range(rounds)]
    return {name: float(np.median([one[name] for one in every])) for name in every[0]}


def answering(file: Path) -> dict[str, float]:
    """Return how long `taxel view` takes until it says its address."""
    begun = time.perf_counter()
    with script(
        "import sys\nfrom taxel.cli import main\nmain(sys.argv[1:])", "view", file, "--no-open", "--json"
    ) as view:
        assert view.stdout is not None  # a pipe
        view.stdout.readline()
        wall = time.perf_counter() - begun
        view.kill()
    return {"wall_s": wall}


def openings(seconds: float, rounds: int, scratch: Path) -> list[dict[str, Any]]:
    """Open both insoles from a .mcap, one from a .h5 and from a text table: by a client, and by `taxel view`."""
    both = insoles(seconds)
    files = {
        scratch / "insoles.mcap": both,
        **{scratch / f"insole.{end}": both.sources["left"] for end in ("h5", "csv")},
    }
    rows = []
    for file, of in files.items():
        taxel.convert(of, file)
        row: dict[str, Any] = {"file": file.name, "file_mb": file.stat().st_size / 1e6}
        row |= medians(rounds, partial(opening, file))
        rows.append(row | {"view": medians(rounds, partial(answering, file))})
    return rows


def goals(result: Mapping[str, Any]) -> list[Goal]:
    """Return the goals with what a result reached."""
    rows, (*hours, table) = result["following"], result["opening"]
    found = [
        Goal("frames/s beside others, the least", min(row["frames_per_s"] for row in rows), 50),
        Goal("frames lost", sum(row["lost"] for row in rows), 0, at_most=True),
        *(
            Goal(f"the server's cores, {row['others']} others", row["server_cores"], CORES[row["others"]], at_most=True)
            for row in rows
            if row["others"] in CORES
        ),
        Goal(
            "an hour of insoles opens, s",
            max(max(one["frame_s"], one["overview_s"]) for one in hours),
            2,
            at_most=True,
        ),
        Goal("a text table shows its first frame, s", table["frame_s"], 2, at_most=True),
        Goal("taxel view answers, s", max(one["view"]["wall_s"] for one in result["opening"]), 1, at_most=True),
    ]
    for one in result["seeking"]:
        version = f"version {one['version']}"
        scaled = f"{version}: a GB indexed, scaled from {one['file_mb']:.0f} MB, s"
        found.append(Goal(scaled, one["index"]["wall_s_per_gb"], 2, at_most=True))
        found.append(Goal(f"{version}: any time, ms", one["seek_ms"]["max"], 50, at_most=True))
    return found


def run(*, quick: bool) -> dict[str, Any]:
    seconds = 1.0 if quick else 5.0
    with tempfile.TemporaryDirectory() as folder:
        scratch = Path(folder)
        rows = [following(others, seconds, scratch) for others in CORES]
        sought = [seeking(v, 200_000 if quick else 20_000_000, 5 if quick else 50, scratch) for v in (1, 2)]
        opened = openings(10.0 if quick else 3600.0, 1 if quick else 3, scratch)
    ratios = {f"{row['others']} others: frames/s over 50": row["frames_per_s"] / 50 for row in rows}
    ratios |= {f"{row['others']} others: the server's cores": row["server_cores"] for row in rows}
    ratios |= {f"{one['file']}: 2 s over the first frame": 2 / one["frame_s"] for one in opened}
    return {"following": rows, "seeking": sought, "opening": opened, "ratios": ratios}
