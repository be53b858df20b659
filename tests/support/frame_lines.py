"""Frames as lines of text, so that a test can name every one of them in full."""

from hil.log.frames import FrameFlag

WORDS = {
    FrameFlag.FD: "FD",
    FrameFlag.BIT_RATE_SWITCH: "BRS",
    FrameFlag.ERROR_STATE: "ESI",
    FrameFlag.SENT: "sent",
}


def lines_of(frames):
    """``seconds channel id#data words``; a remote frame is ``id#Rlength``, an error frame ``error id#data``."""
    columns = (frames.time_ns, frames.channel, frames.can_id, frames.extended, frames.length, frames.flags)
    return [
        _line(time_ns, frames.channels[channel], can_id, extended, data[:length].tobytes(), flags)
        for time_ns, channel, can_id, extended, length, flags, data in zip(
            *(column.tolist() for column in columns), frames.data, strict=True
        )
    ]


def _line(time_ns, channel, can_id, extended, data, flags):
    seconds, rest = divmod(time_ns, 10**9)
    held = data.hex().upper()
    if flags & FrameFlag.REMOTE:
        assert not any(data)
        held = f"R{len(data)}"
    identifier = f"{can_id:08X}" if extended else f"{can_id:03X}"
    kind = ["error"] if flags & FrameFlag.ERROR else []
    words = [word for flag, word in WORDS.items() if flags & flag]
    return " ".join([f"{seconds}.{rest:09d}", channel, *kind, f"{identifier}#{held}", *words])
