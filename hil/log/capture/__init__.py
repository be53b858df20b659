"""Packet captures with CAN frames: pcap and pcapng."""
