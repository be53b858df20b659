"""Buses behind one protocol."""

from hil.bus.bus import Bus, BusError, wait
from hil.bus.channel import ChannelClaim, bench_channel, claim_channel
from hil.bus.open import BUS_KINDS, open_bus

__all__ = ["BUS_KINDS", "Bus", "BusError", "ChannelClaim", "bench_channel", "claim_channel", "open_bus", "wait"]
