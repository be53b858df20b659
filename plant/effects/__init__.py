"""What a real car has and the baseline has not: one physical cause a file, neutral by default, grouped by subsystem.

Takes the model's vocabulary: its flat vectors (`plant.vectors`), its injection points (`plant.injection_points`,
`plant.inject`) and its parameters. Gives values: one `plant.effects.effect.Effect` a file, and all of them in one order
(`plant.effects.catalogue.BUILT_IN`). Knows nothing of how they are switched on, fitted or run: `plant.injection` does
that, and imports this package, never the other way round.
"""
