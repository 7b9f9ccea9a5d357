"""The join of a table of labels with what was acknowledged: nothing is lost, in any order, as often as asked."""

from __future__ import annotations

import random
from collections import Counter

from hypothesis import given
from hypothesis import strategies as st

from taxel.labels import Note
from taxel.live._label_join import Acknowledged, Edit, conflict_of, fold, join, minus, settled

NOTES = st.builds(
    Note,
    st.sampled_from(["heel", "toe"]),
    st.integers(0, 2),
    source=st.sampled_from(["", "left"]),
)
TABLES = st.lists(NOTES, max_size=8)


def keys(rows) -> Counter:
    return Counter((row.text, row.t, row.source, row.recording, row.replaces) for row in rows)


def edits_of(rows, choose: random.Random) -> Edit:
    """Draw a change of a table as a window may ask for."""
    fresh = Note(choose.choice(["heel", "toe", "ball"]), choose.randrange(3))
    if not rows or choose.random() < 0.4:
        return Edit(None, fresh)
    old = choose.choice(rows)
    kind = choose.choice(["rename", "move", "delete"])
    new = {"rename": Note(fresh.text, old.t, source=old.source, recording=old.recording), "delete": None}
    return Edit(old, new.get(kind, Note(old.text, fresh.t, source=old.source, recording=old.recording)))


@given(TABLES, st.randoms(use_true_random=False), st.lists(st.sampled_from(["change", "older", "append", "drop"])))
def test_whatever_another_program_writes_what_was_acknowledged_is_in_the_table_or_in_conflict(
    table, choose: random.Random, steps: list[str]
) -> None:
    rows, known, texts = tuple(table), Acknowledged(), [tuple(table)]
    expected: Counter = Counter()
    for step in steps:
        if step == "change":
            edit = edits_of(rows, choose)
            before = keys(rows)
            joined = join(known, rows, [[edit]])
            rows, known = joined.rows, joined.acknowledged
            assert not isinstance(joined.outcomes[0], str)
            old, new = keys([edit.old] if edit.old else []), keys([edit.new] if edit.new else [])
            # A row that is there already is not marked again, and one that becomes equal to it is one with it.
            left = before - old
            wanted = left + (new if old == new or not left & new else Counter())
            assert keys(rows) == wanted
            for key in old:
                expected[key] = min(expected[key], (before - old)[key] + max(0, expected[key] - before[key]))
            for key in new:
                expected[key] = expected[key] + 1 if old == new else max(1, expected[key])
            texts.append(rows)
        elif step == "older":
            rows = choose.choice(texts)
        elif step == "append":
            rows = (*rows, Note("hand", choose.randrange(8)))
        elif rows:
            rows = minus(rows, [choose.choice(rows)])
        conflict = conflict_of(known, rows)
        assert keys(known.labels) == +expected
        assert not +expected - (keys(rows) + keys(conflict.missing)), "nothing that was acknowledged is lost"
        # Both ends of the conflict.
        restored = settled(known, rows, conflict, restore=True)
        assert not conflict_of(restored.acknowledged, restored.rows)
        assert keys(restored.rows) == keys(rows) - keys(conflict.returned) + keys(conflict.missing)
        accepted = settled(known, rows, conflict, restore=False)
        assert keys(accepted.rows) == keys(rows)
        assert not conflict_of(accepted.acknowledged, accepted.rows)


@given(TABLES, st.randoms(use_true_random=False))
def test_the_order_of_changes_of_several_windows_does_not_matter(table, choose: random.Random) -> None:
    # Each row is changed once, into one that no other change makes.
    changes, left = [], list(table)
    for k in range(5):
        edit = edits_of(left, choose)
        if edit.old is not None:
            left.remove(edit.old)
        new = edit.new and Note(f"{edit.new.text} {k}", edit.new.t, source=edit.new.source)
        changes.append([Edit(edit.old, new)])
    one = join(Acknowledged(), table, changes)
    choose.shuffle(changes)
    other = join(Acknowledged(), table, changes)
    step = join(Acknowledged(), table, [])
    for change in changes:
        step = join(step.acknowledged, step.rows, [change])
    for joined in (other, step):
        assert keys(joined.rows) == keys(one.rows)
        assert keys(joined.acknowledged.labels) == keys(one.acknowledged.labels)


@given(TABLES, st.randoms(use_true_random=False))
def test_a_request_that_is_repeated_changes_nothing_more(table, choose: random.Random) -> None:
    edit = edits_of(tuple(table), choose)
    # A row that stands there several times can be changed as often.
    if edit.old is not None and keys(table)[next(iter(keys([edit.old])))] > 1:
        return
    once = join(Acknowledged(), table, [[edit]])
    again = join(once.acknowledged, once.rows, [[edit]])
    if edit.old == edit.new:
        return
    assert keys(again.rows) == keys(once.rows)
    assert keys(again.acknowledged.labels) == keys(once.acknowledged.labels)


@given(TABLES, st.randoms(use_true_random=False))
def test_a_request_of_several_edits_is_carried_out_whole_or_not_at_all(table, choose: random.Random) -> None:
    request = [edits_of(tuple(table), choose) for _ in range(3)]
    absent = Edit(Note("nowhere", 99), Note("there", 1))
    place = choose.randrange(4)
    joined = join(Acknowledged(), table, [[*request[:place], absent, *request[place:]], [Edit(None, Note("ball", 3))]])
    assert isinstance(joined.outcomes[0], str)
    assert joined.outcomes[1] == (Note("ball", 3),)
    assert keys(joined.rows) == keys(table) + keys([Note("ball", 3)])


@given(TABLES, TABLES, TABLES)
def test_what_a_program_writes_to_a_replaced_table_is_made_on_the_new_one(before, after, added) -> None:
    theirs = (*before, *added)
    joined = fold(Acknowledged(labels=tuple(added), table=theirs), theirs, before, after)
    assert keys(joined.rows) == keys(theirs) - (keys(before) - keys(after)) + (keys(after) - keys(before))
    conflict = conflict_of(joined.acknowledged, joined.rows)
    assert not keys(added) - (keys(joined.rows) + keys(conflict.missing))


def test_a_note_that_a_deleted_label_replaced_counts_again_with_a_mark() -> None:
    label, removal = Note("heel", 5, replaces=4), Note("", 5, replaces=4)
    removed = join(Acknowledged(), [label], [[Edit(label, removal)]])
    assert removed.rows == (removal,)
    marked = join(removed.acknowledged, removed.rows, [[Edit(None, Note("toe", 6, replaces=4))]])
    assert keys(marked.rows) == keys([Note("toe", 6, replaces=4)])
    assert not conflict_of(marked.acknowledged, marked.rows)


def test_a_deletion_of_one_window_is_no_conflict_for_another_but_an_older_text_is() -> None:
    heel, toe = Note("heel", 5), Note("toe", 7)
    both = join(Acknowledged(), [], [[Edit(None, heel)], [Edit(None, toe)]])
    one = join(both.acknowledged, both.rows, [[Edit(heel, None)]])
    assert not conflict_of(one.acknowledged, one.rows)
    conflict = conflict_of(one.acknowledged, [heel])
    assert (conflict.missing, conflict.returned, conflict.new) == ((toe,), (heel,), ())
    moved = join(both.acknowledged, both.rows, [[Edit(heel, Note("heel", 6))]])
    conflict = conflict_of(moved.acknowledged, [*both.rows, Note("hand", 1)])
    assert (conflict.missing, conflict.returned, conflict.new) == ((Note("heel", 6),), (heel,), (Note("hand", 1),))


def test_a_row_that_is_deleted_once_and_acknowledged_once_does_not_return_to_go_again() -> None:
    heel = Note("heel", 1)
    known = Acknowledged(labels=(heel,), deleted=(heel,), table=())
    assert not conflict_of(known, [heel])
    conflict = conflict_of(known, [heel, heel])
    assert conflict.returned == (heel,)
    assert settled(known, [heel, heel], conflict, restore=True).rows == (heel,)


#: Without rows that differ in nothing but columns that taxel does not know.
SETS = st.lists(NOTES, max_size=8, unique_by=lambda note: (note.text, note.t, note.source))


@given(SETS, st.randoms(use_true_random=False), st.integers(1, 6))
def test_what_takes_a_change_back_restores_the_table(table, choose: random.Random, count: int) -> None:
    """Columns that taxel does not know come back too, and rows that a moved label became one with stay."""
    rows = tuple(Note(n.text, n.t, source=n.source, others=(("comment", str(k)),)) for k, n in enumerate(table))
    request = [edits_of(rows, choose) for _ in range(count)]
    joined = join(Acknowledged(), rows, [request])
    (inverse,) = joined.inverses
    if isinstance(joined.outcomes[0], str):
        assert (inverse, joined.rows) == ((), rows)
        return
    back = join(joined.acknowledged, joined.rows, [inverse])
    assert sorted(back.rows, key=repr) == sorted(rows, key=repr)
    # It can be taken back in turn.
    again = join(back.acknowledged, back.rows, list(back.inverses))
    assert keys(again.rows) == keys(joined.rows)


@given(SETS, SETS, st.booleans())
def test_what_takes_a_settled_conflict_back_restores_the_table(labels, table, restore: bool) -> None:
    base = Acknowledged(labels=tuple(labels), table=tuple(labels))
    conflict = conflict_of(base, table)
    if not conflict:
        return
    joined = settled(base, table, conflict, restore=restore)
    (inverse,) = joined.inverses
    back = join(joined.acknowledged, joined.rows, [inverse])
    assert keys(back.rows) == keys(table)
