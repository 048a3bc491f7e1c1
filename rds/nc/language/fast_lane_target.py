"""What the fast lane's machine code is made for, and how llvmlite loads it. Importing this needs llvmlite."""

from __future__ import annotations

from llvmlite import binding as llvm

from rds.nc.language.fast_lane_files import ENTRIES


def target_machine(shared: bool = False) -> llvm.TargetMachine:
    """What code is made for: any processor of this machine's kind.

    `shared`: for a shared library; else with addresses in full, for objects that may lie far apart.
    """
    target = llvm.Target.from_triple(llvm.get_process_triple())
    if shared:
        return target.create_target_machine(opt=3, reloc="pic", codemodel="small")
    return target.create_target_machine(opt=3, reloc="static", jit=True)


def loaded(objects: dict[str, bytes]) -> tuple[int, int, object]:
    """The addresses of the entries of the object files, and what keeps them."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), target_machine())
    for object_file in objects.values():
        engine.add_object_file(llvm.ObjectFileRef.from_data(object_file))
    engine.finalize_object()
    read, write = (engine.get_function_address(name) for name in ENTRIES)
    return read, write, engine
