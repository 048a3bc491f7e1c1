"""Every picture has something in it, units on its axes, and needs neither pyplot nor a display."""

from __future__ import annotations

import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from io import BytesIO
from typing import Any

import numpy as np
import pytest
from made_results import make_result
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.image import imread
from matplotlib.text import Text

from rds.core import figure
from rds.core.errors import InputError
from rds.core.figure import CYCLE, Picture
from rds.panels.texts import exchanger, languages, texts, translate_picture
from rds.results import Result, compare, plots, plots_overlay, plots_timing

MODES = [make_result("simulation", "XY"), make_result("emulation", "XY"), make_result("implementation", "XY")]
PICTURES: dict[str, Any] = {
    "overview": lambda: MODES[2].plot("X"),
    "overview of all axes": lambda: MODES[2].plot(),
    "response": lambda: plots.response(MODES[2], "X"),
    "error": lambda: plots.error(MODES[2], "Y"),
    "voltage": lambda: plots.voltage(MODES[2]),
    "timing": lambda: plots_timing.timing(MODES[2]),
    "modes": lambda: plots_overlay.modes(MODES),
    "comparison": lambda: compare(MODES[0], MODES[2]).plot(),
}


def drawn(picture: Picture, tmp_path: Any) -> np.ndarray:
    (tmp_path / "picture.png").write_bytes(picture.png())
    return imread(tmp_path / "picture.png")


@pytest.mark.parametrize("name", PICTURES)
@pytest.mark.filterwarnings("error")
def test_a_picture_is_labelled_and_not_cut_off(name: str, tmp_path: Any) -> None:
    picture = PICTURES[name]()
    pixels = drawn(picture, tmp_path)[:, :, :3]
    assert pixels.shape[1] >= 1280
    assert pixels.min(axis=2).std() > 0.02, "nearly blank"
    for axes in picture.axes:
        assert axes.lines or axes.patches
        assert axes.get_ylabel() == "number of samples" or "[" in axes.get_ylabel(), "no unit"
        assert axes.get_xlabel() == "" or "[" in axes.get_xlabel()
        box = axes.get_position()
        assert box.width > 0.2 and box.height > 0.1, "squeezed"
        legend = axes.get_legend()
        if legend is not None:
            assert legend.get_window_extent().x1 <= picture.bbox.x1, "legend cut off"
            assert legend.get_window_extent().y1 <= picture.bbox.y1, "legend cut off"
    assert any("[" in axes.get_xlabel() for axes in picture.axes)


def test_a_picture_is_drawn_once_and_as_matplotlib_saves_it(result: Result, monkeypatch: pytest.MonkeyPatch) -> None:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis

    saved = BytesIO()
    with monkeypatch.context() as patch:
        patch.setattr(figure, "_ticks_kept", nullcontext)
        plots.response(result, "X").savefig(saved, format="png", metadata={"Software": None})
    draw, calls = Axes.draw, []
    place, placed = Axis._update_ticks, []  # type: ignore[attr-defined]
    monkeypatch.setattr(Axes, "draw", lambda self, renderer: calls.append(self) or draw(self, renderer))  # type: ignore[func-returns-value]
    monkeypatch.setattr(Axis, "_update_ticks", lambda self: placed.append(self) or place(self))  # type: ignore[func-returns-value]
    picture = plots.response(result, "X")
    assert picture.png() == saved.getvalue()
    assert calls == picture.axes
    assert len(placed) == 3 * 2 * len(calls), "the ticks of each axis for two rounds of the layout, and to draw"


def labels(picture: Picture) -> str:
    return " ".join(text for axes in picture.axes for text in axes.get_legend_handles_labels()[1])


def test_the_response_shows_all_four(result: Result) -> None:
    assert labels(plots.response(result)).split() == ["reference", "measured", "modelled", "simulated"]


def test_the_error_shows_means_and_late_samples(result: Result) -> None:
    said = labels(plots.error(result))
    assert "mean |error| 0.0283" in said
    assert "late: 3" in said


def test_rounding_is_not_drawn_as_an_error() -> None:
    """An error of 1e-17 filled the picture of a spindle that stood still."""
    still = make_result("simulation", "X")
    still.columns["X_measured"] = still.columns["X_reference"] + 1e-17
    still.columns["X_measured"][3] += 1e-12
    (axes,) = plots.error(still, "X").axes
    assert axes.get_ylim() == (-1e-3, 1e-3)


def test_the_voltage_shows_the_limits(result: Result) -> None:
    assert "limit ±10 V" in labels(plots.voltage(result))
    without = Result(result.columns, result.units, {k: v for k, v in result.meta.items() if k != "voltage_range"})
    assert "limit" not in labels(plots.voltage(without))


def test_the_legend_of_the_timing_lies_within_a_panel_s_figure() -> None:
    from rds.panels.kit.figure import DPI, WIDTH

    picture = plots_timing.timing(make_result("implementation", seconds=8.0))
    picture.set_size_inches(WIDTH, picture.get_size_inches()[1])
    picture.set_dpi(DPI)
    picture.draw_without_rendering()
    legend = picture.axes[0].get_legend()
    assert legend is not None and legend.get_window_extent().x1 <= WIDTH * DPI


def test_the_timing_marks_period_and_late_samples(result: Result) -> None:
    said = labels(plots_timing.timing(result))
    assert "period 1000 µs" in said
    assert "late: 3 of 10000 samples" in said
    assert "lateness (system)" in said and "I/O (bus)" in said and "compute (controller)" in said


def test_the_first_sample_is_never_late() -> None:
    columns = {"time": [0.0, 0.1, 0.2], "lateness": [5e5, 1e5, 1e5], "io": [0.0, 0.0, 1.0]}
    result = Result(columns, meta={"axes": ["X"], "sample_period": 0.1})
    from rds.results.late_samples import late_samples

    late = late_samples(result)
    assert late is not None and late.tolist() == [False, False, True]


def test_model_validation_shows_the_models_error() -> None:
    full = make_result("model-validation", seconds=1.0)
    columns = {k: v for k, v in full.columns.items() if "reference" not in k and "simulated" not in k}
    picture = Result(columns, meta=full.meta).plot("X")
    assert [axes.get_ylabel() for axes in picture.axes] == [
        "X position [mm]",
        "X measured − modelled [mm]",
        "X voltage [V]",
    ]


def test_a_spindle_is_drawn_in_its_unit() -> None:
    columns = {"time": [0.0, 0.1], "spindle_measured": [0.0, 900.0]}
    meta = {"axes": ["spindle"], "sample_period": 0.1}
    picture = Result(columns, {"spindle_measured": "rev/min"}, meta).plot()
    assert picture.axes[0].get_ylabel() == "spindle speed [rev/min]"


def test_a_few_samples_or_none_are_drawn_without_a_warning() -> None:
    import warnings

    for seconds in (0.0, 0.001, 0.002):
        result = make_result("implementation", seconds=seconds)
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            result.plot().png()
            plots_timing.timing(result).png()


def test_what_cannot_be_drawn_is_refused(result: Result) -> None:
    with pytest.raises(InputError, match="no axis 'Q'; it has X"):
        result.plot("Q")
    with pytest.raises(InputError, match=r"simulation.*has no timing"):
        plots_timing.timing(make_result("simulation", seconds=0.1))
    with pytest.raises(InputError, match="at least one"):
        plots_overlay.modes([])
    with pytest.raises(InputError, match="nothing to draw of X"):
        Result({"time": [0.0]}, meta={"axes": ["X"], "sample_period": 1}).plot()


def test_a_name_with_dollars_is_no_formula_and_numbers_at_ticks_are() -> None:
    picture = plots_overlay.modes(MODES[:2], ["a $\\bad{$ name", "$_"])
    picture.axes[0].set_yscale("log")
    picture.png()
    assert [text.get_parse_math() for text in picture.legends[0].get_texts()].count(False) >= 2
    assert all(label.get_parse_math() for label in picture.axes[0].get_yticklabels())


def test_the_names_of_many_runs_have_room_above_them() -> None:
    picture = plots_overlay.modes([MODES[0]] * 6, [f"04:36:1{i} X implementation" for i in range(6)])
    picture.set_figwidth(7.6)  # beside the settings of a panel
    picture.draw_without_rendering()
    drawn = [picture.legends[0], picture.axes[1].get_legend()]
    assert all(box.x0 >= 0.0 and box.x1 <= picture.bbox.width for box in (each.get_window_extent() for each in drawn))


def test_pictures_are_drawn_in_any_thread_and_show_themselves(result: Result) -> None:
    with ThreadPoolExecutor(2) as pool:
        pictures = list(pool.map(lambda _: result.plot()._repr_png_(), range(2)))
    assert len(set(pictures)) == 1
    assert pictures[0].startswith(b"\x89PNG")


def test_a_picture_is_drawn_within_its_own_drawing(result: Result) -> None:
    """As matplotlib's selectors do, which draw anew for a background without themselves."""
    picture = result.plot()
    canvas, drawn = FigureCanvasAgg(picture), list[bool]()

    def again(_: Any) -> None:
        drawn.append(True)
        if len(drawn) == 1:
            canvas.draw()

    canvas.mpl_connect("draw_event", again)
    canvas.draw()
    assert len(drawn) == 2 and "_update_ticks" not in vars(picture.axes[0].xaxis)


def test_no_pyplot() -> None:
    modules = "plots, plots_timing, plots_overlay"
    program = f"import sys; from rds.results import {modules}; sys.exit('matplotlib.pyplot' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", program], check=False).returncode == 0


def test_the_colours_are_distinct_when_grey() -> None:
    from matplotlib.colors import to_rgb

    greys = sorted(float(np.dot(to_rgb(colour), [0.299, 0.587, 0.114])) for colour in CYCLE[:3])
    assert np.diff(greys).min() > 0.01


@pytest.mark.parametrize("name", PICTURES)
def test_all_that_a_picture_says_has_a_text_in_the_languages_of_the_page(name: str) -> None:
    drawn = PICTURES[name]()
    said = {each.get_text() for each in drawn.findobj(Text) if re.search(r"[^\W\d_]{2}", each.get_text())}
    said -= {"simulation", "emulation", "implementation"}  # names of the runs
    for code in languages():
        missing = [text for text in said if exchanger(code)(text) is None]
        assert said and not missing
        translate_picture(drawn, code)
        left = {each.get_text() for each in drawn.findobj(Text)}
        assert not said & left - set(texts(code).values())
        drawn.set_figwidth(0.6 * drawn.get_figwidth())  # on a smaller page, where legends are made anew
        left = {each.get_text() for each in drawn.findobj(Text)}
        assert not said & left - set(texts(code).values())
