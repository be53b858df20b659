"""Vehicle sets in, a `spec.Vehicle` out: parameters of the plant, and nuisance parameters with their priors.

`load` reads a set by its `keys`, `priors` gives the nuisances, `extension_file` keeps what a diagnosis adds to the car.
"""
