"""CAN: the built-in bus, the frames, virtual axis modules, and the host's drivers."""

from rds.core.face import face

__getattr__, __dir__ = face(
    __name__,
    {
        "Cia402Drivers": "modules.cia402.host",
        "Faults": "hub.faults",
        "LogFile": "tools.logs",
        "Message": "analysis.messages",
        "Module": "modules.oacs.remote",
        "OacsDrivers": "modules.oacs.drivers",
        "Receiver": "tools.receiver",
        "Statistics": "tools.statistics",
        "Watch": "modules.oacs.watch",
        "analyse_messages": "analysis.analysis_report",
        "messages_of": "analysis.messages",
        "read_messages": "analysis.message_tables",
        "reset_everything": "tools.estop",
        "scan_all": "tools.scan",
        "stop_everything": "tools.estop",
    },
)
