"""Takes log files of several formats and gives frames and decoded signals as columns, and the way back."""
