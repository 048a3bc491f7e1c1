"""The system calls that Python has no name for, through the C library."""

from __future__ import annotations

import ctypes
import os
import resource
import struct

CLONE_NEWNS, CLONE_NEWIPC, CLONE_NEWUSER, CLONE_NEWPID = 0x00020000, 0x08000000, 0x10000000, 0x20000000
MS_RDONLY, MS_NOSUID, MS_NODEV, MS_NOEXEC, MS_BIND = 1, 2, 4, 8, 4096
MS_REC, MS_PRIVATE = 16384, 1 << 18

_PR_SET_DUMPABLE, _PR_SET_SECCOMP, _PR_CAPBSET_DROP, _PR_SET_NO_NEW_PRIVS = 4, 22, 24, 38
_PR_CAP_AMBIENT, _PR_CAP_AMBIENT_CLEAR_ALL = 47, 4
_SECCOMP_MODE_FILTER = 2
_CAPABILITY_VERSION_3 = 0x20080522
_FILTER_STEP = 8  # bytes of one BPF instruction

_libc = ctypes.CDLL(None, use_errno=True)


def unshare(flags: int) -> None:
    """New namespaces for this process (those of `CLONE_NEWPID` for its children). OSError if the kernel refuses."""
    _check(_libc.unshare(flags), "unshare")


def mount(source: str, target: str, kind: str | None, flags: int, options: str | None = None) -> None:
    """mount(2); OSError if the kernel refuses."""
    parts = [None if part is None else part.encode() for part in (source, target, kind)]
    _check(_libc.mount(*parts, ctypes.c_ulong(flags), None if options is None else options.encode()), f"mount {target}")


def drop_capabilities() -> None:
    """None left, and none to be had again by any call."""
    for capability in range(64):
        if _libc.prctl(_PR_CAPBSET_DROP, capability, 0, 0, 0) != 0:
            break  # the last that this kernel knows
    _libc.prctl(_PR_CAP_AMBIENT, _PR_CAP_AMBIENT_CLEAR_ALL, 0, 0, 0)
    header = struct.pack("=Ii", _CAPABILITY_VERSION_3, 0)
    _check(_libc.capset(header, bytes(24)), "capset")
    _check(_libc.prctl(_PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0), "no_new_privs")


def hide_memory() -> None:
    """No other process of this user may read or write this one's memory."""
    _check(_libc.prctl(_PR_SET_DUMPABLE, 0, 0, 0, 0), "dumpable")


def filter_calls(program: bytes) -> None:
    """From here on only the system calls that the BPF `program` allows."""

    class Program(ctypes.Structure):
        _fields_ = (("length", ctypes.c_ushort), ("filter", ctypes.c_void_p))

    steps = ctypes.create_string_buffer(program, len(program))
    whole = Program(len(program) // _FILTER_STEP, ctypes.addressof(steps))
    _check(_libc.prctl(_PR_SET_SECCOMP, _SECCOMP_MODE_FILTER, ctypes.byref(whole), 0, 0), "seccomp")


def limit(which: int, most: int, beyond: int = 0) -> None:
    """A resource limit, soft, and hard `beyond` that; lower where the hard limit is lower already."""
    _, hard = resource.getrlimit(which)
    soft, most = (each if hard == resource.RLIM_INFINITY else min(each, hard) for each in (most, most + beyond))
    resource.setrlimit(which, (soft, most))


def _check(answer: int, what: str) -> None:
    if answer != 0:
        number = ctypes.get_errno()
        raise OSError(number, f"{what}: {os.strerror(number)}")
