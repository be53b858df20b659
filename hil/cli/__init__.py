"""Takes a command line and gives an exit code: one command a file."""
