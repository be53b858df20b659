"""Estimation: takes residuals, their noise and a simulator; gives fitted nuisances and terms with their information."""
