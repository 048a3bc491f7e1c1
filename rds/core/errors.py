"""Errors, each with what happened, the value that caused it, and what to do about it."""


class RdsError(Exception):
    """Base of all errors that the system raises on purpose."""


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
