"""The controller: pure control law and its node. No I/O in here."""
