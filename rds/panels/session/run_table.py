"""The runs of a folder as rows to compare: what was chosen and changed, what came of it, a note and a star of the user.

A row is read from what a run leaves beside its table (`result.json`, and `choices.json` of one that a panel began), and
not from the table itself. Notes and stars are in `notes.json`, in the folder of the runs.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any

from rds.core.atomic import write_whole
from rds.modes.loop.changes import STOP
from rds.panels.code.versions import change_sentence
from rds.panels.session.kept_runs import KeptRun, State

NOTES = "notes.json"
CHOICES = "choices.json"  # of a run that a panel began: the words of its experiment
LONGEST = 200  # characters of a note
_MOST_CHANGES = 3  # that a row names
_CODE = "code of the "  # what the names of facts that are a source begin with
_PARTS = ("mode", "controller", "model")  # facts that a parameter of the same name is not to be taken for
# of the experiment's words: what the result itself tells, and what no run is compared by
_LEFT_OUT = ("machine", "bus", "controller", "model", "mode", "axis", "axes", "duration", "sample_period")


@dataclass(frozen=True)
class RunRow:
    """One run. `facts` are what was chosen, by name, for `differences`; `changed` says what is not as before."""

    name: str
    when: float  # s since 1970
    state: State
    mode: str = ""
    axes: tuple[str, ...] = ()
    controller: str = ""
    changed: str = ""
    rms: str = ""
    fit: str = ""
    verdict: str = ""
    note: str = ""
    star: bool = False
    facts: Mapping[str, Any] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """What a page needs of it."""
        words = {key: getattr(self, key) for key in _SHOWN}
        axes = ", ".join(self.axes) or self.name
        return words | {
            "when": begun(self.name) or self.when,
            "state": str(self.state),
            "star": self.star,
            "axes": axes,
        }


def begun(name: str) -> float | None:
    """When the run began, s since 1970, by the name of its folder; None where that does not say it."""
    try:
        return datetime.strptime(name[:15], "%Y%m%d-%H%M%S").timestamp()
    except ValueError:
        return None


_SHOWN = ("name", "mode", "controller", "changed", "rms", "fit", "verdict", "note")


class RunTable:
    """The rows of a folder of runs; one that has not changed is not read again."""

    def __init__(self, folder: Path):
        self.folder = folder
        self._read: dict[str, tuple[float, dict[str, Any]]] = {}

    def rows(self, runs: Iterable[KeptRun]) -> list[RunRow]:
        """A row for each of `runs`, in their order, which is the latest first."""
        notes, found, runs = self._notes(), [], list(runs)
        here = {run.name for run in runs}
        self._read = {name: read for name, read in self._read.items() if name in here}
        before: dict[tuple[str, ...], Mapping[str, Any]] = {}  # the facts of the run before, on the same axes
        for run in reversed(runs):
            head = self._head(run)
            own = notes.get(run.name, {})
            facts = _facts(head)
            axes = tuple(map(str, head.get("meta", {}).get("axes", [])))
            changed = differences(before[axes], facts) if facts and axes in before else []
            if facts:
                before[axes] = facts
            found.append(
                RunRow(
                    name=run.name,
                    when=run.when,
                    state=run.state,
                    mode=str(facts.get("mode", "")),
                    axes=axes,
                    controller=_together(facts, "controller"),
                    changed=_sentence(changed),
                    rms=_metric(head, "rms_error"),
                    fit=_metric(head, "fit_percent"),
                    verdict=_verdict(head),
                    note=str(own.get("note", "")),
                    star=bool(own.get("star", False)),
                    facts=facts,
                )
            )
        return found[::-1]

    def set_note(self, name: str, note: str) -> None:
        """Keep the user's words on a run; InputError where the folder cannot be written to."""
        self._set(name, "note", " ".join(note.split())[:LONGEST])

    def set_star(self, name: str, on: bool) -> None:
        """Keep whether a run is marked; InputError where the folder cannot be written to."""
        self._set(name, "star", on)

    def _set(self, name: str, key: str, value: Any) -> None:
        notes = self._notes()
        own = notes.get(name, {}) | {key: value}
        notes = {each: kept for each, kept in (notes | {name: own}).items() if any(kept.values())}
        write_whole(self.folder / NOTES, json.dumps(notes, indent=1, ensure_ascii=False).encode())

    def _notes(self) -> dict[str, dict[str, Any]]:
        said = _json(self.folder / NOTES)
        return {name: own for name, own in said.items() if isinstance(own, dict)}

    def _head(self, run: KeptRun) -> dict[str, Any]:
        """What `result.json` says, with the experiment's words under "choices"."""
        path = run.folder / "result.json"
        try:
            stamp = path.stat().st_mtime
        except OSError:
            return {}
        kept = self._read.get(run.name)
        if kept is None or kept[0] != stamp:
            head = _json(path)
            units = _units(head.pop("columns", None))
            kept = self._read[run.name] = stamp, head | {"units": units, "choices": _json(run.folder / CHOICES)}
        return kept[1]


def _units(columns: Any) -> dict[str, str]:
    """The unit of each axis that was measured, by name."""
    found = {}
    for each in columns if isinstance(columns, list) else []:
        if isinstance(each, Mapping) and str(each.get("name")).endswith("_measured"):
            found[str(each["name"]).removesuffix("_measured")] = str(each.get("unit", ""))
    return found


def keep_choices(folder: Path, table: Mapping[str, Any]) -> None:
    """Keep the words of the experiment that ran into `folder`; one that cannot be written to keeps none."""
    with contextlib.suppress(Exception):
        write_whole(folder / CHOICES, json.dumps(dict(table), default=str).encode())


def differences(a: Mapping[str, Any], b: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    """What is not the same in the facts of two runs: its name, what it is in a, and in b."""
    found = []
    for key in dict.fromkeys((*a, *b)):
        one, other = a.get(key), b.get(key)
        if one == other:
            continue
        if key.startswith(_CODE) and isinstance(one, str) and isinstance(other, str):
            found.append((key, "", change_sentence(one, other)))
        elif not key.startswith(_CODE):
            text = _complex if key.rpartition(" ")[2] == "poles" else _text
            found.append((key, text(one), text(other)))
    return found


def code_of(row: RunRow) -> dict[str, str]:
    """The source of each of the user's files that the run had, by what it is."""
    return {key: str(value) for key, value in row.facts.items() if key.startswith(_CODE)}


def _facts(head: Mapping[str, Any]) -> dict[str, Any]:
    meta = head.get("meta")
    if not isinstance(meta, Mapping):
        return {}
    choices = head.get("choices") or {}
    facts: dict[str, Any] = {"mode": meta.get("mode", "")}
    for words, key in (("sample period [s]", "sample_period"), ("final time [s]", "duration")):
        if key in meta:
            facts[words] = meta[key]
    for role in ("controller", "model"):
        said = meta.get(role)
        parts: Mapping[str, Any] = said if isinstance(said, Mapping) else {}
        for axis, own in parts.items():
            if not isinstance(own, Mapping):
                continue
            of = f" {axis}" if len(parts) > 1 else ""
            facts[f"{role}{of}"] = own.get("name")
            if own.get("source"):
                facts[f"{_CODE}{role}{of}"] = own["source"]
            if isinstance(own.get("params"), Mapping) and (own.get("source") or role not in choices):
                # what was worked out of the axis's data is no choice: the words of the experiment say what was
                facts |= {
                    f"{_param(role, name)}{of}": value for name, value in own["params"].items() if _is_plain(value)
                }
    if isinstance(own := choices.get("controller"), Mapping):
        facts |= {key: value for key, value in _flat(own, " ") if key not in ("name", "file", *_PARTS)}
    facts |= {key: value for key, value in _flat(choices) if key not in facts}
    if changes := [change for change in meta.get("changes", ()) if change[1] != STOP]:
        facts["changed while it ran"] = len(changes)
    return facts


def _param(role: str, name: str) -> str:
    """What a parameter is called among the facts: the controller's by its name, the model's may have the same."""
    return f"{name} of the {role}" if role == "model" or name in _PARTS else name


def _flat(table: Mapping[str, Any], before: str = "") -> list[tuple[str, Any]]:
    """The words of an experiment that a result does not tell: of its reference, its path, its timing."""
    found: list[tuple[str, Any]] = []
    for key, value in table.items():
        if not before and key in _LEFT_OUT:
            continue
        name = f"{before} {key}".strip()
        if isinstance(value, Mapping):
            found += _flat(value, "" if key == "params" else name or " ")
        else:
            found.append((name, value))
    return found


def _is_plain(value: Any) -> bool:
    return not isinstance(value, list | tuple | dict)


def _together(facts: Mapping[str, Any], role: str) -> str:
    """Each name once, of all axes."""
    return ", ".join(dict.fromkeys(str(value) for key, value in facts.items() if key.split(" ")[0] == role))


def _sentence(changed: list[tuple[str, str, str]]) -> str:
    said = [f"{what} {now}" if was == "" else f"{what} {was} → {now}" for what, was, now in changed]
    more = len(said) - _MOST_CHANGES
    return "; ".join(said[:_MOST_CHANGES]) + (f"; and {more} more" if more > 0 else "")


def _metric(head: Mapping[str, Any], key: str) -> str:
    """Of each axis that has it, with its unit."""
    metrics, units = head.get("metrics"), head.get("units") or {}
    if not isinstance(metrics, Mapping):
        return ""
    found = {axis: own.get(key) for axis, own in metrics.items() if isinstance(own, Mapping)}
    found = {axis: value for axis, value in found.items() if isinstance(value, int | float)}
    unit = " %" if key == "fit_percent" else ""
    said = [
        f"{axis + ' ' if len(found) > 1 else ''}{value:.3g}{unit or ' ' + units.get(axis, 'mm')}"
        for axis, value in found.items()
    ]
    return ", ".join(said)


def _verdict(head: Mapping[str, Any]) -> str:
    meta = head.get("meta") or {}
    if meta.get("ending") not in (None, "done"):
        return f"ended: {meta['ending']}"
    return str(meta.get("verdict") or "")


def _text(value: Any) -> str:
    if value is None:
        return "–"
    if isinstance(value, float):
        return f"{value:.6g}"
    return json.dumps(value, ensure_ascii=False) if isinstance(value, list | dict) else str(value)


def _complex(value: Any) -> str:
    """Pairs of real and imaginary part, as numbers."""
    try:
        return ", ".join(f"{real:g}{imaginary:+g}j" for real, imaginary in value)
    except (TypeError, ValueError):  # none, or of another kind
        return _text(value)


def _json(path: Path) -> dict[str, Any]:
    try:
        said = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return {}
    return said if isinstance(said, dict) else {}
