"""The oacs dialect: distributed modules with a controller of their own, after the OACS thesis. See docs/oacs.md.

    for info in scan(bus):
        print(info)
    module = Module(bus, 4)
    module.move(by=10.0)

The names below are imported on use: a process of modules needs none of them.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rds.bus.modules.oacs.drivers import OacsDrivers
    from rds.bus.modules.oacs.host import ModuleInfo, estop, scan
    from rds.bus.modules.oacs.remote import Information, Module
    from rds.bus.modules.oacs.server import serve
    from rds.bus.modules.oacs.watch import Change, Event, Watch

_WHERE = {
    "Change": "watch",
    "Event": "watch",
    "Information": "remote",
    "Module": "remote",
    "ModuleInfo": "host",
    "OacsDrivers": "drivers",
    "Watch": "watch",
    "estop": "host",
    "scan": "host",
    "serve": "server",
}

__all__ = [
    "Change",
    "Event",
    "Information",
    "Module",
    "ModuleInfo",
    "OacsDrivers",
    "Watch",
    "estop",
    "scan",
    "serve",
]


def __getattr__(name: str) -> Any:
    if name not in _WHERE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_WHERE[name]}"), name)
