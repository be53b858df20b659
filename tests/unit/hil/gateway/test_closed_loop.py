"""Plant and controller behind a gateway each, somebody else's database between them: the stop is the same."""

import re

import pytest

from dbc.bench_messages import ManoeuvreState, TruthEnergy, TruthMotion
from dbc.contract import contract, database_text, spec_of
from dbc.frame import BusName
from hil.bench.virtual import own_nodes, simulate
from hil.gateway.gateway import BehindGateway
from hil.gateway.map import load_map
from hil.scenario.scenario import load_scenario

TRUTH = {spec_of(kind).can_id: spec_of(kind) for kind in (TruthMotion, TruthEnergy)}
PROTECTION = "protection = { profile = 2, data_ids = [%d, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15] }"


def their_database():
    """Our own, without what says how it is protected."""
    return re.sub(r'BA_ "E2E\w+" .*\n', "", database_text(BusName.VEHICLE))


def map_of(senders, folder):
    """Map of who plays these senders: their messages become theirs, all others become ours."""
    lines = ['dbc = "their.dbc"']
    for spec in contract(BusName.VEHICLE).by_id.values():
        mine = spec.sender in senders
        lines += [f"[{'send' if mine else 'receive'}.{spec.name}]", PROTECTION % (spec.can_id % 256)]
        lines.append(f"[send.{spec.name}.signals]" if mine else f"[ours.{spec.name}]")
        for field in spec.fields:
            none = "" if field.sna is None else f", none = {field.sna}"
            key, source = (field.signal, field.name) if mine else (field.name, f"{spec.name}.{field.signal}")
            lines.append(f'{key} = {{ from = "{source}", scale = {field.si_per_unit!r}{none} }}')
    (folder / "their.dbc").write_text(their_database())
    path = folder / f"{senders[0]}.toml"
    path.write_text("\n".join(lines))
    return load_map(path)


def stop(scenario, **nodes):
    """Truth at the end of a run: motion and energy."""
    truth = {}

    def look(step):
        for frame in step.frames:
            if frame.bus is BusName.BENCH and frame.can_id in TRUTH:
                truth[frame.can_id] = TRUTH[frame.can_id].decode(frame.data)

    simulate(scenario, each_tick=look, **nodes)
    return [truth[can_id] for can_id in TRUTH]


@pytest.mark.slow
def test_a_stop_through_two_gateways(tmp_path):
    scenario = load_scenario("stop72_blend50")
    plant, ecu = own_nodes(scenario, 1)
    motion, energy = stop(
        scenario,
        plant=BehindGateway(plant, map_of(("EHB", "IWM", "BATTERY", "SENSORS", "DRIVER"), tmp_path)),
        ecu=BehindGateway(ecu, map_of(("ECU",), tmp_path), phase_ns=5_000_000),
    )
    plain_motion, plain_energy = stop(scenario)
    print(f"{plain_motion.distance_m:.2f} m, through two gateways {motion.distance_m:.2f} m")
    assert motion.manoeuvre is plain_motion.manoeuvre is ManoeuvreState.FINISHED
    assert motion.distance_m == pytest.approx(plain_motion.distance_m, rel=0.005)
    assert energy.recuperated_j == pytest.approx(plain_energy.recuperated_j, rel=0.01)
