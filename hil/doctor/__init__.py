"""What this machine can do for the bench, and the exact command for what it lacks."""
