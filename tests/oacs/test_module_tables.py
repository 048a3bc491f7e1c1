"""`[axis.NAME.module]` of a machine's file: what modules say of themselves, for every machine, and what is refused."""

from __future__ import annotations

from pathlib import Path

import pytest
from documents import blocks

from rds.bus.modules.oacs.codes import Kind
from rds.bus.modules.oacs.module import OacsModule
from rds.bus.modules.oacs.module_data import IDENTITY, ModuleData, read_modules
from rds.bus.modules.oacs.transfer import decode_description, encode_description
from rds.core.errors import InputError
from rds.machines import load_machine, machine_names

AXIS = """
sample_period = 0.001
[axis.1]
node = {node}
unit = "{unit}"
travel = [10.0, 90.0]
resolution = 0.25
[axis.1.model]
name = "linear-axis"
tau = 0.01
K = 2.0
friction_plus = 1.0
friction_minus = -3.0
"""


def read(tmp_path: Path, table: str = "", unit: str = "mm", node: int = 2) -> ModuleData:
    """The module of a machine with one axis and this module table."""
    path = tmp_path / "own.toml"
    text = AXIS.format(unit=unit, node=node) + (f"[axis.1.module]\n{table}\n" if table else "")
    path.write_text(text, encoding="utf-8")
    (data,) = read_modules(load_machine(str(path))).values()
    return data


@pytest.mark.parametrize("name", [name for name in machine_names() if name != "starmill"])
def test_every_machine_has_modules_whose_data_can_be_downloaded(name: str) -> None:
    machine = load_machine(name)
    for slot, (axis, data) in enumerate(zip(machine.axes.values(), read_modules(machine).values(), strict=True)):
        module = OacsModule(axis, data, slot, machine.sample_period, 0.0, serial=7)
        told = decode_description(encode_description(data.describe(7)))
        assert module.node == axis.node
        assert (told.lowest, told.highest) == pytest.approx(axis.travel)
        assert told.resolution == pytest.approx(axis.resolution, rel=1e-6)
        assert told.clockwise_speed > 0 and told.counterclockwise_speed > 0 and told.supply > 0


def test_steppers_are_no_modules_of_this_dialect() -> None:
    with pytest.raises(InputError, match=r"axis X has a stepper motor, .* on a serial line \(--dialect dcs\)"):
        read_modules(load_machine("starmill"))


def test_what_the_table_leaves_out_follows_from_the_axis(tmp_path: Path) -> None:
    data = read(tmp_path)
    assert (data.kind, data.letter, data.type_text, data.kind_text) == (Kind.TRANSLATIONAL, "X", "LinrXa", "ServM")
    assert (data.lowest, data.highest, data.initial, data.start) == (10.0, 90.0, 10.0, 10.0)
    assert (data.counts_per_unit, data.supply, data.matrix, data.switches) == (4.0, 10.0, IDENTITY, True)
    # (K u - friction) 60 s/min with 10 V of the converter
    assert (data.clockwise_speed, data.counterclockwise_speed) == (19.0 * 60, 17.0 * 60)
    assert read(tmp_path, unit="deg").kind == Kind.ROTARY
    tool = read(tmp_path, unit="rev/min")
    assert (tool.kind, tool.letter, tool.kind_text, tool.switches) == (Kind.TOOL, "T", "SpinM", False)


def test_what_the_table_says_is_what_the_module_says(tmp_path: Path) -> None:
    table = """
kind = "rotary"
letter = "B"
type_text = "RotrBx"
accuracy = 0.5
repeatability = 0.25
counts_per_unit = 4
least_speed = 1
clockwise_speed = 100
counterclockwise_speed = 120.0
supply = 24
initial = 20.0
matrix = [[0, -1, 0, 5], [1, 0, 0, 0], [0, 0, 1, -7.5], [0, 0, 0, 1]]
joint = "b"
"""
    told = decode_description(encode_description(read(tmp_path, table).describe(3)))
    assert (told.kind, told.axis, told.type_text, told.joint) == (Kind.ROTARY, "B", "RotrBx", "b")
    assert (told.accuracy, told.repeatability, told.least_speed) == (0.5, 0.25, 1.0)
    assert (told.clockwise_speed, told.counterclockwise_speed, told.supply) == (100.0, 120.0, 24.0)
    assert told.initial == 20.0 and told.matrix[0] == (0.0, -1.0, 0.0, 5.0) and told.matrix[2][3] == -7.5


@pytest.mark.parametrize(
    "table, complaint",
    [
        ("acuracy = 1.0", r"unknown key 'acuracy' in .axis.1.module.; known keys: accelerometer, accessory, accuracy"),
        ('kind = "linear"', r"kind = 'linear' is unknown; known: translational, rotary, tool"),
        ("letter = 5", r"letter = 5 must be a text in quotes"),
        ('letter = "XY"', r"axis = 'XY' must be a letter"),
        ("accuracy = -1.0", r"accuracy = -1.0 must be at least 0"),
        ("supply = true", r"supply = True must be a number"),
        ("supply = 0", r"supply = 0.0 must be more than 0"),
        ("initial = nan", r"initial = nan must be a finite number"),
        ("initial = 95.0", r"must be lowest <= initial <= highest"),
        ("counts_per_unit = 5.0", r"counts_per_unit = 5 contradicts the axis's resolution of 0.25 mm per count"),
        ("counts_per_turn = 10.5", r"counts_per_turn = 10.5 must be a whole number"),
        ('switches = "yes"', r"switches = 'yes' must be true or false"),
        ("matrix = [[1, 0], [0, 1]]", r"must be 4 rows of 4 numbers"),
        ("matrix = [[2,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]", r"rows 1 and 1 of the matrix are not those"),
        ("accelerometer = [1, 2, 2000]", r"three whole numbers from 0 to 1023"),
        ('type_text = "much too long text"', r"type_text = .* 1 to 12 printable"),
        ('kind_text = "Servos"', r"kind_text = 'Servos' must be 1 to 5"),
        ('joint = "u"', r"joint = 'u' must be one of x, y, z"),
    ],
)
def test_what_cannot_be_is_refused_with_file_and_table(tmp_path: Path, table: str, complaint: str) -> None:
    with pytest.raises(InputError, match=rf"own\.toml, (line 15|\[axis\.1\.module\]): .*{complaint}"):
        read(tmp_path, table)


def test_numbers_that_no_module_can_have_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"own\.toml, \[axis\.1.* module number 16 must be from 2 to 14"):
        read(tmp_path, node=16)


def test_a_table_must_be_a_table(tmp_path: Path) -> None:
    path = tmp_path / "own.toml"
    text = AXIS.format(unit="mm", node=2).replace("resolution = 0.25", 'resolution = 0.25\nmodule = "fine"')
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match="module = 'fine' must be a table"):
        load_machine(str(path))


def test_the_document_s_table_is_one(tmp_path: Path) -> None:
    (block,) = [b for b in blocks("docs/experiments.md") if "[axis.X.module]" in b.text]
    table = block.text.partition("[axis.X.module]\n")[2]
    assert read(tmp_path, table).supply == 24.0
