"""Identifiers of the diagnostic frames on the vehicle bus, beside those of brake.dbc; 11 bits, 8 bytes of data each."""

REQUEST = 0x7A0
"""Requests to the brake controller alone (physical addressing), and flow controls of what it answers."""
RESPONSE = 0x7A8
"""Its answers, and flow controls of what it is asked."""
PERIODIC = 0x7A9
"""Measured values by ReadDataByPeriodicIdentifier, one a frame, without ISO-TP."""
REQUEST_FUNCTIONAL = 0x7DF
"""Requests to every controller (functional addressing), in single frames only; the usual one of ISO 15765-4."""

REQUESTS = (REQUEST, REQUEST_FUNCTIONAL)
ANSWERS = (RESPONSE, PERIODIC)
FRAME_BYTES = 8
PADDING = 0xCC  # ISO 15765-2: the value that needs the fewest stuff bits
