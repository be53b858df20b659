"""Effects put into the model: their numbers in one vector, their equations called at the injection points.

Takes the effects as values (`plant.effects.catalogue`), terms nobody has listed (`bank`) and effects from outside
(`plugin`). Gives the model the four calls of `apply` (begin, row, before, after), everybody else the vector theta
(`theta`) and what the sensors make of the signals (`sensing_chain`). Imports `plant.effects` and the model's vocabulary
(vectors, injection points); of the model only the equations, the integrators and what is above them import it.
"""
