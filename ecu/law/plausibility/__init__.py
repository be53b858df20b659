"""Takes the sensors' values and what was asked of the actuators, and gives what does not agree with the rest.

One sample at a time, before anything uses it: what cannot be is left out at once, and is a fault once it has been so
for long enough (`ecu.law.debounce`). Nothing of it may make the brake give less than the driver asks.
"""
