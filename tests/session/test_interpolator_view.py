"""The interpolator panel without a browser: the machine along the samples, the block diagram, samples by e-mail."""

from __future__ import annotations

import email
import re
from collections.abc import Iterator
from email.policy import default
from pathlib import Path
from typing import Any

import ipywidgets as widgets
import numpy as np
import pytest

from rds.core.errors import InputError
from rds.interpolators.result import Interpolation
from rds.panels.interpolator.panel import InterpolatorView
from rds.panels.interpolator.state import Interpolating
from rds.panels.page.shell import Shell
from rds.panels.scene.scene import MachineScene
from rds.panels.session import Session
from rds.panels.texts import exchanger
from tests.session.test_email import Box, box

__all__ = ["box"]  # a fixture


def within(widget: Any) -> Iterator[Any]:
    yield widget
    for child in getattr(widget, "children", ()) or ():
        yield from within(child)


def opened(folder: Path, machine: str = "mini-cnc", **choices: object) -> InterpolatorView:
    shell = Shell(Session(folder, machine))
    view = InterpolatorView(shell, Interpolating(shell.session))
    for name, value in choices.items():
        view.work.choices.set(name, value)
    return view


def press(view: InterpolatorView, text: str) -> None:
    found = [each for each in within(view.widget) if getattr(each, "description", "") == text]
    (button,) = [each for each in found if isinstance(each, widgets.Button | widgets.ToggleButton)]
    if isinstance(button, widgets.ToggleButton):
        button.value = not button.value
    else:
        button.click()
    while view.bar.busy:
        view.shell.ticker.tick()


def svg(view: InterpolatorView) -> str:
    return "".join(v for each in within(view.widget) if "<svg" in (v := str(getattr(each, "value", ""))))


def test_the_machine_goes_along_the_samples(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An arc of a quarter, 10 mm at 10 mm/s: 100 pictures a second at most, from its start to its end."""
    view = opened(tmp_path, arc_method="improved-tustin")
    (scene,) = [each for each in within(view.widget) if isinstance(each, MachineScene)]
    sent: list[tuple[Any, Any]] = []
    monkeypatch.setattr(scene, "send", lambda content, buffers=None: sent.append((content, buffers)))
    scene.shows = True
    press(view, "Interpolate")
    assert scene.columns == ["X_reference", "Y_reference", "contour_error"] and not scene.live
    ((content, buffers),) = [each for each in sent if each[0]["kind"] == "rows"]
    rows = np.frombuffer(buffers[0]).reshape(-1, content["width"])
    assert rows[0] == pytest.approx([0.0, 10.0, 0.0, 0.0], abs=1e-9)
    assert view.done is not None
    assert rows[-1, :3] == pytest.approx([view.done.duration, 0.0, 10.0], abs=1e-9)
    assert 100 < len(rows) <= 158 and np.diff(rows[:, 0]).min() >= 0.01 - 1e-9  # of 1.58 s
    assert 0.009 < rows[:, 3].max() <= view.done.path_error.max()  # mm: what the method leaves of a BLU of 0.01


def test_without_a_machine_the_samples_are_made_all_the_same(tmp_path: Path) -> None:
    (tmp_path / "own.toml").write_text("name = 'broken\n")
    view = opened(tmp_path, str(tmp_path / "own.toml"))
    assert not [each for each in within(view.widget) if isinstance(each, MachineScene)]
    press(view, "Interpolate")
    assert "done: " in view.notice.value


def test_the_block_diagram_has_what_takes_lines_and_arcs(tmp_path: Path) -> None:
    """The paper's figure 7: an executive hands segments to the linear and to the circular interpolator."""
    view = opened(tmp_path, kind="both", given="several", arc_method="tustin", acceleration="s-shape")
    assert not svg(view)
    press(view, "View model")
    for said in (
        "Executive (hands out",
        "Linear (interpolator, constant-velocity",
        "Circular (interpolator, tustin",
        "2 segments",
        "s-shape",
    ):
        assert said in svg(view)
    names = {"600 mm/min", "constant-velocity", "blu 0.01", "tustin", "s-shape"}
    for text in set(re.findall(r">([^<>]*[^\W\d_]{3}[^<>]*)<", svg(view))) - names:
        assert exchanger("de")(text) is not None, text
    view.work.choices.set("kind", "circular")
    assert "Circular" in svg(view) and "Linear" not in svg(view)
    view.work.choices.set("arc_method", "user")
    assert not svg(view) and "name the file of your interpolator for arcs" in view.model.value
    view.work.choices.set("arc_file", "mine.py")
    assert "mine.py" in svg(view)
    press(view, "View model")
    assert not svg(view)


def ready(view: InterpolatorView) -> Interpolation:
    press(view, "Interpolate")
    assert view.done is not None
    return view.done


def test_the_samples_go_by_e_mail_as_they_are_saved(box: tuple[Box, Any], tmp_path: Path) -> None:
    handler, server = box
    view = opened(tmp_path, send_to="me@example.edu", file="arc.csv")
    done = ready(view)
    with pytest.raises(InputError, match="no mail server is set up"):
        view.work.send(done)
    assert not (tmp_path / "arc.csv").exists()
    (tmp_path / "email.toml").write_text(
        f'host = "{server.host}"\nport = {server.port}\nsender = "lab@example.edu"\nsecurity = "none"\n'
    )
    press(view, "Send")
    assert "sent to me@example.edu: arc.csv" in view.notice.value
    press(view, "Send")  # the same samples again: the file that is there is theirs
    assert len(handler.mails) == 2
    message = email.message_from_bytes(handler.mails[1].content, policy=default)
    (part,) = message.iter_attachments()
    assert part.get_filename() == "arc.csv"
    data = part.get_payload(decode=True)
    assert isinstance(data, bytes)
    text = data.decode().replace("\r\n", "\n")
    assert text == (tmp_path / "arc.csv").read_text() and "X_reference_acceleration" in text
    view.work.choices.set("feed", 300.0)
    ready(view)
    press(view, "Send")
    assert "there is such a file already; choose another name" in view.notice.value and len(handler.mails) == 2


def test_whom_to_send_it_to_must_be_said(tmp_path: Path) -> None:
    view = opened(tmp_path)
    ready(view)
    press(view, "Send")
    assert "say whom to send it to" in view.notice.value and not (tmp_path / "interpolation.csv").exists()
    with pytest.raises(InputError, match="no e-mail address"):
        view.work.choices.set("send_to", "me")


def test_a_table_of_segments_shows_what_it_was_given(tmp_path: Path) -> None:
    rows = [{"kind": "line", "end": [123.45678, 0.0], "feed": 123.45678}]
    view = opened(tmp_path, kind="linear", given="several", rows=rows)
    view.segments.add("line")
    assert view.work.choices["rows"][0] == rows[0]
