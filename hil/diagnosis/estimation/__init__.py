"""Fits: candidates, the linear problem, non-linear steps, and how much the model itself errs."""
