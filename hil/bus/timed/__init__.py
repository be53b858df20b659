"""A CAN bus in virtual time with real timing: frame lengths, arbitration, errors, and what to expect of it.

What is modelled and what is not: docs/bus-timing.md.
"""
