"""A drive's parameters kept in it, or reset: objects 0x1010 and 0x1011 of CiA 301."""

from __future__ import annotations

import canopen
from canopen.sdo import SdoAbortedError, SdoCommunicationError

from rds.core.errors import MachineError

_SAVE, _LOAD = b"save", b"load"
_LASTS = 10.0  # s that a drive may take to write its memory


def store(node: canopen.RemoteNode) -> None:
    """Keep all parameters as they are now, also when the drive is switched off. MachineError if it refuses."""
    _say(node, 0x1010, _SAVE, "store its parameters")


def restore(node: canopen.RemoteNode) -> None:
    """The manufacturer's parameters come back when the drive is switched on again. MachineError if it refuses."""
    _say(node, 0x1011, _LOAD, "restore its parameters")


def _say(node: canopen.RemoteNode, index: int, word: bytes, what: str) -> None:
    patience, node.sdo.RESPONSE_TIMEOUT = node.sdo.RESPONSE_TIMEOUT, _LASTS
    try:
        node.sdo.download(index, 1, word)
    except SdoAbortedError as error:
        raise MachineError(
            f"node {node.id} does not {what} (0x{index:04X}): {error}; most do so only without power, and some by "
            "their own tools only"
        ) from error
    except SdoCommunicationError as error:
        raise MachineError(f"node {node.id} did not answer when told to {what}: {error}") from error
    finally:
        node.sdo.RESPONSE_TIMEOUT = patience
