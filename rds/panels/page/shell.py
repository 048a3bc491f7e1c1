"""The page around the panels: title, emergency stop, navigation, help, light and dark."""

from __future__ import annotations

import logging
from collections.abc import Callable
from html import escape
from types import ModuleType
from typing import Any

import anywidget
import ipywidgets as widgets
import traitlets

from rds.core.errors import RdsError
from rds.panels.kit.button import button, order
from rds.panels.kit.html import Html
from rds.panels.kit.made_at_once import made_at_once
from rds.panels.kit.notice import Notice
from rds.panels.kit.static_files import static
from rds.panels.kit.ticker import Ticker
from rds.panels.page.colours import Colours
from rds.panels.page.emergency import emergency_stop
from rds.panels.page.language import Language
from rds.panels.page.presence import Presence
from rds.panels.page.still_here import StillHere
from rds.panels.registry import PANELS
from rds.panels.session.session import Message, Session

# On a panel that was left. It stays on the page: making it anew took half a second, and ipywidgets leaves a megabyte.
_AWAY = "rds-away"


class Shell:
    """One page. Panels are built when they are opened first, and stay as they were left.

    A panel's `build(shell)` uses `shell.session`, `shell.ticker`, `shell.say`, and `shell.open(name)` to go elsewhere.
    """

    def __init__(self, session: Session, panel: str = "menu"):
        self.session = session
        self.ticker = Ticker(lambda text: self.say(text, "error"))
        self.panels: dict[str, Any] = {}
        self.here = ""
        self.help_page = "readme"
        self.on_help: Callable[[str], None] | None = None  # turns the help to a page, once its panel is there
        self.on_code: Callable[[], Any] | None = None  # shows the code of a controller, once its panel is there
        self._notice = Notice()
        self._heard: list[Message] = list(session.messages)  # what was said before there was a page
        self._title = Html()
        self._title.add_class("rds-title")
        self._title.layout.flex = "1 1 0"
        self._buttons = {name: self._button(name) for name in PANELS.names()}
        nav = widgets.VBox(list(self._buttons.values()))
        nav.add_class("rds-nav")
        self._place = widgets.VBox([])
        self._place.add_class("rds-panel")
        body = widgets.HBox([nav, self._place])
        body.add_class("rds-body")
        self._rescue = Rescue()
        self.colours = Colours(self._darken)
        self.presence = Presence(self._shown, lambda sentence: self.say(sentence, "warning"))
        self.language = Language(session)
        self.still_here = StillHere()  # for what must not go on when the last browser has gone
        style = Html(f"<style>{static(__file__, 'style.css')}</style>")
        unseen = [self.presence, self.still_here, self.colours, self.language, Keys(), style]
        self.widget = widgets.VBox([*unseen, self._corner(), self._head(), self._notice, body, self._rescue])
        self.widget.add_class("rds-app")
        session.watch(self._heard.append)  # from any thread; shown at the next tick
        self.ticker.add(self._show_messages)
        self.ticker.add(self._tell_channels)
        self.open(panel)

    def open(self, name: str) -> None:
        """Go to the panel called `name`; InputError if there is none."""
        module = PANELS.module(name)
        if self.here in self.panels and self.here != name:
            self.panels[self.here].add_class(_AWAY)
        if name not in self.panels:  # its title answers at once; making what is below it takes some tenths of a second
            self._place.add_class("rds-opening")
        self.here = name
        for other, each in self._buttons.items():
            (each.add_class if other == name else each.remove_class)("rds-here")
        about = f"{escape(self.session.machine)} · files in {escape(str(self.session.folder))}"
        self._title.value = f"<h1>{escape(module.TITLE)}</h1><p>{about}</p>"
        if name in self.panels:
            self.panels[name].remove_class(_AWAY)
            return
        with made_at_once():
            self.panels[name] = self._built(module)
        self._place.children = [*self._place.children, self.panels[name]]
        self._place.remove_class("rds-opening")

    def say(self, text: str, kind: str = "note") -> None:
        """A line over the panel; kind is note, good, warning or error."""
        self._notice.say(text, kind)

    def emergency_stop(self) -> None:
        """What the red button does."""
        self.say(*emergency_stop(self.session))

    def _built(self, module: ModuleType) -> Any:
        try:
            return module.build(self)
        except Exception as error:  # whatever it is, the other panels and the emergency stop go on
            if not isinstance(error, RdsError):
                logging.getLogger(__name__).exception("panel %s could not be built", module.NAME)
            notice = Notice()
            notice.say(f"this panel cannot be shown: {error}", "error")
            return notice

    def _button(self, name: str) -> widgets.Button:
        module = PANELS.module(name)
        return button(module.TITLE, module.SUMMARY, lambda: self.open(name), self)

    def _corner(self) -> widgets.Box:
        """The emergency stop, which stays in its corner above everything else, however narrow the page is."""
        stop = widgets.Button(
            description="EMERGENCY STOP", tooltip="Zero volts on every module of the bus, now, whatever runs"
        )
        stop.add_class("rds-stop")
        stop.on_click(lambda _: self.emergency_stop())
        corner = widgets.Box([stop])
        corner.add_class("rds-corner")
        return corner

    def _head(self) -> widgets.HBox:
        tip = "Let the modules be used again after an emergency stop"
        release = order(self, "Release", tip, self._release, self)
        guide = button("Help", "The page of the documentation on this panel", self._help, self)
        head = widgets.HBox([self._title, self.language.choice, guide, self.colours.button, release])
        head.add_class("rds-head")
        return head

    def _release(self) -> None:
        self.say(self.session.release_emergency_stop(), "good")

    def _darken(self, dark: bool) -> None:
        (self.widget.add_class if dark else self.widget.remove_class)("rds-dark")

    def _help(self) -> None:
        """The help, at the page of the panel one is in."""
        if self.here == "help":
            return
        self.help_page = PANELS.module(self.here).HELP
        self.open("help")
        if self.on_help is not None:
            self.on_help(self.help_page)

    def _show_messages(self) -> None:
        while self._heard:  # one that another thread says meanwhile is not lost
            message = self._heard.pop(0)
            self.say(message.text, message.kind)

    def _tell_channels(self) -> None:
        """To the page, which names them to its server in an emergency: this kernel may not be able to then."""
        self._rescue.channels = sorted(self.session.channels)

    def _shown(self) -> None:
        """A browser shows the page: take up what other pages of the folder have done since this one was made ready."""
        self.session.refresh()
        self._offer_runs()

    def _offer_runs(self) -> None:
        """What was going on when the page was last left."""
        from rds.panels.equipment.taken_up import is_driven_by
        from rds.panels.session.kept_runs import State

        if going := self.session.runs_that_go_on():
            if self.here == "menu":  # whoever reloads the page is back where the run is
                self.open(f"equipment-{is_driven_by(going[0])}")
        elif [run.state for run in self.session.runs(1)] == [State.CUT_SHORT]:
            self.say("the last run was cut short; what it recorded can be opened among the earlier runs", "warning")


class Keys(anywidget.AnyWidget):
    """A panel by the keyboard and by ear: what ipywidgets leaves to mouse and eye. Invisible; one on a page."""

    _esm = traitlets.Unicode().tag(sync=True)

    def __init__(self) -> None:
        super().__init__(_esm=static(__file__, "keys.js"))


class Rescue(anywidget.AnyWidget):
    """The page's way around its own kernel, which a single call of a student's code may hold.

    Hidden while the kernel answers the page, once a second; else what it is at, and a button that ends it.
    The emergency stop goes to the page's server as well, with `channels`: those of the built-in bus beside the
    machine's own. Only on the page of `rds app`: JupyterLab has buttons of its own for its kernels.
    """

    _esm = traitlets.Unicode().tag(sync=True)
    _css = traitlets.Unicode().tag(sync=True)
    channels: Any = traitlets.List([]).tag(sync=True)

    def __init__(self) -> None:
        super().__init__(_esm=static(__file__, "rescue.js"), _css=static(__file__, "rescue.css"))
        self.on_msg(self._asked)

    def _asked(self, _: Any, content: Any, __: Any) -> None:
        """Anything else than the question whether it is there does nothing."""
        if content == {"kind": "beat"}:
            self.send({"kind": "beat"})
