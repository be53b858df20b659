"""ASAM MDF 4 bus logs (MF4) through asammdf, whole columns at once.

asammdf is an extra (``pip install brakebench[mdf]``). python-can's writer is not used: it counts time from the moment
of writing and appends frame by frame.
"""

import logging
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from hil.log.frames import FD_CODES, FrameBuilder, FrameFlag, FrameTable, LogError, Recording

KINDS = ("CAN_DataFrame", "CAN_RemoteFrame", "CAN_ErrorFrame")
FLAG_FIELDS = {"EDL": FrameFlag.FD, "BRS": FrameFlag.BIT_RATE_SWITCH, "ESI": FrameFlag.ERROR_STATE}
KIND_FLAGS = (FrameFlag(0), FrameFlag.REMOTE, FrameFlag.ERROR)
CODE_OF = np.zeros(65, np.uint8)
CODE_OF[list(FD_CODES)] = range(16)


def _asammdf(path: Path) -> Any:
    try:
        import asammdf
    except ImportError as error:
        raise LogError(path, "MF4 needs the package asammdf; install it with: pip install 'brakebench[mdf]'") from error
    return asammdf


def read_mdf(path: Path) -> Recording:
    """Read the CAN frames of an MF4 bus log, ordered by time over its groups.

    Raises
    ------
    LogError
        When asammdf is missing or cannot read the file.
    """
    asammdf = _asammdf(path)
    if path.read_bytes()[:3] not in (b"MDF", b"UnF"):
        raise LogError(path, "no MDF file: expected the signature MDF", 0)
    found: list[tuple[int, str, int, bool, bytes, FrameFlag, int]] = []
    logging.getLogger("asammdf").setLevel(logging.CRITICAL + 1)  # its tracebacks would stand beside our one message
    try:
        with asammdf.MDF(path) as mdf:
            start_ns = round(mdf.header.start_time.timestamp() * 1e6) * 1000
            groups = 0
            for number, group in enumerate(mdf.groups):
                names = {channel.name for channel in group.channels}
                for kind, flags in zip(KINDS, KIND_FLAGS, strict=True):
                    if kind in names and group.channel_group.cycles_nr:
                        found += _frames(mdf.get(kind, number, raw=False), kind, flags, start_ns)
                        groups += 1
    except LogError:
        raise
    except Exception as error:  # asammdf raises whatever a damaged block trips it into
        problem = (str(error).splitlines() or [""])[0] or type(error).__name__
        raise LogError(path, f"asammdf cannot read it: {problem}") from error
    if groups > 1:
        found.sort(key=lambda frame: frame[0])
    builder = FrameBuilder()
    for row, frame in enumerate(found):
        if not builder.add(*frame):
            builder.reject(row, str(frame))
    return builder.recording(path, "mf4")


def _frames(
    signal: Any, kind: str, kind_flags: FrameFlag, start_ns: int
) -> list[tuple[int, str, int, bool, bytes, FrameFlag, int]]:
    """Frames of one group: time, channel, id, extended, data, flags, length."""
    n = len(signal.timestamps)
    fields = signal.samples.dtype.names or ()

    def column(name: str) -> list[int]:
        return signal.samples[f"{kind}.{name}"].astype(np.int64).tolist() if f"{kind}.{name}" in fields else [0] * n

    time_ns = (start_ns + np.round(signal.timestamps * 1e9).astype(np.int64)).tolist()
    ids, ides, channels = column("ID"), column("IDE"), column("BusChannel")
    lengths = column("DataLength" if f"{kind}.DataLength" in fields and kind != "CAN_RemoteFrame" else "DLC")
    flag_columns = [(column(name), flag) for name, flag in FLAG_FIELDS.items()]
    payload = f"{kind}.DataBytes"
    data = [bytes(row) for row in signal.samples[payload]] if payload in fields else [b""] * n
    found = []
    for row in range(n):
        flags = kind_flags
        for values, flag in flag_columns:
            flags |= flag if values[row] else FrameFlag(0)
        length = min(lengths[row], 64)
        found.append(
            (
                time_ns[row],
                f"can{channels[row]}",
                ids[row] & 0x1FFF_FFFF,
                bool(ides[row]) or bool(ids[row] & 0x8000_0000),
                data[row][:length],
                flags,
                length,
            )
        )
    return found


def write_mdf(frames: FrameTable, path: Path, numbers: list[int]) -> None:
    """Write an MF4 bus log, version 4.10: one group each for data, remote and error frames."""
    asammdf = _asammdf(path)
    from asammdf.blocks.v4_blocks import SourceInformation
    from asammdf.blocks.v4_constants import BUS_TYPE_CAN, SOURCE_BUS

    start_s = int(frames.time_ns.min()) // 10**9 if len(frames) else 0
    remote = (frames.flags & FrameFlag.REMOTE) != 0
    error = (frames.flags & FrameFlag.ERROR) != 0
    with asammdf.MDF(version="4.10") as mdf:
        mdf.header.start_time = datetime.fromtimestamp(start_s, UTC)
        for kind, mask in zip(KINDS, (~remote & ~error, remote, error), strict=True):
            part = frames.take(mask)
            if len(part) or kind == KINDS[0]:
                samples = _samples(part, kind, numbers)
                times = (part.time_ns - start_s * 10**9) / 1e9
                source = SourceInformation(source_type=SOURCE_BUS, bus_type=BUS_TYPE_CAN)
                mdf.append(asammdf.Signal(samples, times, name=kind, source=source))
        mdf.save(path, overwrite=True, compression=1)


def _samples(part: FrameTable, kind: str, numbers: list[int]) -> npt.NDArray[np.void]:
    width = part.data.shape[1]
    layout: list[Any] = [(f"{kind}.BusChannel", "u1"), (f"{kind}.ID", "<u4"), (f"{kind}.IDE", "u1")]
    layout += [(f"{kind}.{name}", "u1") for name in ("DLC", "DataLength", "Dir", *FLAG_FIELDS)]
    if kind != "CAN_RemoteFrame":
        layout.append((f"{kind}.DataBytes", f"({width},)u1"))
    samples = np.zeros(len(part), np.dtype(layout))
    samples[f"{kind}.BusChannel"] = np.array(numbers, np.uint8)[part.channel] if numbers else 0
    samples[f"{kind}.ID"] = part.can_id
    samples[f"{kind}.IDE"] = part.extended
    samples[f"{kind}.DLC"] = CODE_OF[part.length]
    for name, flag in FLAG_FIELDS.items():
        samples[f"{kind}.{name}"] = (part.flags & flag) != 0
    if kind != "CAN_RemoteFrame":
        samples[f"{kind}.DataLength"] = part.length
        samples[f"{kind}.DataBytes"] = part.data
    return samples
