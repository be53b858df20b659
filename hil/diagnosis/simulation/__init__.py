"""Open-loop simulation: takes a dataset, the vehicle and a parameter set, gives the channels as the logs would have them.

`simulator` is the way in; `parameter_set` is one simulated car, `measurement_model` and `sensors` are what the logs
show of it, `excitation` says which segments can show a difference, `initial_state` and `substeps` how they are run.
"""
