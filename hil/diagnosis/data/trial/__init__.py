"""Inputs on trial, before any fit: every channel's unit, sign, scale and stamp against the others and physics.

`run.on_trial` takes logs and numbers of the car, refuses what can only be wrong, and gives the logs with the lags it
saw. `motion` makes comparable quantities, `agreement` compares two of them; `scales` (speeds, accelerations),
`lateral`, `forces` (pressures, torques) and `stamps` hold the rules.
"""
