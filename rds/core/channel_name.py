"""Names of the channels of the built-in bus and of served serial lines, which are names of files as well."""

from __future__ import annotations

import re
from binascii import crc32

CHANNEL = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,31}", re.ASCII)


def channel_name(text: str) -> str:
    """The text, where a channel can have that name; else a name that is made of it, and of no other text."""
    if CHANNEL.fullmatch(text):
        return text
    plain = re.sub("[^A-Za-z0-9]+", "-", text).strip("-")[:20] or "channel"
    return f"{plain}-{crc32(text.encode(errors='replace')):08x}"
