"""CiA 402 drives over CANopen: a simulated drive with the axis models behind it, and the host's side for any drive.

The drive (`drive.Drive`) knows frames and bus time and no bus; `node.DriveNode` puts it on one, `server.serve` puts a
machine's drives on one. The host's side is `host.Cia402Drivers`. `axis.eds` describes the simulated drive.
"""
