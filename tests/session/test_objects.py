"""Objects in a session: each form makes the program that `rds nc make` makes, says faults, and keeps other files."""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner
from waiting import wait_for

from rds.cli.main import app
from rds.core.errors import InputError
from rds.nc.paths.objects import OBJECTS
from rds.panels.objects.forms import FORMS, fields
from rds.panels.objects.state import OF_ALL, Objects
from rds.panels.program.state import program_choices
from rds.panels.session import Session

OPTIONS: dict[str, list[str]] = {
    "line": ["line", "--start", "0,0", "--end", "40,30,-2"],
    "quad": ["quad", *(word for each in ("0,0", "40,5", "35,30", "0,25") for word in ("--corner", each))],
    "sides": [
        *("quad", "--start", "0,0"),
        *(word for each in ("0,40,-1", "90,20,-1", "180,40,1") for word in ("--move", each)),
    ],
    "arc": ["arc", "--centre", "20,20", "--radius", "15", "--start-angle", "0", "--sweep", "360", "--depth", "1"],
    "cone": [
        *("cone", "--centre", "20,20", "--radius", "20", "--height", "5", "--step-height", "1", "--step-width", "3"),
    ],
    "points": ["points", "points.csv"],
}
OTHERS: dict[str, tuple[dict[str, Any], list[str]]] = {  # values that are not the first ones
    "line": ({"line_start": "-1.5, 2,-3", "safe": None, "spindle": None}, ["line", "--start", "-1.5, 2,-3"]),
    "arc": ({"arc_end_depth": 3.0, "arc_sweep": -720.0}, ["--end-depth", "3", "--sweep", "-720"]),
    "cone": ({"cone_tolerance": 0.01, "blend": 0.02, "decimals": 3}, ["--tolerance", "0.01"]),
    "points": (
        {"points_depth": 1.0, "points_close": True, "points_tolerance": 0.01, "feed": 60.0},
        ["--depth", "1", "--close", "--tolerance", "0.01"],
    ),
}


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "points.csv").write_text("x [mm], y [mm]\n0,0\n10,0\n10,10\n")
    return tmp_path


def settled(objects: Objects) -> Objects:
    def is_made() -> bool:
        if objects.going_on:
            objects.tick()
        return not objects.going_on

    wait_for(is_made)
    return objects


def filled(folder: Path, form: str, **values: Any) -> Objects:
    made = Objects(Session(folder))
    made.choices.set("object", form)
    if form == "points":
        values = {"points_file": "points.csv"} | values
    for name, value in values.items():
        made.choices.set(name, value)
    return settled(made)


def by_command(
    folder: Path, *words: str, safe: str | None = "5", spindle: str | None = "3000", feed: str = "300"
) -> str:
    out = folder / "by_command.ngc"
    more = [*(["--safe", safe] if safe else []), *(["--spindle", spindle] if spindle else []), "-f", feed]
    done = CliRunner().invoke(app, ["nc", "make", *words, *more, "-o", str(out)])
    assert done.exit_code == 0, done.output
    return out.read_text()


@pytest.mark.parametrize("form", FORMS)
def test_each_form_makes_the_program_of_the_command_and_opens_it(folder: Path, form: str) -> None:
    from rds.machines import load_machine
    from rds.nc.check import check_program
    from rds.nc.setup import Setup

    made = filled(folder, form)
    name, replaced = made.write()
    assert (name, replaced) == (f"{form}.ngc", False)
    assert (folder / name).read_text() == by_command(folder, *OPTIONS[form])
    assert program_choices(made.session)["file"] == name
    assert check_program(folder / name, load_machine("mini-cnc"), Setup())[0].ok
    assert made.latest is not None and " mm, " in made.latest.sentence


@pytest.mark.parametrize("form", OTHERS)
def test_other_values_make_the_program_of_the_command_too(folder: Path, form: str) -> None:
    values, words = OTHERS[form]
    made = filled(folder, form, **values)
    made.write()
    if form == "line":
        expected = by_command(folder, *words, "--end", "40,30,-2", safe=None, spindle=None)
    else:
        more = ["--blend", "0.02", "--decimals", "3"] if "blend" in values else []
        expected = by_command(folder, *OPTIONS[form], *words, *more, feed=f"{values.get('feed', 300):g}")
    assert (folder / f"{form}.ngc").read_text() == expected


def test_every_option_of_the_objects_has_a_field(folder: Path) -> None:
    """So a new option of `rds nc make` comes into the page by itself; those of the program are shared."""
    names = {each.name for each in fields(folder)}
    for kind, make in OBJECTS.items():
        forms = [name for name, form in FORMS.items() if form.kind == kind]
        for option in inspect.signature(make).parameters:
            wanted = [option] if option in OF_ALL else [f"{form}_{option}" for form in forms]
            assert any(name == each or name.startswith(f"{each}_") for name in names for each in wanted), option


@pytest.mark.parametrize(
    "form, values, said, field",
    [
        ("line", {"line_end": "0,0"}, "start and end are the same point", "line_start"),
        ("arc", {"arc_sweep": 0.0}, "sweep = 0.0 is no arc", "arc_sweep"),
        ("arc", {"arc_radius": 2e6}, "radius = 2000000.0 must be at most", "arc_radius"),
        ("cone", {"cone_step_width": 9.0}, "go past the centre of a radius of 20 mm", ""),
        ("cone", {"cone_step_angle": 2.0, "cone_tolerance": 0.1}, "step angle and tolerance both", "cone_step_angle"),
        ("sides", {"sides_move_2": "90,0"}, "length of move 2 = 0.0 must be more than 0", "sides_move_2"),
        ("arc", {"safe": -5.0}, "safe height = -5 mm is not above the path", "safe"),
        ("points", {"points_file": ""}, "choose a file of points of your folder", ""),
        ("points", {"points_unit": "in"}, "points.csv:1: unit 'mm', where 'in' is given already", "points_unit"),
    ],
)
def test_faults_are_said_as_the_command_says_them_at_their_field(
    folder: Path, form: str, values: dict[str, Any], said: str, field: str
) -> None:
    made = filled(folder, form, **values)
    assert said in made.refusal and str(folder) not in made.refusal
    assert made.wrong == field
    with pytest.raises(InputError) as refused:
        made.write()
    assert str(refused.value) == made.refusal
    assert not list(folder.glob("*.ngc"))


@pytest.mark.parametrize(
    "name, value, said",
    [
        ("line_start", "0;0", "start '0;0' is not numbers with commas between them, as in 10,-2.5"),
        ("line_start", "", "start '' is not numbers"),
        ("line_start", "1", "has 1 of x,y,z .mm.; give 2 or 3 numbers"),
        ("arc_centre", "1,2,3", "has 3 of x,y"),
        ("arc_radius", "0", "Radius must be more than 0 mm, not 0"),
        ("cone_step_width", "-1", "Step width must be at least 0 mm, not -1"),
        ("feed", "inf", "Feed must be"),
        ("program", "line.csv", "a part program's name ends with"),
    ],
)
def test_a_value_that_can_never_do_is_refused_as_it_is_typed(folder: Path, name: str, value: str, said: str) -> None:
    made = Objects(Session(folder))
    with pytest.raises(InputError, match=said):
        made.choices.set(name, value)


def test_a_free_name_is_offered_and_no_other_file_is_written_over(folder: Path) -> None:
    (folder / "arc.ngc").write_text("M2\n")
    (folder / ".arc-2.ngc.draft").write_text("M2\n")
    made = filled(folder, "arc")
    assert made.choices["program"] == "arc-3.ngc"
    made.choices.set("program", "arc.ngc")
    with pytest.raises(InputError, match="choose another name"):
        made.write()
    assert (folder / "arc.ngc").read_text() == "M2\n"
    made.choices.set("program", "mine.ngc")
    made.choices.set("object", "line")
    assert made.choices["program"] == "mine.ngc"  # the user's own name stays
    settled(made)
    assert made.write() == ("mine.ngc", False)
    made.choices.set("feed", 120.0)
    assert settled(made).write() == ("mine.ngc", True)
    (folder / "mine.ngc").write_text("M2\n")  # changed by the user since
    with pytest.raises(InputError, match="choose another name"):
        made.write()


def test_a_file_of_points_that_comes_later_can_be_chosen(folder: Path) -> None:
    made = filled(folder, "points")
    (folder / "later.csv").write_text("x_in,y_in\n0,0\n1,0\n")
    made.refresh()
    made.choices.set("points_file", "later.csv")
    found = settled(made).latest
    assert found is not None and found.summary["length_mm"] == pytest.approx(25.4)


def test_a_file_of_points_that_was_written_anew_is_read_anew(folder: Path) -> None:
    made = filled(folder, "points")
    (folder / "points.csv").write_text("x [mm], y [mm]\n0,0\n33,0\n")
    with pytest.raises(InputError, match="not made yet; wait a moment"):
        made.write()
    settled(made).write()
    assert "X33" in (folder / "points.ngc").read_text()
