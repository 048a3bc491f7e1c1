"""A panel's choices: fields with their values, watched by whoever shows them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from rds.core.errors import InputError
from rds.panels.session.fields import Field


class Choices:
    """Values of `fields`, each always one that its field allows. `watch` tells of changes; fields may be replaced.

    A change of one field may change what another allows (the unit of an amplitude, the options of a controller):
    `replace` swaps fields and keeps values that still will do.
    """

    def __init__(self, fields: Iterable[Field]):
        self._fields = {each.name: each for each in fields}
        self._values = {name: each.default for name, each in self._fields.items()}
        self._waiting: dict[str, Any] = {}  # kept values of fields that are not there yet
        self._watchers: list[Callable[[str], None]] = []

    @property
    def fields(self) -> Mapping[str, Field]:
        """The fields by name, in order."""
        return self._fields

    def __getitem__(self, name: str) -> Any:
        return self._values[self._known(name)]

    def __contains__(self, name: object) -> bool:
        return name in self._fields

    def set(self, name: str, value: Any) -> None:
        """Set one; InputError if its field will not have the value, which then stays what it was."""
        value = self._fields[self._known(name)].check(value)
        if value != self._values[name]:
            self._values[name] = value
            self._tell(name)

    def reset(self) -> None:
        """All defaults."""
        for name, each in list(self._fields.items()):
            if name in self._fields:  # one choice may take others away
                self.set(name, each.default)

    def replace(self, fields: Iterable[Field]) -> None:
        """Other fields for the same names, or new ones.

        A value that will not do any more, or that was in another unit, becomes the default.
        """
        fields = list(fields)
        for each in fields:
            before = self._fields.get(each.name)
            same = getattr(before, "unit", None) == getattr(each, "unit", None)
            waiting = self._waiting.pop(each.name, each.default)
            old = waiting if before is None else self._values[each.name] if same else each.default
            self._fields[each.name] = each
            try:
                self._values[each.name] = each.check(old)
            except InputError:
                self._values[each.name] = each.default
        for each in fields:  # once all of them are there
            self._tell(each.name)

    def remove(self, names: Iterable[str]) -> None:
        """Take fields away."""
        gone = [name for name in names if name in self._fields]
        for name in gone:
            del self._fields[name], self._values[name]
        for name in gone:
            self._tell(name)

    def watch(self, watcher: Callable[[str], None]) -> Callable[[], None]:
        """Call `watcher(name)` after each change; the answer ends that, however often it is called."""
        self._watchers.append(watcher)

        def end() -> None:
            if watcher in self._watchers:
                self._watchers.remove(watcher)

        return end

    def values(self) -> dict[str, Any]:
        """All values, in JSON's types."""
        return dict(self._values)

    def load(self, values: Mapping[str, Any]) -> list[str]:
        """Set what was kept earlier; sentences for what will not do any more and was left at its default.

        A name with a dot belongs to something that is chosen (a controller's gain): its value waits for its field.
        """
        refused = []
        for name, value in values.items():
            if "." in name and name not in self._fields:
                self._waiting[name] = value
                continue
            try:
                self.set(name, value)
            except InputError as error:
                refused.append(str(error))
        return refused

    def _known(self, name: str) -> str:
        if name not in self._fields:
            raise InputError(f"there is no choice {name!r}; there are {', '.join(self._fields)}")
        return name

    def _tell(self, name: str) -> None:
        for watcher in tuple(self._watchers):
            watcher(name)
