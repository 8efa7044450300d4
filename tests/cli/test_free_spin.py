"""``robotrue compensate --free-spin``: the tool turns about its axis and nothing else moves."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from robotrue.core.rotations import matrix_from_abc

NUMBER = re.compile(rb"[-+]?\d+\.?\d*")
HEAD = """DEF round()
$BASE={X 1000,Y 0,Z 500,A 0,B 0,C 0}
$TOOL={X 120,Y 0,Z 200,A 0,B 90,C 0}
"""


def rounds(n: int = 60) -> bytes:
    """Once around, the spindle across axis 6, written with one fixed spin."""
    rows = [HEAD]
    for k in range(n):
        turn = 2.0 * np.pi * k / (n - 1)
        x, y = 250.0 * np.cos(turn), 250.0 * np.sin(turn)
        word = "LIN" if k else "PTP"
        rows.append(f"{word} {{X {x:.3f},Y {y:.3f},Z 0.000,A 0.000,B 180.000,C 0.000}}\n")
    return "".join([*rows, "END\n"]).encode()


def targets(data: bytes) -> tuple[np.ndarray, np.ndarray]:
    """X, Y, Z in mm and the tool axis of every target."""
    rows = [row for row in data.split(b"\n") if row.startswith((b"LIN", b"PTP"))]
    values = np.array([[float(v) for v in NUMBER.findall(row)] for row in rows])
    return values[:, :3], matrix_from_abc(np.deg2rad(values[:, 3:]))[:, :, 2]


def test_off_by_default_and_on_request(cli, work: Path) -> None:
    (work / "r.src").write_bytes(rounds())
    (work / "f.toml").write_text('[[force]]\naxes = "path"\nforce_N = [-40, 120, -60]\n')
    said = []
    for name, options in (("a.src", ()), ("b.src", ("--free-spin",))):
        got = cli("compensate", work / "model.rtm", work / "r.src", "-o", work / name, "--json",
                  "--start", "0,-80,80,0,40,0", "--allow-steps",
                  "--force", work / "f.toml", "--cutter", "z", *options)  # fmt: skip
        assert got.code == 0, got.err
        said.append(got)
    assert "free_spin" not in said[0].document
    won = said[1].document["free_spin"]
    assert won["targets_turned"] > 0
    assert won["deflection_across_feed_um"]["after"]["mean"] > 0.0
    assert "predicted stiffness along the force" in said[1].err
    source = (work / "r.src").read_bytes()
    assert NUMBER.sub(b"#", (work / "b.src").read_bytes()) == NUMBER.sub(b"#", source)
    (p0, z0), (p1, z1) = targets(source), targets((work / "b.src").read_bytes())
    assert np.abs(p1 - p0).max() < 3.0  # compensated, mm
    assert np.degrees(np.arccos(np.clip((z0 * z1).sum(axis=1), -1.0, 1.0))).max() < 0.3
    assert said[1].document["compensated"] >= said[0].document["compensated"]


def test_what_it_cannot_do(cli, work: Path) -> None:
    (work / "r.src").write_bytes(rounds(10))
    got = cli("compensate", work / "cell.toml", work / "r.src", "-o", work / "o.src", "--json",
              "--free-spin")  # fmt: skip
    assert got.code != 0
    assert "asks a calibrated model" in got.fault["message"]
    (work / "f.toml").write_text('[[force]]\naxes = "tool"\nforce_N = [-40, 120, -60]\n')
    got = cli("compensate", work / "model.rtm", work / "r.src", "-o", work / "o.src", "--json",
              "--free-spin", "--force", work / "f.toml")  # fmt: skip
    assert got.code != 0
    assert "is in tool axes" in got.fault["message"]
    assert not (work / "o.src").exists()
