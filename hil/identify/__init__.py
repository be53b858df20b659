"""Takes records of a brake dynamometer and gives the paper's pad friction model (Figures 3 to 5), with intervals.

`record` reads a dynamometer's CSV, `model` integrates equations (3) and (4), `fit` finds their five parameters,
`uncertainty` says how well, `validation` predicts another record, `coverage` checks the intervals on records whose
truth is known, `study` puts all of it together and `summary` and `files` hand it to people and programs.
`dyno` makes the shipped synthetic records from a different, richer brake.
"""
