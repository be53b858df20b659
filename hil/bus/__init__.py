"""Buses behind one protocol."""

from hil.bus.bus import BUS_KINDS, Bus, BusError, open_bus, wait
from hil.bus.channel import ChannelClaim, bench_channel, claim_channel

__all__ = ["BUS_KINDS", "Bus", "BusError", "ChannelClaim", "bench_channel", "claim_channel", "open_bus", "wait"]
