"""Windows of several servers that label the recordings of one folder at once, while a hand writes the tables."""

from __future__ import annotations

import json
import os
import random
import signal
import socket
import threading
import time
from collections import Counter
from contextlib import ExitStack, contextmanager
from types import SimpleNamespace
from urllib.parse import urlsplit

import numpy as np
import pytest
from panel.protocol import SOON, Client
from tests.panel.browser import running
from websockets.exceptions import WebSocketException

import taxel

#: Where labels may be, us.
LAST_US = 10_000_000


def walks(folder, count=1):
    """Write recordings of ten seconds; return their names."""
    names = [f"walk{k}.mcap" for k in range(count)]
    for name in names:
        events = taxel.Events(np.array([0, LAST_US]), [1, 1], [2, 2], [True, False], array=taxel.Array(8, 8))
        taxel.convert(events, folder / name)
    return names


@contextmanager
def server(folder, name):
    """A `taxel view` of its own; also how to connect to it."""
    with running("view", name, "--no-open", "--json", folder=folder) as process:
        said = json.loads(process.wait_for(r"(\{.*\})"))
        url = urlsplit(said["url"])
        yield process.process, SimpleNamespace(address=(url.hostname, url.port), token=said["token"])


def labels_of(page, name):
    """The last `labels` of a recording."""
    return next(m for m in reversed(page.said) if m["type"] == "labels" and m["name"] == name)


def table_of(folder, name):
    return folder / name.replace(".mcap", ".notes.csv")


def held(table):
    return Counter((row.text, row.t) for row in taxel.Labels(table).rows) if table.exists() else Counter()


def conflict_of(message):
    rows = (message["conflict"] or {"missing": []})["missing"]
    return Counter((row["label"], row["t_us"]) for row in rows)


def until(true, what):
    end = time.monotonic() + SOON
    while time.monotonic() < end:
        if found := true():
            return found
        time.sleep(0.05)
    raise AssertionError(f"not within {SOON} s: {what}")


class Window(threading.Thread):
    """Somebody who marks, renames, moves and deletes labels of their own at random."""

    def __init__(self, where, number, names, seed, ends):
        super().__init__()
        self.where, self.number, self.names, self.ends = where, number, names, ends
        self.choose = random.Random(f"{seed} {number}")
        #: What was acknowledged to it, by table.
        self.held = {name: Counter() for name in names}
        self.times = iter(range(number, LAST_US, 97))
        self.done, self.error = 0, None

    def run(self):
        try:
            with Client(self.where) as page:
                while time.monotonic() < self.ends:
                    self.visit(page, self.choose.choice(self.names))
        except BaseException as error:
            self.error = error
            raise

    def visit(self, page, name):
        assert page.ask("open", name=name)["type"] == "done"
        mine = self.held[name]
        for _ in range(self.choose.randrange(1, 5)):
            rows = [row for row in labels_of(page, name)["labels"] if row["label"].startswith(f"w{self.number} ")]
            fresh = (f"w{self.number} {self.choose.choice('abc')}", next(self.times))
            kind = self.choose.choice(["mark", "mark", "rename", "move", "delete"]) if rows else "mark"
            row = self.choose.choice(rows) if rows else {"label": "", "t_us": 0, "label_id": 0}
            old = row["label"], row["t_us"]
            new = {"mark": fresh, "rename": (fresh[0], old[1]), "move": (old[0], fresh[1])}.get(kind)
            asked = {"label": new[0]} if kind in ("mark", "rename") else {}
            asked |= {"t_us": new[1]} if kind in ("mark", "move") else {}
            asked |= {} if kind == "mark" else {"label_id": row["label_id"]}
            if page.ask(kind, **asked)["type"] != "done":
                continue
            self.done += 1
            if kind != "mark" and mine[old]:
                mine[old] -= 1
            if new is not None:
                # A label that becomes equal to another is one with it.
                mine[new] = max(1, mine[new])


def write_by_hand(folder, names, choose, ends, *, older):
    """Append lines until a time, and with `older` also save older texts; return the lines."""
    appended, texts = {name: Counter() for name in names}, {name: [] for name in names}
    for k in range(10**6):
        if time.monotonic() > ends:
            break
        name = choose.choice(names)
        table = table_of(folder, name)
        if not table.exists():
            continue
        texts[name].append(table.read_bytes())
        way = choose.choice(["append", "older", "older in place"] if older else ["append"])
        if way == "append":
            with table.open("a") as file:
                file.write(f"hand,{k}\n")
            appended[name]["hand", k] += 1
        elif way == "older":
            (folder / "editor").write_bytes(choose.choice(texts[name]))
            os.replace(folder / "editor", table)
        else:
            table.write_bytes(choose.choice(texts[name]))
        time.sleep(choose.uniform(0.01, 0.1))
    return appended


def attack(folder, servers, clients, tables, seconds, *, older):
    """Let windows and a hand write, and compare what was acknowledged with the tables and their conflicts."""
    seed = random.randrange(10**6)
    print("seed", seed)
    choose = random.Random(seed)
    names = walks(folder, tables)
    with ExitStack() as held_open:
        where = [held_open.enter_context(server(folder, names[0]))[1] for _ in range(servers)]
        ends = time.monotonic() + seconds
        windows = [Window(where[k % servers], k, names, seed, ends) for k in range(servers * clients)]
        for window in windows:
            window.start()
        appended = write_by_hand(folder, names, choose, ends, older=older)
        for window in windows:
            window.join()
        assert not [window.error for window in windows if window.error]
        print(sum(window.done for window in windows), "acknowledged")
        # All servers end with the same labels as the table.
        with ExitStack() as pages:
            clients = [pages.enter_context(Client(place)) for place in where]
            for name in names:
                acknowledged = sum((window.held[name] for window in windows), Counter())
                for page in clients:
                    page.ask("open", name=name)
                    told = labels_of(page, name)
                    rows = Counter((row["label"], row["t_us"]) for row in told["labels"])
                    assert rows == held(table_of(folder, name))
                    lost = +acknowledged - (rows + conflict_of(told))
                    assert not lost, (name, lost)
                    if not older:
                        assert told["conflict"] is None
                        assert rows == +acknowledged + appended[name]
            if older:
                for name in names:
                    settle(clients, name, sum((window.held[name] for window in windows), Counter()))


def settle(pages, name, acknowledged):
    """End the conflict of a table in one window, so that it ends in all of them."""
    told = labels_of(pages[0], name)
    if told["conflict"] is None:
        return
    pages[0].ask("open", name=name)
    told = labels_of(pages[0], name)
    assert pages[0].ask("settle", conflict_id=told["conflict"]["conflict_id"], keep="acknowledged")["type"] == "done"
    for page in pages:
        page.ask("open", name=name)
        told = labels_of(page, name)
        assert told["conflict"] is None
        assert not +acknowledged - Counter((row["label"], row["t_us"]) for row in told["labels"])


@pytest.mark.parametrize("older", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_what_windows_were_told_is_done_is_in_the_table_or_in_conflict(older, tmp_path):
    attack(tmp_path, servers=2, clients=2, tables=2, seconds=2, older=older)


@pytest.mark.slow
@pytest.mark.parametrize("older", [False, True])
def test_the_same_with_three_servers_and_twenty_tables(older, tmp_path):
    attack(tmp_path, servers=3, clients=2, tables=20, seconds=60, older=older)


def opened(page, name):
    assert page.ask("open", name=name)["type"] == "done"
    return labels_of(page, name)


def test_a_hundred_marks_at_once_are_all_done_although_their_client_leaves(tmp_path):
    (name,) = walks(tmp_path)
    with server(tmp_path, name) as (_, where):
        with Client(where) as page:
            opened(page, name)
            for k in range(100):
                page.send(type="mark", id=1000 + k, label="heel", t_us=k)
            answers = {page.until("done")["id"] for _ in range(100)}
            assert answers == set(range(1000, 1100))
            assert held(table_of(tmp_path, name)) == {("heel", k): 1 for k in range(100)}
        with Client(where) as page:
            opened(page, name)
            for k in range(300):
                page.send(type="mark", id=k, label="toe", t_us=k)
            # It leaves without a word, and without reading an answer.
            raw = page.socket.socket
            raw.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\0" * 8)
            raw.shutdown(socket.SHUT_RDWR)
            until(lambda: sum(held(table_of(tmp_path, name)).values()) == 400, "all that arrived is carried out")


def test_a_killed_server_has_lost_nothing_that_it_acknowledged(tmp_path):
    (name,) = walks(tmp_path)
    choose = random.Random()
    done = Counter()
    for round_ in range(3):
        with server(tmp_path, name) as (process, where):
            killer = threading.Timer(choose.uniform(0.2, 1.0), process.send_signal, (signal.SIGKILL,))
            try:
                with Client(where) as page:
                    opened(page, name)
                    killer.start()
                    for k in range(10**6):
                        page.ask("mark", label=f"heel {round_}", t_us=k)
                        done[f"heel {round_}", k] += 1
            except (OSError, WebSocketException):
                killer.join()
        assert not done - held(table_of(tmp_path, name))
    assert sum(done.values()) > 10
    with server(tmp_path, name) as (_, where), Client(where) as page:
        assert opened(page, name)["conflict"] is None


def test_the_labels_of_another_window_and_of_a_hand_appear_by_themselves(tmp_path):
    (name,) = walks(tmp_path)
    with (
        server(tmp_path, name) as (_, one),
        server(tmp_path, name) as (_, other),
        Client(one) as here,
        Client(other) as there,
    ):
        opened(here, name)
        opened(there, name)
        assert here.ask("mark", label="heel", t_us=5)["type"] == "done"
        mine = labels_of(here, name)["labels"][0]["label_id"]
        shown = there.until("labels")["labels"]
        assert [(row["label"], row["t_us"]) for row in shown] == [("heel", 5)]
        with table_of(tmp_path, name).open("a") as hand:
            hand.write("toe,7\n")
        assert [row["label"] for row in there.until("labels")["labels"]] == ["heel", "toe"]
        assert there.ask("rename", label_id=shown[0]["label_id"], label="ball")["type"] == "done"
        # The first window may not know of it yet: its label is gone.
        refused = here.ask("move", label_id=mine, t_us=9)
        if refused["type"] == "refused":
            assert "perhaps by another" in refused["reason"] or "another window" in refused["reason"]
        assert held(table_of(tmp_path, name)) == {("ball", 5): 1, ("toe", 7): 1}


def test_a_conflict_is_shown_to_all_until_one_settles_it_and_over_a_restart(tmp_path):
    (name,) = walks(tmp_path)
    table = table_of(tmp_path, name)
    with server(tmp_path, name) as (_, where), Client(where) as page:
        opened(page, name)
        page.ask("mark", label="heel", t_us=5)
        older = table.read_text()
        page.ask("mark", label="toe", t_us=7)
        page.ask("move", label_id=labels_of(page, name)["labels"][0]["label_id"], t_us=6)
        table.write_text(older + "hand,9\n")
        conflict = page.until("labels")["conflict"]
    with server(tmp_path, name) as (_, where), Client(where) as page, Client(where) as other:
        opened(other, name)
        again = opened(page, name)["conflict"]

        def rows(kind):
            assert again[kind] == conflict[kind]
            return [(row["label"], row["t_us"]) for row in again[kind]]

        assert [rows(kind) for kind in ("missing", "returned", "new")] == [
            [("toe", 7), ("heel", 6)],
            [("heel", 5)],
            [("hand", 9)],
        ]
        number = again["conflict_id"]
        assert page.ask("settle", conflict_id=number, keep="both")["field"] == "keep"
        assert page.ask("settle", conflict_id=number + 1, keep="file")["field"] == "conflict_id"
        assert page.ask("settle", conflict_id=number, keep="acknowledged")["type"] == "done"
        for one in (page, other):
            told = one.since_asked("labels", conflict=None)
            assert [(row["label"], row["t_us"]) for row in told["labels"]] == [("heel", 6), ("toe", 7), ("hand", 9)]
        assert page.ask("settle", conflict_id=number, keep="acknowledged")["type"] == "refused"


def test_several_marks_are_one_request_that_is_done_or_not(tmp_path):
    (name,) = walks(tmp_path)
    table = table_of(tmp_path, name)
    with server(tmp_path, name) as (_, where), Client(where) as page:
        opened(page, name)
        times = [10, 20, 30]
        group = {"label": "heel", "source": "left", "t_us": times, "replaces_us": times}
        for wrong, field in (
            ([], "labels"),
            ("heel", "labels"),
            ([group, 3], "labels"),
            ([{**group, "t_us": 5}], "t_us"),
            ([group, {**group, "t_us": [1, "soon"]}], "t_us"),
            ([group, {**group, "t_us": [10**12, 1, 2]}], "t_us"),
            ([group, {**group, "replaces_us": [1]}], "replaces_us"),
            ([group, {**group, "label": ""}], "label"),
            ([{"label": "heel", "t_us": list(range(5001))}], "labels"),
        ):
            assert page.ask("marks", labels=wrong)["field"] == field, wrong
        assert not table.exists()
        assert page.ask("marks", labels=[group, {"label": "toe", "t_us": [15]}])["type"] == "done"
        assert table.read_text() == (
            "label,t_us,source,replaces_us\nheel,10,left,10\ntoe,15,,\nheel,20,left,20\nheel,30,left,30\n"
        )
        # Long names make a request of more than 1 MB.
        late = list(range(LAST_US - 5000, LAST_US))
        each = [{"label": f"{k:0200}", "t_us": [t]} for k, t in enumerate(late)]
        assert page.ask("marks", labels=each)["type"] == "done"
        assert sum(held(table).values()) == 5004


def test_a_table_that_cannot_be_read_refuses_marks_and_is_not_written(tmp_path):
    (name,) = walks(tmp_path)
    table = table_of(tmp_path, name)
    with server(tmp_path, name) as (_, where), Client(where) as page:
        opened(page, name)
        page.ask("mark", label="heel", t_us=5)
        table.write_text("label,t_us\nheel,soon\n")
        assert "t_us is 'soon'" in page.until("warning")["text"]
        assert "nothing was saved" in page.ask("mark", label="toe", t_us=7)["reason"]
        assert table.read_text() == "label,t_us\nheel,soon\n"
        table.write_text("label,t_us\nheel,5\n")
        assert page.ask("mark", label="toe", t_us=7)["type"] == "done"
        assert labels_of(page, name)["conflict"] is None


def test_more_marks_than_are_read_at_a_time_are_all_done(tmp_path):
    (name,) = walks(tmp_path)
    with server(tmp_path, name) as (_, where), Client(where) as page:
        opened(page, name)
        for k in range(3000):
            page.send(type="mark", id=k, label="heel", t_us=k)
        assert {page.until("done")["id"] for _ in range(3000)} == set(range(3000))
        assert sum(held(table_of(tmp_path, name)).values()) == 3000


def test_an_emptied_table_is_one_without_labels(tmp_path):
    (name,) = walks(tmp_path)
    table = table_of(tmp_path, name)
    with server(tmp_path, name) as (_, where), Client(where) as page:
        table.write_text("")
        assert opened(page, name)["labels"] == []
        page.ask("mark", label="heel", t_us=5)
        table.write_text("")
        assert page.until("labels", labels=[])["conflict"]["missing"][0]["label"] == "heel"
        number = labels_of(page, name)["conflict"]["conflict_id"]
        assert page.ask("settle", conflict_id=number, keep="acknowledged")["type"] == "done"
        assert held(table) == {("heel", 5): 1}
