"""A button that copies a file of the browser's computer to the kernel, in parts.

Whole, as `ipywidgets.FileUpload` sends it, a file of more than 10 MB ends the connection of a page of JupyterLab, and
is lost without a word. Parts pass there, and the button says how far it is.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import anywidget
import traitlets

from rds.core.errors import InputError
from rds.panels.kit.button import Notice, attempt
from rds.panels.kit.static_files import static

LARGEST = 250_000_000  # bytes of a file: it is in the kernel's memory until it is whole


class FileImport(anywidget.AnyWidget):
    """Calls `take(name, content)` for a file that has come whole; what that refuses is said in `notice`.

    `name` is the browser's, and to be checked. `accept` are the endings that are offered, such as ".png,.jpg".
    """

    _esm = traitlets.Unicode().tag(sync=True)
    text = traitlets.Unicode().tag(sync=True)
    tip = traitlets.Unicode().tag(sync=True)
    accept = traitlets.Unicode().tag(sync=True)

    def __init__(self, text: str, tip: str, take: Callable[[str, bytes], Any], notice: Notice, accept: str = ""):
        super().__init__(_esm=static(__file__, "file_import.js"), text=text, tip=tip, accept=accept)
        self._take, self._notice = take, notice
        self._whose = ""  # the word that the browser gave this file; another one's parts are not mixed in
        self._name, self._size, self._content = "", 0, bytearray()
        self.on_msg(self._said)

    def _said(self, _: Any, content: Any, buffers: Any) -> None:
        """One word of the page: begin, part or failed. Each but the last is answered by more or end."""
        match content:
            case {"kind": "begin", "file": str(whose), "name": str(name), "size": int(size)}:
                self._whose, self._name, self._size, self._content = whose, name, size, bytearray()
                if size > LARGEST:
                    attempt("import", self._refuse, self._notice)
                    self._end(whose)
                else:
                    self._go_on()
            case {"kind": "part", "file": str(whose)}:
                if whose != self._whose:
                    self._notice.say(
                        "an import ended, because another one was begun: import one after the other", "error"
                    )
                    self.send({"kind": "end", "file": whose})
                    return
                self._content += buffers[0]
                self._go_on()
            case {"kind": "failed", "name": str(name), "why": str(why)}:
                self._end(self._whose)
                self._notice.say(f"{name} was not imported: the browser cannot read it ({why})", "error")

    def _go_on(self) -> None:
        if len(self._content) < self._size:
            self.send({"kind": "more", "file": self._whose, "at": len(self._content)})
            return
        content, whose = bytes(self._content), self._whose
        self._end(whose)
        attempt("import", partial(self._take, self._name, content), self._notice)

    def _end(self, whose: str) -> None:
        self._whose, self._content = "", bytearray()
        self.send({"kind": "end", "file": whose})

    def _refuse(self) -> None:
        raise InputError(
            f"{self._name} has {self._size / 1e6:.0f} MB, and up to {LARGEST / 1e6:.0f} MB are imported here; "
            "copy it into the folder yourself"
        )
