"""Takes a seed and effects to hide and gives logs of a second car, independent of the engine's own plant.

Another vehicle model, another integrator and other sensors: it shares nothing with `plant`, `ecu` and the diagnosis.
"""
