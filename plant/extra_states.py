"""Extra states that effects add to the vehicle; all start at 0 and stay there while no effect uses them."""

from plant.compiled import EFFECTS

PLUGIN_STATES = 8

_STATES = {
    "hub_m": 4,  # fore-aft travel of the hub
    "hub_rate_mps": 4,
    "tread_heat_k": 4,  # warming of the tread over the road
    "play_pa": 4,  # where the caliper's friction has come to rest
    "taken_up_pa_s": 4,  # pressure over time spent on closing the gap
    "applied_s": 4,  # time since the brake was applied
    "braked_s": 4,  # time with the brake applied, in total
    "brake_heat_j": 4,  # work of the friction brake
    "caliper_pa": 4,  # pressure behind the line
    "handed_nm": 4,  # motor torque that the pressure control has answered
    "drawn": 1,  # share of the accumulator that is used up
    "plugin": PLUGIN_STATES,  # of effects from outside
}
EXTRA_STATES = _STATES if EFFECTS else {}
