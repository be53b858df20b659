"""What a real car has and the baseline has not: one physical cause a file, neutral by default."""
