"""A VAL3 project from the command line: inspected, compensated into a folder, compared."""

from __future__ import annotations

from pathlib import Path

START = "0,-80,80,0,40,0"
POINTS = ((1100, 0, 900), (1150, 10, 900), (1150, 60, 920))


def project(folder: Path) -> Path:
    folder.mkdir()
    values = "".join(
        f'      <Value key="{k}" x="{x}.000" y="{y}.000" z="{z}.000" rx="180.000" ry="0.000" '
        f'rz="0.000" shoulder="lefty" elbow="epositive" wrist="wpositive" fatherId="world[0]" />\n'
        for k, (x, y, z) in enumerate(POINTS)
    ).replace('rx="180.000" ry="0.000"', 'rx="0.000" ry="90.000"')
    (folder / "app.dtx").write_text(
        '<Database xmlns="http://www.staubli.com/robotics/VAL3/Data/2">\n  <Datas>\n'
        f'    <Data name="p" type="pointRx" size="3">\n{values}'
        "    </Data>\n  </Datas>\n</Database>\n"
    )
    moves = "\n".join(f"movel(p[{k}],flange,mNom)" for k in range(len(POINTS)))
    (folder / "cut.pgx").write_text(
        '<Programs xmlns="http://www.staubli.com/robotics/VAL3/Program/2">\n'
        f'  <Program name="cut"><Code><![CDATA[begin\n{moves}\nend]]></Code>'
        "</Program>\n</Programs>\n"
    )
    path = folder / "app.pjx"
    path.write_text(
        '<Project xmlns="http://www.staubli.com/robotics/VAL3/Project/3">\n'
        '  <Programs><Program file="cut.pgx" /></Programs>\n'
        '  <Database><Data file="app.dtx" /></Database>\n</Project>\n'
    )
    return path


def test_a_project_is_inspected_compensated_and_compared(cli, work: Path) -> None:
    path, out = project(work / "app"), work / "out"
    out.mkdir()
    seen = cli("inspect", path, "--json")
    assert seen.code == 0
    assert seen.document["dialect"] == "val3"
    assert seen.document["targets"] == 3
    got = cli("compensate", work / "model.rtm", path, "-o", out, "--start", START, "--json")
    assert got.code == 0, got.err
    assert got.document["compensated"] == 3
    assert (out / "app.pjx").read_bytes() == path.read_bytes()
    assert (out / "app.dtx").read_bytes() != (path.parent / "app.dtx").read_bytes()
    before, after = path.parent / "app.dtx", out / "app.dtx"
    sizes = cli("diff", before, after, "--json")
    assert sizes.code == 0
    (file,) = sizes.document["files"]
    assert (file["targets"], file["moved"]) == (3, 3)


def test_points_that_a_routine_is_given_are_compensated(cli, work: Path) -> None:
    path = project(work / "app")
    cut = path.with_name("cut.pgx")
    code = cut.read_text()
    cut.write_text(code.replace("movel(", "call reach(").replace(",flange,mNom)", ",flange)"))
    given = '<Parameter name="x_p" type="pointRx" /><Parameter name="x_t" type="tool" />'
    (path.with_name("reach.pgx")).write_text(
        '<Programs xmlns="http://www.staubli.com/robotics/VAL3/Program/2">\n'
        f'<Program name="reach"><Parameters>{given}</Parameters><Code>begin\n'
        "movel(appro(x_p,{0,0,-50,0,0,0}),x_t,mNom)\nmovel(x_p,x_t,mNom)\nend</Code></Program>\n"
        "</Programs>\n"
    )
    names = '<Program file="cut.pgx" /><Program file="reach.pgx" />'
    path.write_text(path.read_text().replace('<Program file="cut.pgx" />', names))
    (work / "out").mkdir()
    got = cli(
        "compensate", work / "model.rtm", path, "-o", work / "out", "--start", START, "--json"
    )
    assert got.code == 0, got.err
    assert got.document["compensated"] == 3
    assert any("targets computed from it move" in note for note in got.document["notes"])
    plain = cli("inspect", path, "--json").document["notes"]
    assert all(note.startswith("app.dtx:") and "app.dtx: app" not in note for note in plain)
