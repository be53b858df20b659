"""Hidden cars unlike the plant and unlike each other, as strangers write them who know the pages on sets and columns.

They are what `explain` is judged by on a car it was never tuned to (`car` says what a car must offer).
"""
