"""Errors, each with what happened, the value that caused it, and what to do about it."""


class RdsError(Exception):
    """Base of all errors that the system raises on purpose."""

    def _render_traceback_(self) -> list[str]:
        """What IPython shows in place of a traceback: the user's own lines, and the message.

        The frames of this package say nothing to whoever made the slip; `traceback.print_last()` has them.
        """
        from traceback import extract_tb

        from rds.core.traceback_frames import is_installed, place_of

        own = [frame for frame in extract_tb(self.__traceback__) if not is_installed(frame.filename)]
        lines = dict.fromkeys(f"{place_of(frame)}: {frame.line}" for frame in own)  # a recursion has one many times
        return [*lines, f"\x1b[31m{type(self).__name__}\x1b[0m: {self}"]


class InputError(RdsError):
    """Something that a user wrote or named is wrong: a file, a key, a value, an option. Exit code 2.

    Give the place (`where`: file, table and key, or line) when it is known; it leads the message.
    """

    def __init__(self, message: str, where: str | None = None):
        self.where = where
        super().__init__(f"{where}: {message}" if where else message)


class ContractError(InputError):
    """A student's model, controller or interpolator does not keep its fixed interface."""


class Notice(UserWarning):
    """What a user should know, though nothing fails by it. The command line says it as a note."""


class MachineError(RdsError):
    """The machine or its bus does not do its part: no answer, a lost node, a fault in its status."""


class AdapterError(MachineError):
    """The adapter between computer and bus has failed: unplugged, without power, or its line garbled."""
