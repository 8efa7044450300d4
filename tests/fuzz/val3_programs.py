"""VAL3 applications written by a seed, as a project keeps them: points and code in one text."""

from __future__ import annotations

from written import Job, Pen

from robotrue.core.units import DEG, MM

PIECES = [
    *(b"<Value ", b"/>", b"</Data>", b'x="', b'rx="1"', b"fatherId=", b"<!--", b"-->", b"]]>"),
    *(b"movel(", b"movec(p[0],", b"p[nI]", b"tMill", b"appro(", b"link(p,f)", b"call a()", b"&lt;"),
    *(b'"', b"'", b"\n", b"<", b">", b"&", b"[", b"]", b"1E9", b"//", b"\xff", b"\x00"),
]


def val3(pen: Pen) -> Job:
    """A job of a few points in two frames, with their motions."""
    names = [f"p{key}" for key in range(pen.whole(2, 12))]
    lines = ["<Programs xmlns='http://www.staubli.com/robotics/VAL3/Program/2'>"]
    lines += _data("frame", "f", f"{_pose(pen)} fatherId='world[0]'")
    lines += _data("tool", "t", f"{_pose(pen)} fatherId='flange[0]'")
    for name in names:
        father = pen.pick("f[0]", "world[0]", "lost[0]")
        lines += _data("pointRx", name, f"{_pose(pen)} shoulder='lefty' fatherId='{father}'")
    lines += ["<Program name='a'><Code><![CDATA[begin"]
    for name in names:
        lines += [_move(pen, name)]
    lines += ["end]]></Code></Program>", "</Programs>"]
    fine = 0.5 * 10.0**-pen.turns * DEG
    return Job(
        files=(("job.pgx", pen.encode(lines, mark=False)),),
        place=0.5 * 10.0**-pen.decimals * MM,
        turn=3.0 * fine,
        bend=fine,
    )


def _data(kind: str, name: str, value: str) -> list[str]:
    return [f"<Data name='{name}' type='{kind}' size='1'>", f"  <Value {value} />", "</Data>"]


def _pose(pen: Pen) -> str:
    values = [pen.place() for _ in range(3)] + [pen.angle() for _ in range(3)]
    names = ("x", "y", "z", "rx", "ry", "rz")
    return " ".join(f"{name}='{value}'" for name, value in zip(names, values, strict=True))


def _move(pen: Pen, name: str) -> str:
    kind = pen.whole(0, 9)
    if kind <= 5:
        return f"move{pen.pick('l', 'j')}({name},t,mNom)"
    if kind == 6:
        return f"nId=movec({name},p0,t,mNom) // x"
    if kind == 7:
        return f"movel(appro({name},{{0,0,-5,0,0,0}}),t,mNom)"
    return pen.pick("waitEndMove()", "open(t)", 'putln("movel(p0,t,m)")', f"{name}.trsf.x=1")
