"""A table of corrections as a KRL module: functions in a ``.src``, numbers in its ``.dat``.

Identifiers keep to 24 characters and arrays to three dimensions. REAL has 32 bits; all sums are
those of corrections, so that rounding stays with the last digit of the pose itself.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from robotrue.core.arrays import Array
from robotrue.core.poses import inverse
from robotrue.core.units import MM
from robotrue.program.controller_files import print_abc, print_mm
from robotrue.program.correction_table import TableModule, print_term

TYPES: Final = {"E6POS": "", "FRAME": "_F", "POS": "_P"}
"""What a function takes and returns, and how its name ends."""
_LETTERS: Final = "XYZABC"

_WHOLE: Final = """{head} {kind} {name}{end}(PIN:IN)
DECL {kind} PIN
DECL FRAME FF
{copy_in}
FF={name}_F(FF)
{copy_out}
RETURN PIN
ENDFCT
"""
_BODY: Final = """GLOBAL DEFFCT FRAME {name}_F(FIN:IN)
DECL FRAME FIN,QQ,DD,CC
DECL REAL U[3],V[6],W[{terms}],S[6],WX,WY,WZ,G,H
DECL REAL SA,CA,SB,CB,SC,CC1,R[3,3]
DECL INT N[3],K[3],I,J,M,IX,IY,IZ,NODE
{name}_STATE=0
; the tool in force, seen from that of the table
DD={name}_TL:$TOOL
IF (ABS(DD.X)>{tool}) OR (ABS(DD.Y)>{tool}) OR (ABS(DD.Z)>{tool}) THEN
  {name}_STATE=3
ENDIF
IF (ABS(DD.A)>{tool}) OR (ABS(DD.B)>{tool}) OR (ABS(DD.C)>{tool}) THEN
  {name}_STATE=3
ENDIF
IF $IPO_MODE==#TCP THEN
  {name}_STATE=4
ENDIF
; the pose in the box, and its turns off the middle attitude
QQ={name}_IN:$BASE:FIN
DD={name}_MID:QQ
U[1]=QQ.X/{side[0]}
U[2]=QQ.Y/{side[1]}
U[3]=QQ.Z/{side[2]}
V[4]=DD.A/{turn[0]}
V[5]=DD.B/{turn[1]}
V[6]=DD.C/{turn[2]}
FOR I=1 TO 3
  V[I]=2.0*U[I]-1.0
  IF (U[I]<-{slack}) OR (U[I]>1.0+{slack}) THEN
    {name}_STATE=1
  ENDIF
  IF ABS(V[I+3])>1.0+{slack} THEN
    {name}_STATE=2
  ENDIF
ENDFOR
IF {name}_STATE<>0 THEN
  {name}_COUNT={name}_COUNT+1
  IF {name}_HALT THEN
    HALT
  ENDIF
  RETURN FIN
ENDIF
W[1]=1.0
{products}FOR M=1 TO 6
  S[M]=0.0
ENDFOR
{sums}; shift and rotation vector from the axes of the middle attitude to those of the tool
SA=SIN(DD.A)
CA=COS(DD.A)
SB=SIN(DD.B)
CB=COS(DD.B)
SC=SIN(DD.C)
CC1=COS(DD.C)
R[1,1]=CA*CB
R[2,1]=SA*CB
R[3,1]=-SB
R[1,2]=CA*SB*SC-SA*CC1
R[2,2]=SA*SB*SC+CA*CC1
R[3,2]=CB*SC
R[1,3]=CA*SB*CC1+SA*SC
R[2,3]=SA*SB*CC1-CA*SC
R[3,3]=CB*CC1
CC.X=R[1,1]*S[1]+R[2,1]*S[2]+R[3,1]*S[3]
CC.Y=R[1,2]*S[1]+R[2,2]*S[2]+R[3,2]*S[3]
CC.Z=R[1,3]*S[1]+R[2,3]*S[2]+R[3,3]*S[3]
WX=R[1,1]*S[4]+R[2,1]*S[5]+R[3,1]*S[6]
WY=R[1,2]*S[4]+R[2,2]*S[5]+R[3,2]*S[6]
WZ=R[1,3]*S[4]+R[2,3]*S[5]+R[3,3]*S[6]
CC.A=WZ+WX*WY*{half}
CC.B=WY-WZ*WX*{half}
CC.C=WX+WZ*WY*{half}
RETURN FIN:CC
ENDFCT
"""

_PLAIN: Final = """FOR J=1 TO {terms}
  FOR M=1 TO 6
    S[M]=S[M]+W[J]*{name}_T[1,J,M]
  ENDFOR
ENDFOR
"""
_GRID: Final = """; the cell of the grid, and where in it
N[1]={cells[0]}
N[2]={cells[1]}
N[3]={cells[2]}
FOR I=1 TO 3
  U[I]=U[I]*N[I]
  K[I]=U[I]
  IF K[I]>U[I] THEN
    K[I]=K[I]-1
  ENDIF
  IF K[I]<0 THEN
    K[I]=0
  ENDIF
  IF K[I]>N[I]-1 THEN
    K[I]=N[I]-1
  ENDIF
  U[I]=U[I]-K[I]
ENDFOR
FOR IX=0 TO 1
  WX=1.0-U[1]+IX*(2.0*U[1]-1.0)
  FOR IY=0 TO 1
    WY=1.0-U[2]+IY*(2.0*U[2]-1.0)
    FOR IZ=0 TO 1
      WZ=1.0-U[3]+IZ*(2.0*U[3]-1.0)
      G=WX*WY*WZ
      NODE=((K[1]+IX)*(N[2]+1)+K[2]+IY)*(N[3]+1)+K[3]+IZ+1
      FOR J=1 TO {terms}
        H=G*W[J]
        FOR M=1 TO 6
          S[M]=S[M]+H*{name}_T[NODE,J,M]
        ENDFOR
      ENDFOR
    ENDFOR
  ENDFOR
ENDFOR
"""


def write_krl_module(module: TableModule) -> dict[str, bytes]:
    """Returns the ``.src`` and the ``.dat`` by their names; lines end with CR LF."""
    name = module.name.upper()
    products = module.print_products("W", "V", "[]")
    body = _BODY.format(
        **module.template_fields(name, _GRID if module.table.cells.any() else _PLAIN),
        products="".join(f"W[{k}]={text}\n" for k, text in enumerate(products, 2)),
    )
    parts = [_whole(name, "E6POS", "DEFFCT"), body, _whole(name, "POS", "GLOBAL DEFFCT")]
    parts[0] = parts[0].replace("\n", "\n" + _comment(module), 1)
    source = "&ACCESS RVP\n&REL 1\n" + "\n".join(parts)
    files = {f"{module.name}.src": source, f"{module.name}.dat": _print_data(module, name)}
    return {each: text.replace("\n", "\r\n").encode() for each, text in files.items()}


def _whole(name: str, kind: str, head: str) -> str:
    """Returns a function that corrects a pose with more than a frame, and keeps all else of it."""
    return _WHOLE.format(
        name=name,
        kind=kind,
        head=head,
        end=TYPES[kind],
        copy_in="\n".join(f"FF.{letter}=PIN.{letter}" for letter in _LETTERS),
        copy_out="\n".join(f"PIN.{letter}=FF.{letter}" for letter in _LETTERS),
    )


def _comment(module: TableModule) -> str:
    return "".join(f"; {line}\n" for line in module.remarks)


def _print_data(module: TableModule, name: str) -> str:
    values = module.table.values
    lines = [
        f"DEFDAT {name} PUBLIC",
        *(f"; {line}" for line in module.remarks),
        f"DECL GLOBAL INT {name}_STATE=0",
        f"DECL GLOBAL INT {name}_COUNT=0",
        f"DECL GLOBAL BOOL {name}_HALT=TRUE",
        f"DECL FRAME {name}_TL={_aggregate(inverse(module.T_flange_tool))}",
        f"DECL FRAME {name}_IN={_aggregate(module.T_corner_world)}",
        f"DECL FRAME {name}_MID={_aggregate(module.T_attitude_corner)}",
        "DECL REAL {}_T[{},{},{}]".format(name, *values.shape),
    ]
    for node, term in np.ndindex(*values.shape[:2]):
        for k, number in enumerate(print_term(values[node, term]), 1):
            lines.append(f"{name}_T[{node + 1},{term + 1},{k}]={number}")
    return "\n".join([*lines, "ENDDAT", ""])


def _aggregate(T: Array) -> str:
    values = (*print_mm(T[:3, 3] / MM), *print_abc(T[:3, :3]))
    return "{" + ",".join(f"{k} {v}" for k, v in zip(_LETTERS, values, strict=True)) + "}"
