"""Takes a bus by name and gives one protocol to send and receive frames, whatever carries them.

What happens to a bus, bus-off and overflows among it, comes with the frames as link events (`error_frame`).
"""

from hil.bus.bus import Bus, BusError, wait
from hil.bus.channel import ChannelClaim, bench_channel, claim_channel
from hil.bus.open import BUS_KINDS, open_bus

__all__ = ["BUS_KINDS", "Bus", "BusError", "ChannelClaim", "bench_channel", "claim_channel", "open_bus", "wait"]
