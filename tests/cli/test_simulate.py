"""``robotrue simulate``: what it prints, that it ends, and what it refuses."""

import pytest

from robotrue.errors import ConfigurationError
from robotrue.online.rdt import parse_netftapi, parse_rate
from robotrue.simulation.online_faults import Fault, FaultKind, parse_fault, showing


@pytest.mark.parametrize("kind", ["rsi", "egm", "rtde", "rdt"])
def test_it_ends_with_figures(cli, kind):
    port = "49777" if kind in ("rsi", "egm") else "0"
    found = cli("simulate", kind, "--port", port, "--seconds", "0.2", "--json")
    assert found.code == 0
    assert found.document["simulated"]
    assert found.document["seconds"] >= 0.2
    assert found.err.startswith("SIMULATED ")
    assert f"{kind}://127.0.0.1:" in found.err


def test_the_scale_of_the_simulated_sensor(cli, tmp_path):
    page = tmp_path / "netftapi2.xml"
    found = cli(
        "simulate", "rdt", "--port", "0", "--rate", "500", "--scale", str(page), "--seconds", "0.1"
    )
    assert found.code == 0
    assert "SIMULATED ATI force sensor" in found.out
    assert parse_rate(page.read_bytes()) == 500.0
    assert parse_netftapi(page.read_bytes()).newton == pytest.approx(1e-6)
    assert f"scale={page}&rate=500Hz" in found.err


def test_what_hangs_on_the_simulated_sensor_is_weighed(cli, tmp_path):
    poses = str(tmp_path / "poses.csv")
    arguments = ("rdt", "--port", "0", "--poses", poses, "--seconds", "0.1")
    assert cli("simulate", *arguments).code == 0
    found = cli("dynamics", "sensor", poses, "--json").document
    assert found["mass_kg"] == pytest.approx(8.0, abs=0.01)
    assert found["centre_mm"] == pytest.approx([120.0, 0.0, 60.0], abs=0.5)
    assert found["condition"] < 3.0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("rdt", "--fault", "nan@1"), "fault 'nan@1', expected KIND@START_S+DURATION_S with one"),
        (("rtde", "--fault", "gap"), "fault 'gap', expected"),
        (("rtde", "--robot", "GP225"), "no scenario for"),
        (("rsi", "--mode", "sum"), "mode 'sum', expected relative or absolute"),
        (("rsi", "--cycle-ms", "8"), "cycle of 8 ms"),
        (("egm", "--robotware", "5"), "robotware '5', expected 6 or 7"),
        (("rdt", "--device", "nano"), "device 'nano', expected net or axia"),
        (("rdt", "--rate", "20000"), "20000 records per second, expected 1 to 10000"),
        (("rdt", "--seconds", "0"), "0 seconds, expected more than none"),
    ],
)
def test_refused(cli, arguments, message):
    found = cli("simulate", *arguments)
    assert found.code == 1
    assert message in found.err
    assert "Traceback" not in found.err


def test_faults_by_their_text():
    fault = parse_fault("gap@10+0.5", (FaultKind.GAP,))
    assert fault == Fault(kind=FaultKind.GAP, start=10.0, duration=0.5)
    assert [showing([fault], FaultKind.GAP, t) for t in (9.9, 10.0, 10.4, 10.5)] == [
        False,
        True,
        True,
        False,
    ]
    assert not showing([fault], FaultKind.HANG, 10.2)
    assert parse_fault("gap@0", (FaultKind.GAP,)).duration == 0.5
    for text in ("gap@-1", "gap@0+0", "gap@x", "gap@inf", "hang@1"):
        with pytest.raises(ConfigurationError):
            parse_fault(text, (FaultKind.GAP,))
