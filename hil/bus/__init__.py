"""Buses behind one protocol."""
