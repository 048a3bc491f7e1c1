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
        "SerialHost": "modules.dcs.host:Host",
        "SerialPort": "modules.dcs.port",
        "Statistics": "tools.statistics",
        "VirtualPort": "modules.dcs.port",
        "Watch": "modules.oacs.watch",
        "add_to_queue": "modules.dcs.buffers",
        "analyse_messages": "analysis.analysis_report",
        "measured": "analysis.measured",
        "messages_of": "analysis.messages",
        "prepare_data": "modules.dcs.buffers",
        "read_messages": "analysis.message_tables",
        "reset_everything": "tools.estop",
        "scan_all": "tools.scan",
        "serial_line": "modules.dcs.build:make_line",
        "stepwise": "modules.dcs.methods",
        "stop_everything": "tools.estop",
    },
)
