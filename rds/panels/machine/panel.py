"""Machine: modules started, found, configured to a machine, tuned; what goes over their bus."""

from __future__ import annotations

from typing import Any

import ipywidgets as widgets

from rds.panels.machine.bus_view import BusView
from rds.panels.machine.configuration_view import ConfigurationView
from rds.panels.machine.controllers_view import ControllersView
from rds.panels.machine.library_view import LibraryView
from rds.panels.machine.modules_view import ModulesView
from rds.panels.machine.script_view import ScriptView
from rds.panels.machine.state import MachineState

NAME = "machine"
TITLE = "Machine"
SUMMARY = "Find the modules on the bus, configure a machine from them, tune them, and watch their bus"
HELP = "machine-panel"


def build(shell: Any) -> widgets.Widget:
    """The panel: a tab for each step, in the order in which they are done."""
    state = MachineState(shell.session)
    configuration = ConfigurationView(shell, state)
    controllers = ControllersView(shell, state)

    def found() -> None:
        configuration.refresh()
        controllers.refresh()

    modules = ModulesView(shell, state, found)
    tabs = widgets.Tab(
        [
            modules.widget,
            configuration.widget,
            controllers.widget,
            BusView(shell, state).widget,
            LibraryView(shell, state).widget,
            ScriptView(shell, state).widget,
        ]
    )
    for index, title in enumerate(("1 Modules", "2 Configuration", "3 Controllers", "Bus", "By hand", "Script")):
        tabs.set_title(index, title)
    tabs.add_class("rds-tabs")
    return tabs
