"""Runs as rows: what was changed since the run before, what came of it, notes and stars; what differs between two."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rds.core.colours import QUANTITIES
from rds.panels.equipment.live_view import ghost_rows
from rds.panels.equipment.run import EquipmentRun
from rds.panels.equipment.strip import StripChart, dressed
from rds.panels.session import Session
from rds.panels.session.kept_runs import KeptRun, State
from rds.panels.session.run_table import NOTES, RunRow, RunTable, differences
from rds.panels.session.session import RUNS
from rds.results import open_result

CODE = (
    "params = {'Kp': 20.0}\ndef control(t, r, y, state, params):\n    return params['Kp'] * (r.position - y), state\n"
)


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[KeptRun]]:
    """Four short simulations; the latest first."""
    session = Session(tmp_path_factory.mktemp("student"))
    file, made = session.folder / "mine.py", []

    def run(amplitude: float, controller: dict[str, Any]) -> None:
        reference = {"kind": "sinusoid", "amplitude": amplitude, "frequency": 1.0}
        words = {"axis": "X", "mode": "simulation", "duration": 0.3, "reference": reference, "controller": controller}
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("rds.panels.equipment.run.made_beside", lambda *_: {})  # no test looks at their pictures
            begun = EquipmentRun(session, {"machine": "mini-cnc", "sample_period": 0.001, **words}).start()
            assert begun.wait(60) and begun.error is None
        made.append(KeptRun(begun.folder, State.WHOLE, float(len(made))))

    run(5.0, {"name": "p", "Pgain": 10.0})
    run(4.0, {"name": "p", "Pgain": 20.0})
    file.write_text(CODE)
    run(4.0, {"file": "mine.py"})
    file.write_text(CODE.replace("return", "# stiffer\n    return"))
    run(4.0, {"file": "mine.py", "params": {"Kp": 30.0}})
    return session.folder / RUNS, made[::-1]


def test_a_row_says_what_was_changed_since_the_run_before(runs: tuple[Path, list[KeptRun]]) -> None:
    folder, kept = runs
    fourth, third, second, first = RunTable(folder).rows(kept)
    assert (first.mode, first.controller, first.axes, first.changed) == ("simulation", "p", ("X",), "")
    assert second.changed == "Pgain 10 → 20; reference amplitude 5 → 4"
    assert third.controller == "mine.py" and third.changed.startswith("controller p → mine.py")
    assert fourth.changed == "code of the controller +1 −0 lines; Kp 20 → 30"
    assert first.rms == f"{open_result(kept[3].folder).metrics['X']['rms_error']:.3g} mm" and first.verdict == ""
    shown = first.to_json()
    assert shown["axes"] == "X" and "facts" not in shown


def test_what_differs_between_two(runs: tuple[Path, list[KeptRun]]) -> None:
    rows = RunTable(runs[0]).rows(runs[1])
    assert differences(rows[3].facts, rows[2].facts) == [("Pgain", "10", "20"), ("reference amplitude", "5", "4")]
    assert differences(rows[0].facts, rows[0].facts) == []
    assert ("code of the controller", "", "+1 −0 lines") in differences(rows[1].facts, rows[0].facts)


def test_parameters_of_one_name_are_told_apart(tmp_path: Path) -> None:
    def row(K: float) -> RunRow:
        own = {"source": "s", "params": {"K": K, "mode": K, "code": K}}
        model = {"name": "linear-axis", "params": {"K": 1.7}}
        meta = {"mode": "emulation", "axes": ["X"], "controller": {"X": own}, "model": {"X": model}}
        folder = tmp_path / f"{K:g}"
        folder.mkdir()
        (folder / "result.json").write_text(json.dumps({"meta": meta}))
        return RunTable(tmp_path).rows([KeptRun(folder, State.WHOLE, K)])[0]

    first, second = row(5.0), row(6.0)
    assert first.mode == "emulation" and first.facts["K of the model"] == 1.7
    wanted = [("K", "5", "6"), ("mode of the controller", "5", "6"), ("code", "5", "6")]
    assert differences(first.facts, second.facts) == wanted


def test_notes_and_stars_are_kept_beside_the_runs(runs: tuple[Path, list[KeptRun]]) -> None:
    folder, kept = runs
    table = RunTable(folder)
    table.set_note(kept[0].name, "  the  best\nso far ")
    table.set_star(kept[0].name, True)
    row = RunTable(folder).rows(kept)[0]
    assert (row.note, row.star) == ("the best so far", True)
    table.set_note(kept[0].name, "")
    table.set_star(kept[0].name, False)
    assert (folder / NOTES).read_text() == "{}"
    (folder / NOTES).write_text("[1, 2]")  # damaged: nothing is noted
    assert table.rows(kept)[0].note == ""


def test_a_run_that_left_no_description_is_a_row_all_the_same(tmp_path: Path) -> None:
    (tmp_path / "20260101-120000-X-emulation-ab12").mkdir()
    (row,) = RunTable(tmp_path).rows([KeptRun(tmp_path / "20260101-120000-X-emulation-ab12", State.CUT_SHORT, 1.0)])
    assert row.to_json()["state"] == "cut short" and row.rms == row.changed == ""


def test_each_quantity_has_its_lane_and_colour_and_each_axis_its_dashes() -> None:
    alone = dressed([("X_reference", "mm"), ("X_measured", "mm"), ("X_voltage", "V"), ("X_error", "mm")])
    assert [each["lane"] for each in alone] == ["position", "position", "voltage", "error"]
    assert [each["color"] for each in alone] == [QUANTITIES[k] for k in ("reference", "measured", "voltage", "error")]
    assert len({QUANTITIES[k] for k in ("reference", "measured", "modelled", "simulated", "voltage", "error")}) == 6
    both = dressed(
        [("X_measured", "mm"), ("Y_measured", "mm"), ("spindle_measured", "rev/min"), ("contour_error", "mm")]
    )
    assert both[0]["color"] == both[1]["color"] and both[0]["dash"] != both[1]["dash"]
    assert len({each["scale"] for each in both}) == 3  # mm, rev/min, and the contour error


def test_an_earlier_run_stands_behind_with_what_it_has(runs: tuple[Path, list[KeptRun]]) -> None:
    result = open_result(runs[1][0].folder)
    rows = ghost_rows(result, [("X_measured", "mm"), ("X_error", "mm"), ("Y_measured", "mm"), ("X_voltage", "mm")])
    assert rows.shape == (len(result), 5)
    assert np.array_equal(rows[:, 2], result["X_reference"] - result["X_measured"])
    assert np.isnan(rows[:, 3:]).all()  # another axis, another unit
    strip, sent = StripChart(), []
    strip.send = lambda content, buffers=None: sent.append((content, buffers))
    strip.stand_behind(rows, "before")
    assert strip.ghost == "before" and sent[-1][0] == {"kind": "ghost", "width": 5}
    strip.stand_behind(np.empty((0, 1)), "")
    assert strip.ghost == ""


def test_a_page_that_was_being_loaded_is_told_what_changed_meanwhile() -> None:
    """Jupyter loses what changes between the page's question for all widgets and the moment when it has made them."""
    strip, told = StripChart(), []
    strip.begin([("X_measured", "mm"), ("X_voltage", "V")])
    strip.send_state = lambda key=None: told.extend(key)
    strip._handle_custom_msg({"kind": "all"}, [])
    assert {"traces", "events", "ghost"} <= set(told)
