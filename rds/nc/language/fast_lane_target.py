"""What the fast lane's machine code is made for, and the names by which it is entered."""

from __future__ import annotations

import sys

from llvmlite import binding as llvm

ENTRIES = ("rds_read_lines", "rds_write_rows")


def target_machine() -> llvm.TargetMachine:
    """What code is made for and loaded by: this machine's processor, addresses in full (objects may lie far apart)."""
    triple = llvm.get_process_triple() + ("-elf" if sys.platform == "win32" else "")  # as numba has it
    return llvm.Target.from_triple(triple).create_target_machine(
        cpu=llvm.get_host_cpu_name(),
        features=llvm.get_host_cpu_features().flatten(),
        opt=3,
        reloc="static",
        jit=True,
    )
