"""The jobs of a server: loaded, and run one at a time, in order."""

from __future__ import annotations

import threading
from typing import Any

from rds.core.blame import is_students, student_error
from rds.core.errors import InputError, RdsError
from rds.jobs.folder import Folder
from rds.jobs.job import LOADED, OVER, QUEUED, RUNNING, STARTING, Job
from rds.modes import DEFAULT, load_mode
from rds.modes.experiment.experiment import Experiment
from rds.nc.run.run import PartProgram

MOST = 100  # jobs that are kept
_SAFE_END = 20.0  # s for a run that is stopped
NO_END = (
    f"stopped, but its code did not end within {_SAFE_END:g} s; look for a call that waits, such as input(). "
    "It is left behind until the server ends"
)


class Jobs:
    """All jobs of a folder. Its methods may be called from any thread; each answers at once but for `load`."""

    def __init__(self, folder: Folder):
        self.folder = folder
        self._jobs: dict[int, Job] = {}
        self._count = 0
        self._queue: list[Job] = []
        self._current: Job | None = None
        self._closed = False
        self._lock = threading.RLock()

    def load(self, name: str, mode: str | None, machine: str | None, experiment: str | None, keep: bool) -> Job:
        """A job of the file, read and checked; number 0 unless `keep`. InputError with all that is wrong with it.

        A .toml file is an experiment; any other a part program, whose `machine` (a name, or a file in the folder) and
        `experiment` (a file with its controllers) may be given.
        """
        with self._lock:
            if keep and len(self._jobs) >= MOST:
                raise InputError(f"{MOST} jobs are loaded; drop some that are over")
        file = self.folder.file(name)
        loaded = self._read(name, mode, machine, experiment)
        made = Job(0, self.folder.relative(file), loaded, mode or loaded.mode)
        loaded.plan(made.mode)
        if keep:
            with self._lock:
                self._count += 1
                made.number = self._count
                self._jobs[made.number] = made
        return made

    def _read(self, name: str, mode: str | None, machine: str | None, experiment: str | None) -> Experiment:
        file = self.folder.file(name)
        if file.suffix == ".toml":
            for key, value in (("machine", machine), ("experiment", experiment)):
                if value is not None:
                    raise InputError(f"{key} = {value!r} belongs to a part program; {name} is an experiment")
            self.folder.check_words(file)
            return Experiment.from_toml(file)
        words = None
        if experiment is not None:
            words = self.folder.file(experiment)
            self.folder.check_words(words)
        machine = None if machine is None else self.folder.machine(machine, "machine")
        return PartProgram(file, machine, experiment=words, mode=mode or (None if words else DEFAULT))

    def job(self, number: int) -> Job:
        """The job of this number. InputError if there is none."""
        with self._lock:
            if number not in self._jobs:
                raise InputError(f"there is no job {number}; `load` a file first")
            return self._jobs[number]

    def all(self) -> list[Job]:
        """Every job, the oldest first."""
        with self._lock:
            return list(self._jobs.values())

    def run(self, number: int, queue: bool) -> Job:
        """Begin; behind those that run and wait if `queue`, else InputError while another job runs."""
        with self._lock:
            job = self.job(number)
            if job.state != LOADED:
                raise InputError(f"job {number} is {job.state}; a job runs once: load its file again")
            if self._closed:
                raise InputError("the server ends; no job is started any more")
            if self._current is None:
                self._begin(job)
                if job.error is not None:
                    raise InputError(job.error)
            elif queue:
                job.state = QUEUED
                self._queue.append(job)
            else:
                raise InputError(f"job {self._current.number} runs, and one runs at a time; wait, stop it, or queue")
            return job

    def stop(self, number: int) -> Job:
        """A safe end of a job that runs; one that waits is taken out of the queue."""
        with self._lock:
            job = self.job(number)
            if job in self._queue:
                self._queue.remove(job)
                job.state = LOADED
                return job
        job.active().stop()
        if not load_mode(job.mode).real_time:  # a target ends what hangs in it; nothing ends a thread that sleeps
            patience = threading.Timer(_SAFE_END, self._over, (job, NO_END))
            patience.daemon = True
            patience.start()
        return job

    def drop(self, number: int) -> None:
        """Forget a job that does not run; its results stay."""
        with self._lock:
            job = self.job(number)
            if job.state not in (LOADED, OVER):
                raise InputError(f"job {number} is {job.state}; stop it first")
            del self._jobs[number]

    def close(self) -> bool:
        """Stop what runs, start nothing more; whether the run came to its end within `_SAFE_END` s."""
        with self._lock:
            self._closed = True
            self._queue.clear()
            job = self._current
        if job is None or job.run is None:
            return True
        job.run.ready(_SAFE_END)
        job.run.stop()
        try:
            job.run.wait(timeout=_SAFE_END)
        except TimeoutError:
            return False
        except Exception:  # the run's own error is in its job
            pass
        return True

    def _begin(self, job: Job) -> None:
        try:
            job.out = self.folder.results(job.name)
            job.run = job.experiment.start(job.mode, out=job.out)
        except Exception as error:
            job.state, job.error = OVER, sentence(error)
            return
        job.state, self._current = STARTING, job
        threading.Thread(target=self._follow, args=(job, job.run), name=f"job {job.number}", daemon=True).start()

    def _follow(self, job: Job, run: Any) -> None:
        """Until it is over; then the next one of the queue."""
        try:
            run.ready()
            with self._lock:
                if self._current is job:  # else it took too long to stop, and is left behind
                    job.state = RUNNING
            run.wait()
        except BaseException as error:
            self._over(job, sentence(error))
        else:
            self._over(job, None)

    def _over(self, job: Job, error: str | None) -> None:
        """The job is over, unless it was before; then the next one of the queue."""
        with self._lock:
            if self._current is not job:
                return
            job.error = error  # first: the end of a run without an error is waited for
            job.state, self._current = OVER, None
            while self._queue and self._current is None and not self._closed:
                self._begin(self._queue.pop(0))


def sentence(error: BaseException) -> str:
    """An error as a client gets it."""
    if isinstance(error, RdsError):
        return str(error)
    if isinstance(error, OSError):
        return f"{error.filename or 'a file'}: {error.strerror or error}"
    if isinstance(error, Exception) and is_students(error):
        return student_error(error)
    return f"{type(error).__name__}: {error}"
