"""Diagnostic sessions as frames of a log: what two ends say, segmented by can-isotp's rules in `dbc.isotp`."""

import numpy as np

from dbc.isotp import FlowStatus, flow_control, segment
from hil.log.frames import FrameFlag, FrameTable

MS = 1_000_000
WIDE = 0x7FF


def exchange(request_id, answer_id, request, answer, start_ns, frame_bytes=8, padding=None):
    """Frames (time, id, data) of a request and its answer, each with the other side's flow control."""
    frames, time_ns = [], start_ns
    for sender, receiver, message in ((request_id, answer_id, request), (answer_id, request_id, answer)):
        for k, data in enumerate(segment(message, frame_bytes, padding) if message else ()):
            if k == 1:
                frames.append((time_ns, receiver, flow_control(FlowStatus.CONTINUE)))
                time_ns += MS
            frames.append((time_ns, sender, data))
            time_ns += MS
        time_ns += 9 * MS
    return frames


def table_of(frames, channel="can0"):
    """Table of frames (time, id, data) of one channel; what is longer than 8 bytes is CAN FD."""
    table = FrameTable.empty(len(frames), 64, (channel,))
    for row, (time_ns, can_id, data) in enumerate(frames):
        table.time_ns[row], table.can_id[row], table.extended[row] = time_ns, can_id, can_id > WIDE
        table.length[row] = len(data)
        table.data[row, : len(data)] = np.frombuffer(data, np.uint8)
        table.flags[row] = FrameFlag.FD if len(data) > 8 else 0
    return table


def candump_of(frames, channel="can0", start_s=1_700_000_000):
    """The same as candump's log."""
    lines = []
    for time_ns, can_id, data in frames:
        stamp = f"({start_s + time_ns // 10**9}.{time_ns % 10**9 // 1000:06d})"
        name = f"{can_id:08X}" if can_id > WIDE else f"{can_id:03X}"
        lines.append(f"{stamp} {channel} {name}{'##0' if len(data) > 8 else '#'}{data.hex().upper()}")
    return "\n".join(lines) + "\n"
