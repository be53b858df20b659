"""What a log holds, in memory that does not grow with it."""
