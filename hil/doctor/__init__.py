"""Takes this machine and gives what it can do for the bench, and the exact command for what it lacks."""
