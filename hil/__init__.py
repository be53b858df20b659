"""The rig: time, buses, processes, faults, logs, reports and the command line."""
