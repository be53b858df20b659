"""What decides whether ticks are on time: scheduling, memory, processors, clock."""

import os
import platform
import resource
from pathlib import Path

from hil.doctor.line import Line, Status, read, write_as_root
from hil.rt.realtime import PRIORITY, realtime_refusal

_CAP_IPC_LOCK = 14  # linux/capability.h
_FAST_CLOCKS = {"tsc", "kvm-clock", "arch_sys_counter", "hyperv_clocksource_tsc_page"}  # read without a system call
_LIMITS = "/etc/security/limits.d/brakebench.conf"


def machine_lines(root: Path = Path("/")) -> list[Line]:
    """Everything about time."""
    return [scheduling_line(root), memory_line(root), processors_line(root), governor_line(root), clock_line(root)]


def scheduling_line(root: Path) -> Line:
    """Try what ``--realtime`` asks for, and give it back."""
    model = next((word for word in platform.version().split() if word.startswith("PREEMPT")), "no preemption")
    refusal = realtime_refusal()
    if refusal:
        return Line("real time", Status.WARNING, f"no SCHED_FIFO ({refusal}); kernel: {model}", _allow_scheduling(root))
    return Line("real time", Status.OK, f"--realtime gets SCHED_FIFO {PRIORITY}; kernel: {model}")


def _allow_scheduling(root: Path) -> str:
    if os.geteuid() == 0:  # root without the capability: a container
        inside = (root / ".dockerenv").exists() or (root / "run/.containerenv").exists()
        return "docker run --cap-add SYS_NICE --cap-add IPC_LOCK IMAGE" if inside else ""
    _, hard = resource.getrlimit(resource.RLIMIT_RTPRIO)
    if hard == resource.RLIM_INFINITY or hard >= PRIORITY:
        return f"ulimit -r {PRIORITY}"
    return f'echo "$USER - rtprio {PRIORITY}" | sudo tee -a {_LIMITS}  # then log in again'


def memory_line(root: Path) -> Line:
    """Whether memory can be locked without a limit."""
    soft, hard = resource.getrlimit(resource.RLIMIT_MEMLOCK)
    effective = next(
        (line.split()[1] for line in read(root / "proc/self/status").splitlines() if line.startswith("CapEff:")), "0"
    )
    if soft == resource.RLIM_INFINITY or int(effective, 16) >> _CAP_IPC_LOCK & 1:
        return Line("locked memory", Status.OK, "no limit")
    finding = f"limited to {soft // 1024} KiB: --realtime leaves memory unlocked"
    if hard == resource.RLIM_INFINITY:
        return Line("locked memory", Status.WARNING, finding, "ulimit -l unlimited")
    fix = f'echo "$USER - memlock unlimited" | sudo tee -a {_LIMITS}  # then log in again'
    return Line("locked memory", Status.WARNING, finding, fix)


def processors_line(root: Path) -> Line:
    """Processors for two nodes and a recorder, and who else wants them."""
    count = len(os.sched_getaffinity(0))
    load = os.getloadavg()[0]
    finding = f"{count}, load {load:.1f}"
    wrong = []
    if count < 2:
        wrong.append("plant and ECU share one: expect late ticks")
    quota, _, period = read(root / "sys/fs/cgroup/cpu.max").partition(" ")
    if quota.isdigit() and period.isdigit():
        wrong.append(f"this group may use {int(quota) / int(period):g} of them and is halted beyond")
    if load > count:
        wrong.append("others keep them busy: expect late ticks")
    return Line("processors", Status.WARNING if wrong else Status.OK, "; ".join([finding, *wrong]))


def governor_line(root: Path) -> Line:
    """Whether processors clock down in the pauses between ticks."""
    folder = root / "sys/devices/system/cpu"
    found = sorted({read(path) for path in folder.glob("cpu[0-9]*/cpufreq/scaling_governor")} - {""})
    if not found:
        return Line("governor", Status.OK, "none: frequencies are not ours to set (virtual machine?)")
    if found == ["performance"]:
        return Line("governor", Status.OK, "performance")
    fix = write_as_root("performance", "/sys/devices/system/cpu/cpu*/cpufreq/scaling_governor")
    return Line("governor", Status.WARNING, f"{', '.join(found)}: slower wake-ups after each pause", fix)


def clock_line(root: Path) -> Line:
    """Whether time is read without a system call."""
    folder = root / "sys/devices/system/clocksource/clocksource0"
    source, available = read(folder / "current_clocksource"), read(folder / "available_clocksource").split()
    if source in _FAST_CLOCKS:
        return Line("clock source", Status.OK, source)
    better = next((name for name in available if name in _FAST_CLOCKS), None)
    fix = write_as_root(better, "/sys/devices/system/clocksource/clocksource0/current_clocksource") if better else ""
    return Line("clock source", Status.WARNING, f"{source or 'unknown'}: every reading is a system call", fix)
