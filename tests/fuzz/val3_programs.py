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


def val3_arrays(pen: Pen) -> Job:
    """An application of arrays that its code goes through, in one file or two."""
    data, code = [], []
    data += _data("frame", "f", f"key='0' {_pose(pen)} fatherId='world[0]'")
    data += ["<Data type='tool' name='t'>"]
    data += [f"<Value key='{k}' {_pose(pen)} fatherId='flange[0]'/>" for k in range(2)]
    data += ["</Data>", "", "<Data name='jHome' type='jointRx' size='1'>"]
    data += [f"<Value key='0' {_axes(pen)} />", "</Data>"]
    code += pen.pick([], ["movej(jHome,t,mNom)"])
    for name in pen.pick(("p",), ("p", "q"), ("p", "q", "r")):
        count, father = pen.whole(1, 30), "f[0]"
        data += [f'<Data name="{name}" access="private" xsi:type="array" type="pointRx">']
        for key in range(count):
            father = pen.pick(*[father] * 12, "f[0]", "world[0]", "lost[0]")
            more = pen.pick(*[""] * 30, "<!-- one -->")
            data += [more] * bool(more)
            data += [f"  <Value key='{key}' {_pose(pen)} elbow='ssame' fatherId='{father}' />"]
        data += ["</Data>"]
        twice = [f"movel({name}[0],t,mNom)"]
        code += pen.pick(*[_run(pen, name, count)] * 12, [f"movel({name}[nI],t,mNom)"], twice)
        code += pen.pick(*[[]] * 6, [f"{name}[0].trsf.x=1"], ["call lost()"], ["wait(true)"])
    code += pen.pick([], ["movej(jHome,t,mNom)"])
    head = ["<Programs xmlns='http://www.staubli.com/robotics/VAL3/Program/2'>"]
    body = ["<Program name='a'><Code><![CDATA[begin", *code, "end]]></Code></Program></Programs>"]
    if pen.whole(0, 2) == 0:
        files = (("job.pgx", pen.encode([*head, *data, *body], mark=False)),)
    else:
        base = ["<Database xmlns:xsi='s' xmlns='http://www.staubli.com/robotics/VAL3/Data/2'>"]
        base += ["<Datas>", *data, "</Datas></Database>"]
        texts = ("job.pgx", [*head, *body]), ("job.dtx", base)
        files = tuple((name, pen.encode(lines, mark=False)) for name, lines in texts)
    return Job(files=files, place=0.0, turn=0.0, bend=0.0)


def _run(pen: Pen, name: str, count: int) -> list[str]:
    """Motions to the elements of an array in turn, some of them apart from the others."""
    out, tool, how, key = [], "t", "movel", 0
    while key < count:
        tool = pen.pick(*[tool] * 12, "t", "t[1]", "lost")
        how = pen.pick(*[how] * 8, "movel", "movej")
        if pen.whole(0, 20) == 0 and key + 1 < count:
            out += [f"movec({name}[{key}],{name}[{key + 1}],{tool},mNom)"]
            key += 2
            continue
        plain = f"{how}({name}[{key}],{tool},mNom)"
        out += pen.pick(*[[plain]] * 30, ["wait(true)", plain], [plain + " // x"], [])
        key += 1
    return out


def _axes(pen: Pen) -> str:
    return " ".join(f"j{k}='{pen.angle()}'" for k in range(1, 7))
