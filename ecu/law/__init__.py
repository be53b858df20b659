"""The pure control law; no CAN word in it."""
