"""Frames to signals: databases by channel, decoding, J1939, end-to-end protection."""
