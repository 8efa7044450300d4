"""A VAL3 application as a controller keeps it."""

from __future__ import annotations

from robotrue.program.lang import find_language
from robotrue.program.program import FrameTable, Program

CONFIG = 'shoulder="lefty" elbow="epositive" wrist="wpositive"'
DTX = f"""<?xml version="1.0" encoding="utf-8"?>
<Database xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" \
xmlns="http://www.staubli.com/robotics/VAL3/Data/2">
  <Datas>
    <!-- <Value key="9" x="1"/> of nothing -->
    <Data name="fCell" access="public" xsi:type="array" type="frame" size="1">
      <Value key="0" x="500" y="-100.5" z="20" rx="10" ry="20" rz="30" fatherId="world[0]" />
    </Data>
    <Data name="fPart" access="private" xsi:type="array" type="frame" size="2">
      <Value key="0" fatherId="fCell[0]" />
      <Value key="1" x="0" y="0" z="7" rx="0" ry="0" rz="90" fatherId="fCell[0]" />
    </Data>
    <Data name="tMill" access="private" xsi:type="array" type="tool" size="1">
      <Value key="0" x="0" y="0" z="150" rx="0" ry="90" rz="0" fatherId="flange[0]" ioLink="v1" />
    </Data>
    <Data name="mNom" access="private" xsi:type="array" type="mdesc" size="1">
      <Value key="0" accel="100" vel="50" tvel="200" blend="joint" leave="5" reach="5" />
    </Data>
    <Data name="pPath" access="private" xsi:type="array" type="pointRx" size="4">
      <Value key="0" x="100.000" y="0" z="50.25" rx="0" ry="180" rz="0" {CONFIG} \
fatherId="fPart[1]" />
      <Value key="1" x="110.000" y="5.000" z="50.250" rx="10.0" ry="-20.0" rz="30.0" {CONFIG} \
fatherId="fPart[1]" />
      <Value key="2" {CONFIG} rz="1.000" ry="2.000" rx="3.000" z="51.000" y="6.000" x="1.2E2" \
fatherId="fPart[0]"/>
      <Value key="3" x='130.000' y='7.000' z='52.000' rx='0.000' ry='0.000' rz='0.000' \
fatherId="world[0]"/>
    </Data>
    <Data name="pSafe" access="private" xsi:type="array" type="pointRx" size="1">
      <Value key="0" x="300" y="0" z="900" ry="180" {CONFIG} fatherId="world[0]" />
    </Data>
    <Data name="jHome" access="private" xsi:type="array" type="jointRx" size="1">
      <Value key="0" j1="0.000" j2="10.000" j3="90.000" j4="0.000" j5="30.000" j6="0.000" />
    </Data>
  </Datas>
</Database>
"""
BODY = """begin
  // movel(pPath[3],tMill,mNom)
  putln("movel(pPath[3],tMill,mNom)")
  movej(jHome,tMill,mNom)
  open(tMill)
  movej(pPath[0],tMill,mNom)
  movel(pPath[1],tMill,mNom)
  nId=movec(pPath[2],pPath[3],tMill,mNom)
  waitEndMove()
end"""


def pgx(body: str = BODY, *, name: str = "cut", own: str = "") -> str:
    """A program file of one program."""
    return (
        '<?xml version="1.0" encoding="utf-8"?>\n<Programs '
        'xmlns="http://www.staubli.com/robotics/VAL3/Program/2">\n'
        f'  <Program name="{name}">\n{own}    <Code><![CDATA[{body}]]></Code>\n'
        "  </Program>\n</Programs>\n"
    )


PJX = """<?xml version="1.0" encoding="utf-8"?>
<Project xmlns="http://www.staubli.com/robotics/VAL3/Project/3">
  <Parameters version="s7.3.1" stackSize="5000" millimeterUnit="true" />
  <Programs>
    <Program file="cut.pgx" />
  </Programs>
  <Database>
    <Data file="app.dtx" />
  </Database>
  <Libraries />
</Project>
"""


def read_points(
    body: str = BODY, *, dtx: str = DTX, own: str = "", frames: FrameTable | None = None
) -> Program:
    """The points of an application whose program is ``body``."""
    files = [("cut.pgx", pgx(body, own=own).encode()), ("app.dtx", dtx.encode())]
    return find_language("val3").read_job(files, frames=frames or FrameTable())[1]
