"""A table of corrections as a RAPID module.

Arrays keep to three dimensions. ``num`` is a 32-bit number; all sums are those of corrections, so
that rounding stays with the last digit of the pose itself.
"""

from __future__ import annotations

from typing import Final

from robotrue.core.arrays import Array
from robotrue.core.poses import inverse
from robotrue.core.rotations import quat_wxyz_from_matrix
from robotrue.core.units import DEG, MM
from robotrue.program.correction_table import TOOL_MM, TableModule, print_term

_BODY: Final = """
  FUNC robtarget {name}(robtarget rtP\\PERS wobjdata WObj\\PERS tooldata Tool)
    VAR pose rtF;
    VAR pose rtB;
    VAR pose rtQ;
    VAR pose rtD;
    VAR pose rtC;
    VAR num n{{3}};
    VAR num u{{3}};
    VAR num v{{6}};
    VAR num w{{{terms}}};
    VAR num s{{6}};
    VAR num k{{3}};
    VAR num r{{3,3}};
    VAR num wx;
    VAR num wy;
    VAR num wz;
    VAR num g;
    VAR num h;
    VAR num node;
    VAR num da;
    VAR num db;
    VAR num dc;
    {name}State:=0;
    rtF.trans:=rtP.trans;
    rtF.rot:=rtP.rot;
    rtB:={name}Frame;
    IF Present(WObj) THEN
      rtB:=PoseMult(WObj.uframe,WObj.oframe);
      IF WObj.robhold OR NOT WObj.ufprog THEN
        {name}State:=4;
      ENDIF
    ENDIF
    IF Present(Tool) THEN
      ! the tool in force, seen from that of the table
      rtD:=PoseMult({name}Tool,Tool.tframe);
      IF Abs(rtD.trans.x)>{tool} OR Abs(rtD.trans.y)>{tool} OR Abs(rtD.trans.z)>{tool} THEN
        {name}State:=3;
      ENDIF
      IF Abs(rtD.rot.q2)>{tilt} OR Abs(rtD.rot.q3)>{tilt} OR Abs(rtD.rot.q4)>{tilt} THEN
        {name}State:=3;
      ENDIF
      IF NOT Tool.robhold THEN
        {name}State:=4;
      ENDIF
    ENDIF
    ! the pose in the box, and its turns off the middle attitude
    rtQ:=PoseMult({name}In,PoseMult(rtB,rtF));
    rtD:=PoseMult({name}Mid,rtQ);
    da:=EulerZYX(\\Z,rtD.rot);
    db:=EulerZYX(\\Y,rtD.rot);
    dc:=EulerZYX(\\X,rtD.rot);
    u{{1}}:=rtQ.trans.x/{side[0]};
    u{{2}}:=rtQ.trans.y/{side[1]};
    u{{3}}:=rtQ.trans.z/{side[2]};
    v{{4}}:=da/{turn[0]};
    v{{5}}:=db/{turn[1]};
    v{{6}}:=dc/{turn[2]};
    FOR i FROM 1 TO 3 DO
      v{{i}}:=2*u{{i}}-1;
      IF u{{i}}<-{slack} OR u{{i}}>1+{slack} THEN
        {name}State:=1;
      ENDIF
      IF Abs(v{{i+3}})>1+{slack} THEN
        {name}State:=2;
      ENDIF
    ENDFOR
    IF {name}State<>0 THEN
      {name}Count:={name}Count+1;
      IF {name}Halt THEN
        TPWrite "{name}: pose not corrected, state "\\Num:={name}State;
        Stop;
      ENDIF
      RETURN rtP;
    ENDIF
    w{{1}}:=1;
{products}    FOR m FROM 1 TO 6 DO
      s{{m}}:=0;
    ENDFOR
{sums}    ! shift and rotation vector from the axes of the middle attitude to those of the tool
    r{{1,1}}:=Cos(da)*Cos(db);
    r{{2,1}}:=Sin(da)*Cos(db);
    r{{3,1}}:=-Sin(db);
    r{{1,2}}:=Cos(da)*Sin(db)*Sin(dc)-Sin(da)*Cos(dc);
    r{{2,2}}:=Sin(da)*Sin(db)*Sin(dc)+Cos(da)*Cos(dc);
    r{{3,2}}:=Cos(db)*Sin(dc);
    r{{1,3}}:=Cos(da)*Sin(db)*Cos(dc)+Sin(da)*Sin(dc);
    r{{2,3}}:=Sin(da)*Sin(db)*Cos(dc)-Cos(da)*Sin(dc);
    r{{3,3}}:=Cos(db)*Cos(dc);
    rtC.trans.x:=r{{1,1}}*s{{1}}+r{{2,1}}*s{{2}}+r{{3,1}}*s{{3}};
    rtC.trans.y:=r{{1,2}}*s{{1}}+r{{2,2}}*s{{2}}+r{{3,2}}*s{{3}};
    rtC.trans.z:=r{{1,3}}*s{{1}}+r{{2,3}}*s{{2}}+r{{3,3}}*s{{3}};
    rtC.rot.q1:=1;
    rtC.rot.q2:={half}*(r{{1,1}}*s{{4}}+r{{2,1}}*s{{5}}+r{{3,1}}*s{{6}});
    rtC.rot.q3:={half}*(r{{1,2}}*s{{4}}+r{{2,2}}*s{{5}}+r{{3,2}}*s{{6}});
    rtC.rot.q4:={half}*(r{{1,3}}*s{{4}}+r{{2,3}}*s{{5}}+r{{3,3}}*s{{6}});
    rtC.rot:=NOrient(rtC.rot);
    rtF:=PoseMult(rtF,rtC);
    rtP.trans:=rtF.trans;
    rtP.rot:=rtF.rot;
    RETURN rtP;
  ENDFUNC
ENDMODULE
"""

_PLAIN: Final = """    FOR j FROM 1 TO {terms} DO
      FOR m FROM 1 TO 6 DO
        s{{m}}:=s{{m}}+w{{j}}*{name}T{{1,j,m}};
      ENDFOR
    ENDFOR
"""
_GRID: Final = """    ! the cell of the grid, and where in it
    n{{1}}:={cells[0]};
    n{{2}}:={cells[1]};
    n{{3}}:={cells[2]};
    FOR i FROM 1 TO 3 DO
      u{{i}}:=u{{i}}*n{{i}};
      k{{i}}:=Trunc(u{{i}});
      IF k{{i}}<0 THEN
        k{{i}}:=0;
      ENDIF
      IF k{{i}}>n{{i}}-1 THEN
        k{{i}}:=n{{i}}-1;
      ENDIF
      u{{i}}:=u{{i}}-k{{i}};
    ENDFOR
    FOR ix FROM 0 TO 1 DO
      wx:=1-u{{1}}+ix*(2*u{{1}}-1);
      FOR iy FROM 0 TO 1 DO
        wy:=1-u{{2}}+iy*(2*u{{2}}-1);
        FOR iz FROM 0 TO 1 DO
          wz:=1-u{{3}}+iz*(2*u{{3}}-1);
          g:=wx*wy*wz;
          node:=((k{{1}}+ix)*(n{{2}}+1)+k{{2}}+iy)*(n{{3}}+1)+k{{3}}+iz+1;
          FOR j FROM 1 TO {terms} DO
            h:=g*w{{j}};
            FOR m FROM 1 TO 6 DO
              s{{m}}:=s{{m}}+h*{name}T{{node,j,m}};
            ENDFOR
          ENDFOR
        ENDFOR
      ENDFOR
    ENDFOR
"""


def write_rapid_module(module: TableModule) -> dict[str, bytes]:
    """Returns the module by the name of its file; lines end with CR LF."""
    products = module.print_products("w", "v", "{}")
    body = _BODY.format(
        **module.template_fields(module.name, _GRID if module.table.cells.any() else _PLAIN),
        tilt=f"{TOOL_MM * 0.5 * DEG:.6f}",
        products="".join(f"    w{{{k}}}:={text};\n" for k, text in enumerate(products, 2)),
    )
    text = _print_data(module) + body
    return {f"{module.name}.mod": text.replace("\n", "\r\n").encode()}


def _print_data(module: TableModule) -> str:
    name, values, region = module.name, module.table.values, module.table.region
    frame = module.T_world_base @ region.T_base_frame
    nodes = ["    [" + ",\n     ".join(map(_print_term, node)) + "]" for node in values]
    return "\n".join(
        [
            f"MODULE {name}Mod",
            *(f"  ! {line}" for line in module.remarks),
            f"  PERS num {name}State:=0;",
            f"  PERS num {name}Count:=0;",
            f"  PERS bool {name}Halt:=TRUE;",
            f"  LOCAL CONST pose {name}Frame:={_print_pose(frame)};",
            f"  LOCAL CONST pose {name}Tool:={_print_pose(inverse(module.T_flange_tool))};",
            f"  LOCAL CONST pose {name}In:={_print_pose(module.T_corner_world)};",
            f"  LOCAL CONST pose {name}Mid:={_print_pose(module.T_attitude_corner)};",
            "  LOCAL CONST num {}T{{{},{},{}}}:=[".format(name, *values.shape),
            ",\n".join(nodes) + "];",
        ]
    )


def _print_term(term: Array) -> str:
    return f"[{','.join(print_term(term))}]"


def _print_pose(T: Array) -> str:
    xyz = ",".join(f"{value + 0.0:.4f}" for value in T[:3, 3] / MM)
    quat = ",".join(f"{value + 0.0:.9f}" for value in quat_wxyz_from_matrix(T[:3, :3]))
    return f"[[{xyz}],[{quat}]]"
