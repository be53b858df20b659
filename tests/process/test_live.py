"""The live page in a real browser beside a bench of real processes."""

import json
import os
import signal
import time
from pathlib import Path
from urllib.request import urlopen

import numpy as np
import pytest
from processes import alive, children_of, wait_until

from dbc.frame import BusName, Frame
from hil.bench.result import Signals
from hil.bus.loopback import LoopbackBus

chromium = pytest.importorskip("chromium")  # its websockets is an extra

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(chromium.CHROMIUM is None, reason="no Chromium here (Debian: apt-get install chromium)"),
]
DRIVES = """title = "Downhill with motors and pads, for long"
blending = 0.7
[start]
speed_mps = 13.9
[driver]
pedal = [[0.5, 0.0], [1.0, 0.30]]
[[road]]
start_m = -1000.0
grade = -0.08
[end]
duration_s = 1900.0
"""
LISTED = "typeof store !== 'undefined' && document.querySelectorAll('#trace tbody tr').length > 25"
HOSTILE = """VERSION ""
BU_: <b>A</b>
BO_ 256 STRANGE: 2 A
 SG_ SPEED_OF_IT : 0|16@1+ (0.5,0) [0|0] "<img src=x onerror=alert(1)>" A
CM_ BO_ 256 "<script>document.title='hit'</script>";
VAL_ 256 SPEED_OF_IT 7 "</script><script>document.title='hit'</script>" ;
"""


@pytest.fixture
def live(start, channel, tmp_path):
    """A run that drives and its live page's address: process, folder, address."""
    (tmp_path / "drives.toml").write_text(DRIVES)
    # drawing takes what processor there is: nodes that may be real-time processes are not to wait for it
    process = start("run", "drives.toml", "--live", "--realtime", "--bus", channel, "--out", "out")
    words = tmp_path / "out" / "live.txt"

    def address():
        assert process.poll() is None, process.communicate()
        return words.read_text().strip() if words.exists() else ""

    url = wait_until(address, "the page's address")
    return process, tmp_path / "out", url


def demand(wheel):
    """Torque demanded of a wheel's motor, N m, in the page."""
    return f"store.value('MOTOR_DEMAND_{'FRONT' if wheel[0] == 'F' else 'REAR'}.TORQUE_DEMAND_{wheel}')"


def motor(wheel):
    """Torque of a wheel's motor by its current, N m, as the page draws it."""
    return f"plots[3].traces.find((trace) => trace.name === '{wheel.lower()}').course.last"


def pads(kind, wheel):
    """Pad friction of a wheel, true or estimated, as the page draws it."""
    return f"plots[5].traces.find((trace) => trace.name === '{kind} {wheel}').course.last"


def test_values_move_and_a_fault_from_the_page_is_seen_found_and_on_record(live, tmp_path):
    process, out, url = live
    assert (out / "live.txt").stat().st_mode & 0o077 == 0  # the token is for nobody else
    with chromium.opened(url, tmp_path) as page:
        page.wait(LISTED)
        page.wait("store.now > 3 && byId('mode').textContent === 'NORMAL'")
        page.wait(f"{demand('FL')} < -40 && Math.abs({motor('FL')} / {demand('FL')} - 1) < 0.1")
        assert page.run("plots.length") == 8
        first = page.run("[store.now, store.value('TRUTH_MOTION.DISTANCE')]")
        page.wait(f"store.now > {first[0]} + 1 && store.value('TRUTH_MOTION.DISTANCE') > {first[1]} + 5")
        page.wait("plots[3].traces.every((trace) => trace.course.end > 50)")
        page.wait("parseFloat(byId('load').textContent) > 10")

        page.run("byId('find').focus()")
        page.ask("Input.insertText", text="STEERING.STEERING_WHEEL_ANGLE")
        page.press("Enter", 13)
        page.wait("plots.length === 9 && plots[8].traces[0].course.end > 20")
        page.run("document.querySelector('.remove').click()")
        assert page.run("[plots.length, document.querySelectorAll('#plots figure').length]") == [8, 8]

        # by keyboard alone: open the faults, go to the button, press it
        page.run("document.querySelector('#faultbox summary').focus()")
        page.press("Enter", 13)
        page.wait("byId('faultbox').open")
        page.run("byId('fault-motor_weak').focus()")
        page.press(" ", 32)
        page.wait("byId('fault-motor_weak').getAttribute('aria-pressed') === 'true'")
        weak_at = page.run("store.now")
        page.wait(f"store.now > {weak_at} + 1.5")
        page.wait(f"{demand('FR')} < -40 && Math.abs({motor('FR')} / {demand('FR')} - 1) < 0.1")  # once all is in order
        page.wait(f"{demand('FL')} < -40 && Math.abs({motor('FL')} / {demand('FL')} - 0.5) < 0.1")

        page.run("byId('fault-motor_dead').nextElementSibling.value = 'rl'")
        page.run("byId('fault-motor_dead').click()")
        page.wait("[...document.querySelectorAll('tr.active')].some((r) => r.textContent.includes('motor_rl_failed'))")
        page.wait("byId('mode').textContent === 'DEGRADED'")

        page.run("byId('set-pedal').value = 0.35; byId('set-pedal').oninput()")
        page.wait("Math.abs(store.value('BRAKE_PEDAL.PEDAL_TRAVEL_1') - 35) < 2")
        page.run("byId('set-blending').value = 0; byId('set-blending').oninput()")  # the run sends it, too
        page.wait("store.value('BRAKE_STATUS.BLENDING_FACTOR') === 0")

        # pads of one wheel: true at once, then as the controller finds it and takes more pressure for that wheel
        page.wait(f"Math.abs({pads('true', 'fr')} / {pads('true', 'fl')} - 1) < 0.05")
        page.run("byId('fault-pad_friction').nextElementSibling.value = 'fr'")
        page.run("byId('fault-pad_friction').click()")
        page.wait(f"Math.abs({pads('true', 'fr')} / {pads('true', 'fl')} - 0.5) < 0.05")
        page.wait(f"{pads('estimate', 'fr')} / {pads('estimate', 'fl')} < 0.75")
        page.wait("store.value('EHB_PRESSURE_FRONT.PRESSURE_FR') > 1.3 * store.value('EHB_PRESSURE_FRONT.PRESSURE_FL')")
        page.run("send({ do: 'fault', name: 'no_such', on: 'fl' })")
        page.wait("document.querySelector('#said p.wrong')?.textContent.includes('no_such')")
        assert page.complaints == []
        process.send_signal(signal.SIGINT)
        page.wait("byId('link').textContent === 'ended'")
    process.communicate(timeout=120)

    signals = Signals(out / "recording.log")
    at_s, fault = signals.get("FAULT_COMMAND.FAULT")
    weak_s, dead_s = (at_s[np.flatnonzero(fault == number)[0]] for number in (4, 1))
    t_s, asked_nm = signals.get("MOTOR_DEMAND_FRONT.TORQUE_DEMAND_FL")
    braking = np.maximum(asked_nm[5:], asked_nm[:-5]) < -40.0  # for 50 ms: the motor follows
    for begin_s, end_s, share in ((0.0, weak_s, 1.0), (weak_s + 0.2, dead_s, 0.5)):
        chosen = t_s[5:][braking & (t_s[5:] > begin_s) & (t_s[5:] < end_s)]
        current_s, current_a = signals.get("MOTOR_STATUS_FRONT.CURRENT_FL")
        torque_nm = 1.75 * np.interp(chosen, current_s, current_a)
        assert len(chosen) > 10
        assert np.median(torque_nm / np.interp(chosen, t_s, asked_nm)) == pytest.approx(share, abs=0.07)
    assert signals.get("STIMULUS_DRIVER.PEDAL_TRAVEL")[1][-1] == pytest.approx(0.35, abs=0.01)
    halved_s = at_s[np.flatnonzero(fault == 8)[0]]
    t_s, fr = signals.get("TRUTH_PAD_FRICTION.PAD_FRICTION_FR")
    ratio = fr / signals.get("TRUTH_PAD_FRICTION.PAD_FRICTION_FL")[1]
    assert ratio[t_s < halved_s] == pytest.approx(1.0, abs=0.05)
    assert ratio[t_s > halved_s + 0.02] == pytest.approx(0.5, abs=0.05)
    assert signals.get("TRUTH_PAD_FRICTION.PAD_FRICTION_RR")[1].min() > 0.3
    t_s, estimated = signals.get("BRAKE_ESTIMATE_FRONT.PAD_FRICTION_FR")
    assert estimated[-1] < 0.75 * np.interp(halved_s, t_s, estimated)


def test_a_stopped_or_closed_browser_disturbs_nobody(live, tmp_path):
    process, out, url = live
    log = out / "recording.log"

    def ticks(number):
        before = log.read_text().count(" 020#")
        wait_until(lambda: log.read_text().count(" 020#") >= before + number, f"{number} ticks")

    viewer = children_of(process.pid)["watch"]
    with chromium.opened(url, tmp_path) as page:
        page.wait(LISTED)
        os.kill(page.pid, signal.SIGSTOP)
        try:
            ticks(500)
        finally:
            os.kill(page.pid, signal.SIGCONT)
        now = page.run("store.now")
        page.wait(f"store.now > {now} + 1")  # it goes on with what is new
    ticks(100)
    os.kill(viewer, signal.SIGKILL)
    ticks(200)
    assert process.poll() is None
    process.send_signal(signal.SIGINT)
    said = process.communicate(timeout=120)
    assert process.returncode == 130, said
    assert json.loads((out / "result.json").read_text())["reason"] == "interrupted"


def test_a_strangers_bus_is_shown_and_its_names_are_text(start, channel, tmp_path):
    (tmp_path / "strange.dbc").write_text(HOSTILE)
    process = start("watch", "--bus", channel, "--dbc", "strange.dbc")
    url = process.stderr.readline().strip()
    with LoopbackBus(channel.partition(":")[2], BusName.VEHICLE) as bus, chromium.opened(url, tmp_path) as page:
        for number in range(1_000_000):
            bus.send([Frame(BusName.VEHICLE, 256, number.to_bytes(2, "little")), Frame(BusName.VEHICLE, 99, b"\1")])
            time.sleep(0.02)
            if number > 20 and page.run("typeof store !== 'undefined' && store.value('STRANGE.SPEED_OF_IT') > 20"):
                break
        page.wait("document.querySelectorAll('#trace tbody tr').length === 2")
        shown = page.run("[byId('state').hidden, byId('nobench').hidden, plots.map((p) => p.title).join()]")
        assert shown == [True, False, "STRANGE.SPEED_OF_IT"]
        assert page.run("document.querySelector('figcaption small').textContent") == "<img src=x onerror=alert(1)>"
        assert page.run("[document.title, document.images.length]") == ["brakebench live", 0]
        page.run("send({ do: 'set', name: 'pedal', value: 1 })")
        page.wait("document.querySelector('#said p.wrong')?.textContent.includes('nobody is on the bench bus')")
        assert page.complaints == []
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=60)


@pytest.mark.parametrize("width", [420, 1400])
def test_the_page_fits_and_is_read_by_others_than_eyes(live, tmp_path, width):
    _, _, url = live
    with chromium.opened(url, tmp_path) as page:
        page.wait(LISTED)
        page.size(width, 900)
        page.wait(f"innerWidth === {width}")
        page.run("byId('faultbox').open = true")
        page.wait(f"document.documentElement.scrollWidth <= {width}")
        unnamed = page.run(
            "[...document.querySelectorAll('input, select, button')].filter((one) => !(one.labels?.length || "
            "one.getAttribute('aria-label') || one.textContent.trim())).map((one) => one.outerHTML)"
        )
        assert unnamed == []


def replay(minutes):
    """Give the page's own last message again and again with later times: so much of running, in seconds."""
    return f"""(async () => {{
      const rows = Object.fromEntries(store.last.map((row, m) => [m, row]).filter(([, row]) => row));
      for (let k = 0; k < {minutes} * 60 * 33; k++) {{
        for (const m in rows) {{ rows[m] = [...rows[m]]; rows[m][0] += 0.03; }}
        const three = Object.entries(rows).map(([m, row]) => [m, [row, row, row]]);
        take({{ kind: "data", rows: Object.fromEntries(three) }});
        if (k % 33 === 0) await new Promise((drawn) => setTimeout(drawn, 5));
      }}
      return true;
    }})()"""


def heap(page):
    """Bytes that the page holds after a garbage collection."""
    page.ask("HeapProfiler.collectGarbage")
    return page.ask("Runtime.getHeapUsage")["usedSize"]


def test_the_pages_memory_is_flat(live, tmp_path):
    process, _, url = live
    with chromium.opened(url, tmp_path) as page:
        page.wait(LISTED)
        process.send_signal(signal.SIGINT)
        page.wait("byId('link').textContent === 'ended'")
        page.run(replay(1))
        before = heap(page)
        page.run(replay(3))
        assert heap(page) < before + 2_000_000


@pytest.mark.long
@pytest.mark.timeout(2400)
def test_the_pages_memory_is_flat_for_half_an_hour(live, tmp_path):
    _, _, url = live
    with chromium.opened(url, tmp_path) as page:
        page.wait(LISTED)
        time.sleep(120.0)
        before = heap(page)
        for _ in range(28):
            time.sleep(60.0)
        assert heap(page) < before + 2_000_000
        assert page.complaints == []


def test_a_viewer_that_somebody_stops_ends_at_once(start, channel, tmp_path):
    process = start("watch", "--bus", channel)
    url = process.stderr.readline().strip()
    with urlopen(url) as answer:
        assert b"brakebench live" in answer.read()
    process.send_signal(signal.SIGTERM)
    process.communicate(timeout=60)
    assert process.returncode == 0
    assert not alive(process.pid)
    assert not list(Path(tmp_path).glob("*.log"))
