"""Takes the paper's manoeuvres and gives its claims and figures, regenerated."""
