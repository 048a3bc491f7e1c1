"""What goes over the bus of CiA 402 drives under command, for the analysis before anything runs."""

from __future__ import annotations

from rds.bus.analysis.messages import HOST, Message, in_order
from rds.bus.modules.cia402.settings import Command, Settings

_STATUS = 6  # bytes: statusword, and position or velocity


def messages_of_drives(
    settings: Settings, sample_period: float, response_time: float = 0.0, host_jitter: float = 0.0
) -> list[Message]:
    """SYNC, each drive's TPDO, the RPDOs for the next SYNC, and everybody's heartbeat; emergencies are left out.

    SYNC is released by the host's clock, `host_jitter` s late at most, and releases the TPDOs, `response_time` s later
    at most. The last TPDO releases the RPDOs, `host_jitter` s later at most: the host has all positions then. All are
    due before the next SYNC.

    Raises InputError for times that can't be.
    """
    period, beats = sample_period, settings.heartbeat
    drives = sorted(settings.drives, key=lambda drive: drive.node)
    sync = Message("SYNC", 0x080, False, 0, period, host_jitter, sender=HOST)
    table = [sync, Message("heartbeat host", 0x700 + settings.host, False, 1, beats, host_jitter, sender=HOST)]
    for drive in drives:
        name, node = drive.axis.name, drive.node
        target = 4 if drive.command is Command.CST else 6  # bytes: controlword, and the target
        table += [
            Message(f"TPDO {name}", 0x180 + node, False, _STATUS, period, response_time, sender=name, after=sync.name),
            Message(f"RPDO {name}", 0x200 + node, False, target, period, host_jitter, sender=HOST,
                    after=f"TPDO {drives[-1].axis.name}"),
            Message(f"heartbeat {name}", 0x700 + node, False, 1, beats, response_time, sender=name),
        ]  # fmt: skip
    return in_order(table)
