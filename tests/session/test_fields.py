"""Fields and choices: a wrong value is refused with the reason, and changes nothing."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rds.core.errors import InputError
from rds.panels.session import Session
from rds.panels.session.choices import Choices
from rds.panels.session.fields import Choice, Flag, Number, Several, Text

AMPLITUDE = Number("amplitude", "Amplitude", "half of the whole stroke", 5.0, unit="mm", low=0.0, high=150.0)
KIND = Choice("kind", "Kind", "form of the signal", "sine", options={"sine": "Sinusoid", "square": "Square"})


@pytest.mark.parametrize(
    ("written", "meant"),
    [("2.5", 2.5), (" 2,5 ", 2.5), ("2.5 mm", 2.5), ("1e1", 10.0), ("25e−1", 2.5), (7, 7.0), ("150", 150.0)],
)
def test_numbers_are_read_as_people_write_them(written: str, meant: float) -> None:
    assert AMPLITUDE.check(written) == meant


@pytest.mark.parametrize(
    "wrong", ["", "five", "1,000.5", "nan", "inf", "-1", "151", "1e999", "1_0", True, None, [1], "2.5 V"]
)
def test_other_numbers_are_refused_with_range_and_unit(wrong: object) -> None:
    with pytest.raises(InputError, match="Amplitude must be") as refusal:
        AMPLITUDE.check(wrong)
    assert "mm" in str(refusal.value)


def test_ranges_in_words() -> None:
    assert AMPLITUDE.range == "from 0 to 150 mm"
    assert Number("T", "T", "", 1.0, unit="s", above=0.0).range == "more than 0 s"
    assert Number("T", "T", "", 1.0, unit="s", above=0.0, high=2.0).range == "more than 0 and at most 2 s"
    assert Number("n", "n", "", 1, low=1).range == "at least 1"


def test_optional_and_whole_numbers() -> None:
    assert Number("g", "Gain", "", None, optional=True).check(" ") is None
    with pytest.raises(InputError, match="whole number"):
        Number("n", "Runs", "", 1, whole=True).check("1.5")


@given(st.text(max_size=12))
def test_any_text_is_a_number_in_range_or_refused(text: str) -> None:
    try:
        assert 0.0 <= AMPLITUDE.check(text) <= 150.0
    except InputError as refusal:
        assert "Amplitude" in str(refusal)


def test_other_kinds_of_fields() -> None:
    with pytest.raises(InputError, match="one of sine, square"):
        KIND.check("saw")
    with pytest.raises(InputError, match="true or false"):
        Flag("f", "Compiled", "", False).check("yes")
    axes = Several("axes", "Axes", "", ["X"], options={"X": "X axis", "Y": "Y axis"})
    assert axes.check(["Y", "X"]) == ["X", "Y"]
    with pytest.raises(InputError, match="1 or more"):
        axes.check([])
    with pytest.raises(InputError, match="at most 3"):
        Text("t", "Title", "", "", longest=3).check("long")


def test_a_refused_value_leaves_the_old_one_and_tells_nobody() -> None:
    choices = Choices([AMPLITUDE, KIND])
    told: list[str] = []
    end = choices.watch(told.append)
    with pytest.raises(InputError):
        choices.set("amplitude", 1000.0)
    choices.set("amplitude", "7")
    choices.set("amplitude", 7.0)  # the same: no news
    end()
    choices.set("amplitude", 8.0)
    assert (choices["amplitude"], told) == (8.0, ["amplitude"])
    with pytest.raises(InputError, match="no choice 'speed'"):
        choices.set("speed", 1)


def test_a_replaced_field_keeps_a_value_that_will_do() -> None:
    choices = Choices([AMPLITUDE])
    choices.set("amplitude", 100.0)
    choices.replace([Number("amplitude", "Amplitude", "", 2.0, unit="V", low=0.0, high=10.0)])
    assert choices["amplitude"] == 2.0


def test_choices_are_kept_in_the_folder(tmp_path: Path) -> None:
    Session(tmp_path).choices("model", [AMPLITUDE, KIND]).set("amplitude", 3.0)
    again = Session(tmp_path).choices("model", [AMPLITUDE, KIND])
    assert again.values() == {"amplitude": 3.0, "kind": "sine"}


def test_what_was_kept_and_will_not_do_any_more_is_said(tmp_path: Path) -> None:
    (tmp_path / "session.json").write_text(json.dumps({"model": {"amplitude": 1e9, "colour": "red"}}))
    session = Session(tmp_path)
    assert session.choices("model", [AMPLITUDE])["amplitude"] == 5.0
    said = " ".join(message.text for message in session.messages)
    assert "Amplitude must be from 0 to 150 mm" in said and "colour" in said


@pytest.mark.parametrize("content", ["", "{", "[]", '{"model": 3}', '{"model": {"amplitude": "x"}}', "\0"])
def test_a_damaged_file_of_choices_breaks_nothing(tmp_path: Path, content: str) -> None:
    (tmp_path / "session.json").write_text(content)
    assert Session(tmp_path).choices("model", [AMPLITUDE])["amplitude"] == 5.0


@pytest.mark.parametrize("wrong", ["a\x00b", "a\rb", "a\ud800", "a\x1b[31m", "ä" * 200, "folder/" + "x" * 256])
def test_text_that_can_name_no_file_is_refused(wrong: str) -> None:
    with pytest.raises(InputError, match="File"):
        Text("f", "File", "", "").check(wrong)


def test_what_is_refused_is_quoted_only_in_part() -> None:
    for wrong in ("9" * 5000, "x" * 5000):
        with pytest.raises(InputError) as refusal:
            AMPLITUDE.check(wrong)
        assert len(str(refusal.value)) < 200


def test_choices_kept_by_somebody_hostile_are_refused_in_words() -> None:
    several = Several("s", "Several", "", [], {"a": "A"}, least=0)
    for wrong in ([[1]], [{}], "a", {"a": 1}, 5, None):
        with pytest.raises(InputError, match="Several must be some of"):
            several.check(wrong)
