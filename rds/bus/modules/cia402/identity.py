"""Who a drive is by its own words, and the EDS that belongs to it: found, checked, kept for the next time."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import canopen
from canopen.sdo import SdoAbortedError, SdoCommunicationError

from rds.bus.modules.cia402.codes import Mode
from rds.bus.modules.cia402.eds_file import read_eds
from rds.core.private_files import make_folder, write_private


@dataclass(frozen=True)
class Identity:
    """What a drive says of itself; None where it says nothing."""

    node: int
    name: str | None  # 0x1008
    vendor: int  # 0x1018:01
    product: int | None
    revision: int | None
    serial: int | None
    modes: int | None  # 0x6502

    def has(self, mode: Mode) -> bool:
        """Whether it has a mode of operation, or does not say."""
        return self.modes is None or bool(self.modes & mode.supported_bit)

    def __str__(self) -> str:
        words = [f"node {self.node}: {self.name or 'a drive without a name'}, vendor {self.vendor:#x}"]
        for what, value in (("product", self.product), ("revision", self.revision)):
            if value is not None:
                words.append(f"{what} {value:#x}")
        if self.serial is not None:
            words.append(f"serial number {self.serial}")
        return ", ".join(words)


def identify(node: canopen.RemoteNode) -> Identity:
    """Ask a node for its identity; nothing is changed on it."""
    name = upload(node, 0x1008)
    return Identity(
        node=node.id or 0,
        name=None if name is None else name.rstrip(b"\0").decode("ascii", "replace"),
        vendor=number(node, 0x1018, 1) or 0,
        product=number(node, 0x1018, 2),
        revision=number(node, 0x1018, 3),
        serial=number(node, 0x1018, 4),
        modes=number(node, 0x6502),
    )


def upload(node: canopen.RemoteNode, index: int, subindex: int = 0) -> bytes | None:
    """The bytes of an object; None if the drive does not give it."""
    try:
        return bytes(node.sdo.upload(index, subindex))
    except (SdoAbortedError, SdoCommunicationError):
        return None


def answers(node: canopen.RemoteNode) -> bool:
    """Whether a device is there; one that refuses to give its type answers, too."""
    try:
        node.sdo.upload(0x1000, 0)
    except SdoAbortedError:
        return True
    except SdoCommunicationError:
        return False
    return True


def number(node: canopen.RemoteNode, index: int, subindex: int = 0, signed: bool = False) -> int | None:
    """The value of an object that is a number; None if the drive does not give it."""
    data = upload(node, index, subindex)
    return None if data is None else int.from_bytes(data, "little", signed=signed)


def eds_folder() -> Path:
    """Where EDS files are kept for the next time."""
    return Path(os.environ.get("XDG_DATA_HOME") or Path.home() / ".local" / "share") / "rds" / "eds"


def kept_eds(identity: Identity, folder: Path | None = None) -> Path | None:
    """The EDS that was kept for drives of this vendor and product; None if none was."""
    path = (folder or eds_folder()) / _file_name(identity)
    return path if path.is_file() else None


def keep_eds(path: Path, identity: Identity, folder: Path | None = None) -> Path:
    """Keep an EDS for drives of this kind. Returns where. OSError where that fails."""
    place = (folder or eds_folder()) / _file_name(identity)
    make_folder(place.parent)
    write_private(place, path.read_bytes())
    return place


def check_eds(path: Path, identity: Identity) -> list[str]:
    """What of an EDS does not fit the drive, as sentences. InputError for a file that is no EDS."""
    device = read_eds(path, identity.node).device_information
    vendor, product = device.vendor_number, device.product_number
    doubts = []
    if vendor is not None and vendor != identity.vendor:
        doubts.append(f"the EDS is of vendor {vendor:#x}, and the drive says {identity.vendor:#x}")
    if product is not None and identity.product is not None and product != identity.product:
        doubts.append(f"the EDS is of product {product:#x}, and the drive says {identity.product:#x}")
    return doubts


def _file_name(identity: Identity) -> str:
    return f"{identity.vendor:08X}-{identity.product or 0:08X}.eds"
