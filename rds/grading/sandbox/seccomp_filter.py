"""Which system calls are left, as BPF programs for the kernel, made by libseccomp through pyseccomp.

A submission gets those that arithmetic, files in its own /tmp, threads and children need (`ALLOWED`); every other one
fails with EPERM, those of kernels to come included. The warm interpreter, which runs no submission's code, is denied
what it has no use for (`DENIED`): the second wall should the first one fall.
"""

from __future__ import annotations

import errno
import tempfile
from functools import lru_cache

# Nothing that other submissions could notice: no locks, which are on a file wherever it is mounted, no times, which
# devices keep when the sandbox is gone, not how much room there is on the computer's disks, and not whether a page of a
# file is in memory (preadv2).
_FILES = """
    read readv pread64 preadv write writev pwrite64 pwritev open openat close close_range lseek
    stat fstat lstat newfstatat statx access faccessat faccessat2 readlink readlinkat getcwd chdir fchdir
    mkdir mkdirat rmdir unlink unlinkat rename renameat renameat2 getdents getdents64 ftruncate truncate fallocate fsync
    fdatasync umask dup dup2 dup3 pipe pipe2 select pselect6 poll ppoll
"""
_MEMORY = "munmap mprotect mremap msync brk membarrier"
_PROCESSES = """
    rt_sigprocmask rt_sigreturn rt_sigpending rt_sigsuspend rt_sigtimedwait sigaltstack pause alarm
    setitimer getitimer kill tkill tgkill restart_syscall
    fork vfork wait4 waitid exit exit_group futex futex_waitv set_robust_list get_robust_list set_tid_address rseq
    arch_prctl getpid getppid gettid getuid geteuid getgid getegid getresuid getresgid getgroups getpgid getpgrp getsid
    setsid setpgid capget sched_yield sched_getaffinity sched_getparam sched_getscheduler sched_get_priority_max
    sched_get_priority_min getpriority getcpu
"""
_SYSTEM = """
    nanosleep clock_nanosleep clock_gettime clock_getres gettimeofday time times getrusage getrlimit sysinfo uname
    getrandom
"""
ALLOWED = tuple(f"{_FILES} {_MEMORY} {_PROCESSES} {_SYSTEM}".split())

_TAMPERING = """
    ptrace process_vm_readv process_vm_writev process_madvise pidfd_getfd kcmp perf_event_open userfaultfd bpf
    move_pages migrate_pages mbind set_mempolicy vmsplice
"""
_ADMINISTRATION = """
    keyctl add_key request_key io_uring_setup io_uring_enter io_uring_register kexec_load kexec_file_load reboot
    init_module finit_module delete_module swapon swapoff acct quotactl open_by_handle_at name_to_handle_at syslog
    personality iopl ioperm settimeofday clock_settime adjtimex clock_adjtime sethostname setdomainname fanotify_init
    nfsservctl lookup_dcookie vhangup uselib ustat
"""
DENIED = tuple(f"{_TAMPERING} {_ADMINISTRATION}".split())

_NEW_NAMESPACES = 0x7E020080  # all CLONE_NEW* bits: time, mount, cgroup, uts, ipc, user, pid, net
# Not among them what makes a descriptor wait: the bells are shared, and the grader must never wait at one.
_ASKS = (0x5401, 0x541B, 0x5450, 0x5451)  # ioctl: TCGETS, FIONREAD, FIONCLEX, FIOCLEX
_DUPLICATES = (0, 1, 2, 3, 1030)  # fcntl: duplicate, flags (F_SETFL is not here)
# mmap: private memory, or a file's; shared memory without a file would be in no sum once it is out of sight (madvise)
# and huge pages (MAP_HUGETLB) are in no process's resident size
_MAPPINGS = ((0x4000F, 0x02), (0x4002F, 0x01))  # mask of its flags, and what they must be under it
# madvise: what allocators and stacks use. Not MADV_MERGEABLE: pages that the kernel joins with those of others take
# another time to write, by which others can be noticed
_ADVICE = (*range(5), 8, *range(14, 20), 102, 103)
_CHILD = 17  # SIGCHLD: who ignores it has children whose computing time the kernel adds to nobody's
_SIGNAL_BITS = tuple(1 << k for k in range(7))  # of 1 to 64
_NAMES_ITSELF = (15, 16)  # prctl: PR_SET_NAME, PR_GET_NAME


@lru_cache
def submission_filter() -> bytes:
    """For the process that runs a submission, as BPF."""
    import pyseccomp as seccomp

    calls = seccomp.SyscallFilter(seccomp.ERRNO(errno.EPERM))
    for name in ALLOWED:
        _add(calls, seccomp.ALLOW, name)
    # clone3 hides its flags from a filter; told that it does not exist, the C library uses clone
    _add(calls, seccomp.ERRNO(errno.ENOSYS), "clone3")
    calls.add_rule(seccomp.ALLOW, "clone", seccomp.Arg(0, seccomp.MASKED_EQ, _NEW_NAMESPACES, 0))
    for mask, flags in _MAPPINGS:
        calls.add_rule(seccomp.ALLOW, "mmap", seccomp.Arg(3, seccomp.MASKED_EQ, mask, flags))
    for advice in _ADVICE:
        calls.add_rule(seccomp.ALLOW, "madvise", seccomp.Arg(2, seccomp.EQ, advice))
    for number in _ASKS:
        calls.add_rule(seccomp.ALLOW, "ioctl", seccomp.Arg(1, seccomp.EQ, number))
    for number in _DUPLICATES:
        calls.add_rule(seccomp.ALLOW, "fcntl", seccomp.Arg(1, seccomp.EQ, number))
    for bit in _SIGNAL_BITS:  # a bit that is not SIGCHLD's; the kernel looks at the lower half of what is given only
        calls.add_rule(seccomp.ALLOW, "rt_sigaction", seccomp.Arg(0, seccomp.MASKED_EQ, bit, ~_CHILD & bit))
    for number in _NAMES_ITSELF:
        calls.add_rule(seccomp.ALLOW, "prctl", seccomp.Arg(0, seccomp.EQ, number))
    calls.add_rule(seccomp.ALLOW, "prlimit64", seccomp.Arg(0, seccomp.EQ, 0))  # its own; they can only go down
    return _exported(calls)


@lru_cache
def warm_filter() -> bytes:
    """For the warm interpreter and all below it, as BPF."""
    import pyseccomp as seccomp

    calls = seccomp.SyscallFilter(seccomp.ALLOW)
    for name in DENIED:
        _add(calls, seccomp.ERRNO(errno.EPERM), name)
    return _exported(calls)


def _add(calls: object, action: int, name: str) -> None:
    import pyseccomp as seccomp

    try:
        number = seccomp.resolve_syscall(seccomp.system_arch(), name)
    except (ValueError, OSError):
        return  # another architecture's
    if number >= 0:  # negative: known to libseccomp, but not on this architecture
        calls.add_rule(action, name)  # type: ignore[attr-defined]


def _exported(calls: object) -> bytes:
    with tempfile.TemporaryFile() as file:
        calls.export_bpf(file)  # type: ignore[attr-defined]
        file.seek(0)
        return file.read()
