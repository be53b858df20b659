"""Open-loop simulation: takes a dataset, a vehicle and a parameter set, gives the channels as logs would have them.

`simulator` is the way in; `parameter_set` is one simulated car, `measurement_model` and `sensors` are what the logs
show of it, `excitation` says which segments can show a difference, `replay`, `initial_state` and `substeps` run them.
"""
