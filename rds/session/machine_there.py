"""Whether the machine that a run needs is there, before it runs."""

from __future__ import annotations

from rds.core.errors import RdsError
from rds.modes.machine import BUILTIN
from rds.runtime.plan import Plan

_MACHINE = ("emulation", "implementation", "system-test", "model-validation")  # modes that have a bus


def machine_sentence(plan: Plan) -> str:
    """What a run of `plan` will find on its bus. Sends nothing that moves anything."""
    if plan.mode not in _MACHINE:
        return "no machine is needed"
    from rds.bus.address import channels
    from rds.bus.dialects import DEFAULT, is_served
    from rds.bus.link import bus_name, bus_options, default_channel

    bus = {"interface": BUILTIN, **plan.bus}
    interface = str(bus["interface"])
    channel = default_channel(plan.machine, interface, bus.get("channel"))
    builtin = interface == BUILTIN
    if builtin:
        channel = str(channel)  # 0 is a channel's name there
    options = {} if builtin else bus_options(bus)
    where = bus_name(interface, channel)
    if builtin and channel not in channels():
        return "no machine is on the built-in bus yet: a simulated one is started for the run"
    try:
        there = is_served(bus.get("dialect", DEFAULT), plan.machine, interface, channel, **options)
    except (RdsError, OSError) as error:
        return f"but the machine does not answer: {error}"
    if there:
        return f"the machine answers on {where}"
    return f"but no module of {plan.machine.name} answers on {where}; switch it on before you run"
