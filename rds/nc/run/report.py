"""The report on a program's run: cycle time, where along the program axes and contour are worst, with pictures."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

from rds.modes.experiment.report import pictures_of, save_with_report
from rds.nc.path_block import PathBlock
from rds.nc.run.judge import WAITS, worst_lines
from rds.nc.run.prepare import Prepared
from rds.results import Result
from rds.results.reports.content import Report, Table
from rds.results.reports.write import write

KIND = "program"
LOOKED_AT = 20.0  # s of motion for which it is looked for what would save a second, which takes some 30 plans
_WORST = 5  # lines in a table
_TEXT = 60  # characters of a program line
_CHANGES = 200  # in a table
_WAITED = {
    "held_s": "held",
    "stops_s": "M0 and M1",
    "tool_changes_s": "tool changes",
    "spindle_s": "waiting for the spindle's speed",
    "homing_s": "moving home",
}


def save_run(result: Result, prepared: Prepared, folder: Path, title: str | None = None) -> dict[str, Path]:
    """Save pictures and reports beside the tables in `folder`; each file's path by its kind."""
    pictures = pictures_of(result)  # while the program's own are drawn here
    written = write(program_report(result, prepared), folder)
    for pattern in ("*.csv", "*.png"):  # a table that an earlier run had and this one has not
        for left in set(folder.glob(f"{KIND}-{pattern}")) - set(written):
            left.unlink(missing_ok=True)
    files = save_with_report(result, folder, title or f"{prepared.file.name}, {result.mode}", written, pictures)
    return files | {KIND: written[0]} | {path.stem: path for path in written[1:] if path.suffix == ".png"}


def program_report(result: Result, prepared: Prepared) -> Report:
    """What was measured of a program's run, in tables, pictures and sentences."""
    from rds.nc.run.pictures import along, path

    about = result.meta["program"]
    text = _program_lines(prepared.file) if about.get("counted_in", "line") == "line" else []
    return Report(
        kind=KIND,
        title=f"{prepared.file.name} on {result.meta.get('machine')}, {result.mode}",
        sources=[str(prepared.file)],
        settings={
            "mode": result.mode,
            "sample period": f"{prepared.T:g} s",
            "ending": result.meta.get("ending"),
            "why": result.meta.get("ending_reason") or None,
            "timing": result.verdict,
        },
        tables=[
            _times(about),
            *([_contour(result, about, text)] if about["contour_error"] else []),
            _following(about, text),
            *([_changes(result)] if result.meta.get("changes") else []),
        ],
        figures={
            "path": partial(path, result, prepared),
            "along the program": partial(along, result, prepared),
            **({"certificate": partial(certificate_picture, prepared)} if prepared.certificate else {}),
        },
        findings=[*findings(about), *_certified(prepared), *map(str, result.meta.get("notes", ()))],
        links={"responses, voltages and timing of each axis": "report.html", "all samples": "result.csv"},
    )


def findings(about: dict[str, Any]) -> list[str]:
    """What a reader wants to know first, as sentences."""
    said, of = [], about.get("counted_in", "line")
    if begin := about.get("begun_at_line"):
        said.append(
            f"It was begun at line {begin}: of the lines before, tool, spindle and coolant alone hold. The way there "
            "counts as the first line that moves."
        )
    if about["contour_error"]:
        worst = about["contour_error"]
        said.append(
            f"The measured position is at most {worst['max']:.4f} mm off the programmed path, in {of} {worst['line']} "
            f"(t = {worst['time_s']:.3f} s); RMS {worst['rms']:.4f} mm."
        )
    if worst := about.get("path_error"):
        said.append(
            f"What was commanded is at most {worst['max']:.4f} mm off it, in {of} {worst['line']} (t = "
            f"{worst['time_s']:.3f} s); RMS {worst['rms']:.4f} mm."
        )
    following = about["following_error"]
    for unit in dict.fromkeys(worst["unit"] for worst in following.values()):
        axis, worst = max(
            ((axis, worst) for axis, worst in following.items() if worst["unit"] == unit),
            key=lambda each: each[1]["max"],
        )
        if worst["max"] > 0.0:
            said.append(f"{axis} follows worst: {worst['max']:.4f} {unit} in {of} {worst['line']}.")
    share, kind, axis = max(
        (share, kind, axis) for axis, shares in about["limit_shares"].items() for kind, share in shares.items()
    )
    size = f"{100.0 * share:.1f} % of" if share < 10.0 else f"{share:,.0f} times"
    said.append(f"What was sent to the axes is at most {size} a limit ({kind} of {axis}).")
    if share > 1.0 and "interpolator" in about:
        said.append(
            "An interpolator does not plan within the limits: where its feed jumps, acceleration and jerk have no "
            "bound. A profile of planned motion in its place keeps within them."
        )
    predicted, moving = about["predicted_s"], about["moving_s"]
    if not about["completed"]:
        said.append(f"The run ended in {of} {about['last_line']}, after {about['done_percent']:.1f} % of the program.")
    elif about["predicted_samples"] == about["moving_samples"]:
        said.append(f"It moved for {moving:.3f} s, as predicted to the sample.")
    elif "interpolator" in about:
        said.append(f"It moved for {moving:.3f} s; at the programmed feed throughout it is {predicted:.3f} s.")
    else:
        kept = ", which threads and taps do not follow" if about.get("own_feed") else ""
        said.append(
            f"It moved for {moving:.3f} s instead of {predicted:.3f} s: the override was not 100 % throughout{kept}."
        )
    return said


def certificate_picture(prepared: Prepared) -> Any:
    """The picture of the certificate; of planned motion with what holds it back."""
    from rds.interpolators.motion.limiting import ASKED, explained

    certificate = prepared.certificate
    assert certificate is not None
    if certificate.least_time is None or not len(prepared.path):
        return certificate.plot()
    whole = PathBlock(prepared.path, list(prepared.events))
    looked_for = ASKED if prepared.seconds <= LOOKED_AT else 0
    return certificate.plot(explained=explained([whole], certificate.limits, prepared.T, looked_for))


def _certified(prepared: Prepared) -> list[str]:
    return [prepared.certificate.sentence()] if prepared.certificate else []


def _times(about: dict[str, Any]) -> Table:
    rows = [["predicted", about["predicted_s"]], ["moving and dwelling", about["moving_s"]]]
    rows += [[_WAITED[name], about[name]] for name in WAITS.values() if about[name]]
    rows.append(["in all", about["executed_s"]])
    return Table("Cycle time", ["", "time [s]"], rows, digits={"time [s]": 3})


def _contour(result: Result, about: dict[str, Any], text: list[str]) -> Table:
    rows = [
        [line, value, when, _line(text, line)]
        for line, value, when in worst_lines(result, result["contour_error"], _WORST)
    ]
    return Table(
        "Where the contour error is largest",
        [about.get("counted_in", "line"), "contour error [mm]", "at [s]", "program"],
        rows,
        "The distance of the measured position to the programmed path, corners uncut. X, Y and Z count.",
        {"contour error [mm]": 4, "at [s]": 3},
    )


def _following(about: dict[str, Any], text: list[str]) -> Table:
    rows = [
        [name, worst["max"], worst["unit"], worst["line"], worst["time_s"], worst["rms"], _line(text, worst["line"])]
        for name, worst in about["following_error"].items()
    ]
    return Table(
        "Where each axis follows worst",
        ["axis", "largest |error|", "unit", about.get("counted_in", "line"), "at [s]", "RMS error", "program"],
        rows,
        f"The error is reference minus measured position{_left_out(about)}.",
        {"largest |error|": 4, "at [s]": 3, "RMS error": 4},
    )


def _left_out(about: dict[str, Any]) -> str:
    waited = about["waiting_samples"]
    return f", while the program moves the axes; {waited} samples of waiting are left out" if waited else ""


def _changes(result: Result) -> Table:
    changes = result.meta["changes"]
    note = f"The first {_CHANGES} of {len(changes)}." if len(changes) > _CHANGES else ""
    return Table("Changed while it ran", ["at [s]", "what", "from", "to"], changes[:_CHANGES], note, {"at [s]": 3})


def _program_lines(file: Path) -> list[str]:
    try:
        return file.read_bytes().decode("utf-8-sig", "replace").split("\n")  # as the interpreter counts lines
    except OSError:  # it was there when it was read
        return []


def _line(text: list[str], number: int) -> str:
    if not 1 <= number <= len(text):
        return ""
    line = text[number - 1].strip()
    return line if len(line) <= _TEXT else f"{line[: _TEXT - 1]}…"
