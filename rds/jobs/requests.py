"""What clients may ask, each with its words declared, and the answers."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

from rds.core.errors import InputError
from rds.core.quantities import Choice, Declaration, Flag, Quantity, Table, Text, near
from rds.core.shared_quantities import FEED_SHARE
from rds.core.toml_table import TomlTable
from rds.jobs.jobs import Jobs
from rds.modes import mode_names

_JOB = Quantity("the number that `load` gave", "", 1, 2**53, whole=True)
_FILE: dict[str, Declaration] = {
    "file": Text("path in the served folder: an experiment (.toml) or a part program"),
    "mode": Choice("mode of the run; by default the file's own, of a part program simulation", mode_names),
    "machine": Text("of a part program: a machine's name, or a file in the folder"),
    "experiment": Text("of a part program: experiment file in the folder with its controllers and its [bus]"),
}


def _of_job(meaning: str, **more: Declaration) -> Table:
    return Table(meaning, {"job": _JOB, **more}, needed=("job", *more))


VERBS: dict[str, Table] = {
    "load": Table("read and check a file; the job's number", _FILE, needed=("file",)),
    "check": Table("the same, and forget it", _FILE, needed=("file",)),
    "configure": Table(
        "a machine from a configuration script (NCC), judged; a new file in the folder where it is a machine",
        {
            "script": Text("the script, its lines from RF01 to BUILD"),
            "file": Text("the new file, as in mine.toml"),
            "like": Text("the machine that is reconfigured: a machine's name, or a file in the folder"),
        },
        needed=("script", "file"),
    ),
    "run": Table(
        "begin",
        {"job": _JOB, "queue": Flag("wait for the job that runs, instead of a refusal", False)},
        needed=("job",),
    ),
    "hold": _of_job("come to rest on the path"),
    "resume": _of_job("go on after a hold, M0, M1 or a tool change"),
    "override": _of_job("feed", share=FEED_SHARE),
    "home": _of_job("end the program where it is, and move home"),
    "set": _of_job("change a live value", name=Text("its name, as in X.Pgain"), value=Quantity("its value")),
    "stop": _of_job("a safe end; a job that waits leaves the queue"),
    "status": _of_job("where it is"),
    "watch": Table(
        "its status again and again until it is over",
        {"job": _JOB, "period": Quantity("between two lines", "s", 0.05, 60.0, default=0.5)},
        needed=("job",),
    ),
    "jobs": Table("the status of all jobs", {}),
    "drop": _of_job("forget a job that does not run"),
}


def parse(line: bytes) -> dict[str, Any]:
    """The request in a line. InputError for what is no JSON object."""
    try:
        found = json.loads(line, parse_constant=_no_number, object_pairs_hook=_once)
    except InputError:
        raise
    except (ValueError, RecursionError) as error:
        raise InputError(f'the line is not JSON ({error}); send one object, as in {{"do": "jobs"}}') from error
    if not isinstance(found, dict):
        raise InputError('the line must be one JSON object, as in {"do": "jobs"}')
    return found


def _no_number(word: str) -> float:
    raise InputError(f"{word} is no number of JSON")


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        raise InputError("a key is given twice; give it once")
    return found


def words_of(request: dict[str, Any]) -> tuple[str, dict[str, Any]]:
    """Verb and values of a request, every word checked. InputError for anything that is unknown, missing or wrong."""
    verb = request.get("do")
    if not isinstance(verb, str) or verb not in VERBS:
        raise InputError(f"do = {verb!r:.60} is unknown; known: {', '.join(VERBS)}{near(verb, list(VERBS))}")
    declared = VERBS[verb]
    table = TomlTable(
        {key: value for key, value in request.items() if key not in ("do", "id")},
        Table(declared.meaning, declared.keys, needed=declared.needed),
        path=f"request {verb!r}",
    )
    values = {key: table.read(key) for key in declared.keys}
    table.done()
    return verb, values


def answer(jobs: Jobs, verb: str, values: dict[str, Any]) -> dict[str, Any]:
    """What a request (but `watch`) gets. Raises what the work raises."""
    return _ANSWERS[verb](jobs, **values)


def _load(jobs: Jobs, **words: Any) -> dict[str, Any]:
    job = jobs.load(words["file"], words["mode"], words["machine"], words["experiment"], keep=True)
    return {"job": job.number, **job.about()}


def _check(jobs: Jobs, **words: Any) -> dict[str, Any]:
    return jobs.load(words["file"], words["mode"], words["machine"], words["experiment"], keep=False).about()


def _configure(jobs: Jobs, script: str, file: str, like: str | None) -> dict[str, Any]:
    from rds.core.atomic import write_whole
    from rds.machines import load_machine
    from rds.machines.configuration import verdict
    from rds.machines.ncc import machine_of_script, machine_text_of_script, read_script

    place = jobs.folder.new_file(file, ".toml")
    before = None if like is None else load_machine(jobs.folder.machine(like, "like"))
    read = read_script(script, "script")
    judged = verdict(machine_of_script(read, place.stem, before))
    if judged.ok:
        write_whole(place, machine_text_of_script(read, place.stem, before).encode())
    return {"file": jobs.folder.relative(place) if judged.ok else None, "verdict": judged.to_json()}


def _run(jobs: Jobs, job: int, queue: bool) -> dict[str, Any]:
    begun = jobs.run(job, queue)
    out = None if begun.out is None else jobs.folder.relative(begun.out)
    return {"job": job, "state": begun.state, "out": out}


def _override(jobs: Jobs, job: int, share: float) -> dict[str, Any]:
    jobs.job(job).program().override(share)
    return {"job": job}


def _set(jobs: Jobs, job: int, name: str, value: float) -> dict[str, Any]:
    jobs.job(job).active().live_values.set(name, value)
    return {"job": job}


def _operator(verb: str) -> Callable[..., dict[str, Any]]:
    def obey(jobs: Jobs, job: int) -> dict[str, Any]:
        getattr(jobs.job(job).program(), verb)()
        return {"job": job}

    return obey


def _drop(jobs: Jobs, job: int) -> dict[str, Any]:
    jobs.drop(job)
    return {"job": job}


_ANSWERS: dict[str, Callable[..., dict[str, Any]]] = {
    "load": _load,
    "check": _check,
    "configure": _configure,
    "run": _run,
    "hold": _operator("hold"),
    "resume": _operator("resume"),
    "home": _operator("home"),
    "override": _override,
    "set": _set,
    "stop": lambda jobs, job: {"job": job, "state": jobs.stop(job).state},
    "status": lambda jobs, job: jobs.job(job).status(),
    "jobs": lambda jobs: {"jobs": [job.status() for job in jobs.all()]},
    "drop": _drop,
}
