"""Takes what is to break and when, and gives values and nodes that do so, deterministic by seed: one family a file.

`catalogue` lists all faults; `wire` is how they travel on the bench bus; `line` is where they act: between a node and
its buses, in virtual and in real time. `frames` makes valid frames for scripts of one's own.
"""
