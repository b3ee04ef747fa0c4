"""What estimators notice is told once for all trials, however these were cut into blocks."""

from __future__ import annotations

import json

from engine import runner
from engine.notes import Example, Least, Most, Note, join, of_plain
from engine.scenario import library, toml


def test_counts_add_up_and_the_furthest_figures_stay():
    first = Note("{} of {}, after {:.0f} s, up to {:.1f} m", 2, "auv-1", Least(61.0), Most(4.0))
    second = Note(first.words, 3, "auv-1", Least(12.0), Most(3.5))
    other = Note(first.words, 1, "auv-2", Least(5.0), Most(9.0))
    joined = join([first, "words {alone}", second, other, "words {alone}"])
    assert [str(note) for note in joined] == [
        "5 of auv-1, after 12 s, up to 4.0 m",
        "words {alone}",
        "1 of auv-2, after 5 s, up to 9.0 m",
    ]
    assert str(join([*joined, joined[0]])[0]) == "10 of auv-1, after 12 s, up to 4.0 m"


def test_of_examples_the_first_is_told():
    notes = [Note("{} arrays, such as {}", 2, Example(where)) for where in ("pose 3", "pose 9")]
    again = of_plain(json.loads(json.dumps(notes[1].plain())))
    assert [str(note) for note in join([notes[0], again])] == ["4 arrays, such as pose 3"]


def test_a_note_is_written_and_read_again():
    note = Note("{} of {}, after {:.0f} s", 2, "{auv}", Least(61.5)).about("ship")
    again = of_plain(json.loads(json.dumps(note.plain())))
    assert again == note and str(again) == str(note)
    assert str(join([again, note])[0]) == "ship: 4 of {auv}, after 62 s"


def test_a_run_of_several_blocks_tells_of_all_trials_at_once():
    scenario = toml.override(library.shipped("first-look"), {"trials": 60, "duration_s": 300})
    blocks = runner.blocks(60)
    assert len(blocks) > 1
    apart = [runner.run_shard(scenario, runner.Shard("deif", block))[1].notes for block in blocks]
    notes = [note for block in apart for note in block if isinstance(note, Note) and "lost a packet" in note.words]
    told = [text for text in runner.run(scenario, ["deif"]).to_json()["algorithms"]["deif"]["notes"] if "lost" in text]
    assert len(told) == len({note.figures[:2] for note in notes}) < len(notes)
    for who, lost in {note.figures[:2] for note in notes}:
        mine = [note.figures for note in notes if note.figures[:2] == (who, lost)]
        trials, first_s = sum(f[2] for f in mine), min(f[3] for f in mine)  # type: ignore[type-var,misc]
        assert any(
            t.startswith(f"{who}: lost a packet of {lost} in {trials} trials, first after {first_s:.0f} s")
            for t in told
        )
