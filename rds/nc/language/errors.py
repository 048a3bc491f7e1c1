"""What is wrong with a part program, and where."""

from __future__ import annotations

from rds.core.errors import InputError


class ProgramError(InputError):
    """A part program says something that the dialect or the machine does not allow. Exit code 2.

    `file` (as given; "" when the program has no name), `line` and `column` (from 1; line 0: the file as a whole, as one
    that cannot be read; column 0: the line as a whole), `word` (as it is written in the program; "" when the fault is
    of no one word). The message says what, and after a semicolon what to do; str() puts the place before it:
    `part.ngc:12:5: G81: ...`.
    """

    def __init__(self, message: str, *, file: str = "", line: int = 0, column: int = 0, word: str = ""):
        self.file = file
        self.line = line
        self.column = column
        self.word = printable(word)
        self.reason = printable(message)
        place = ":".join(str(part) for part in (file or "program", line, column) if part)
        super().__init__(f"{self.word}: {self.reason}" if word else self.reason, where=printable(place))

    def at(self, file: str, line: int, column: int = 0, word: str = "") -> ProgramError:
        """The same fault with a place; what is known already stays."""
        known = self.column or column
        return ProgramError(
            self.reason, file=self.file or file, line=self.line or line, column=known, word=self.word or word
        )

    def __reduce__(self) -> tuple:  # an exception with keyword arguments crosses processes only so
        return _again, (self.reason, self.file, self.line, self.column, self.word)


def printable(text: str) -> str:
    r"""The text with what a terminal would obey or not show (escape characters, say) spelled out, as \x1b."""
    if text.isprintable():
        return text
    return "".join(
        character if character.isprintable() else character.encode("unicode_escape", "backslashreplace").decode("ascii")
        for character in text
    )


def _again(reason: str, file: str, line: int, column: int, word: str) -> ProgramError:
    return ProgramError(reason, file=file, line=line, column=column, word=word)
