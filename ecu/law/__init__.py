"""Takes sensor values and gives demands, one step at a time: the pure control law; no CAN word in it."""
