"""The runs that lie in a folder: those with results, those that go on, and those that were cut short."""

from __future__ import annotations

import contextlib
import json
import os
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rds.core.errors import InputError
from rds.modes.loop.live_values_of_run import live_values_of
from rds.modes.process.record import ENDING, NAME, PROCESSES
from rds.panels.session.saving import is_being_saved

if TYPE_CHECKING:
    from rds.results import Result


class State(StrEnum):
    """What has become of a run."""

    WHOLE = "whole"  # its results are saved
    GOES_ON = "goes on"  # its loop is running now, whoever started it
    SAVED_NOW = "is being saved"  # its loop is over, its results are not there yet
    CUT_SHORT = "cut short"  # its host ended before it could save results: the record can be opened


@dataclass(frozen=True)
class KeptRun:
    """One folder with a run in it."""

    folder: Path
    state: State
    when: float  # s since 1970, when its latest file came

    @property
    def name(self) -> str:
        """What the folder is called."""
        return self.folder.name

    def open(self) -> Result:
        """Its result; of a run that was cut short, what was recorded. InputError if it cannot be read."""
        from rds.results import open_result

        return open_result(self.folder)

    @property
    def channel(self) -> str | None:
        """Of the built-in bus, where a run that goes on may have a machine of its own; None for any other run."""
        try:
            channel = json.loads((self.folder / PROCESSES).read_text())["channel"]
        except (OSError, ValueError, KeyError, TypeError):
            return None
        return channel if isinstance(channel, str) else None

    def stop(self) -> None:
        """Ask a run that goes on for a safe end; one that is over stays as it is."""
        with contextlib.suppress(InputError), live_values_of(self.folder) as live_values:
            live_values.set("stop", 1.0)


def kept_runs(folder: Path, most: int | None = None) -> list[KeptRun]:
    """The runs in the folders of `folder`, the latest first, at most `most`: no more folders are looked into."""
    found: list[KeptRun] = []
    for when, each in sorted(_folders(folder), reverse=True):
        if len(found) == most:
            break
        state = state_of(each)
        if state is not None:
            found.append(KeptRun(each, state, when))
    return found


def runs_that_go_on(folder: Path) -> list[KeptRun]:
    """Those whose loops are running now, wherever they stand among the others."""
    return [KeptRun(each, State.GOES_ON, when) for when, each in _folders(folder) if _goes_on(each)]


def state_of(folder: Path) -> State | None:
    """What lies in one folder; None: no run."""
    if _goes_on(folder):
        return State.GOES_ON
    if any((folder / f"result.{kind}").is_file() for kind in ("csv", "parquet", "mat")):
        return State.WHOLE
    if not (folder / NAME).is_file():
        return None
    return State.SAVED_NOW if is_being_saved(folder) else State.CUT_SHORT


def ending(folder: Path) -> dict[str, Any]:
    """How a run ended, as far as it could still say."""
    try:
        said = json.loads((folder / ENDING).read_text())
    except (OSError, ValueError):
        return {}
    return said if isinstance(said, dict) else {}


def _goes_on(folder: Path) -> bool:
    if not (folder / PROCESSES).is_file():
        return False
    try:
        with live_values_of(folder):
            return True
    except InputError:
        return False


def _folders(folder: Path) -> list[tuple[float, Path]]:
    """The folders in `folder`, each after the time at which its latest file came, s since 1970."""
    found = []
    with contextlib.suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            with contextlib.suppress(OSError):  # it has just gone
                if entry.is_dir(follow_symlinks=False):
                    found.append((entry.stat().st_mtime, Path(entry.path)))
    return found
