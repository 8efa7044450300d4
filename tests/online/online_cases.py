"""Bytes written by hand from the printed layouts, and damage done to them."""

import struct

ROB = (
    b'<Rob Type="KUKA"><RIst X="1000.5000" Y="-20.2500" Z="1500.0000" A="90.0000" B="0.0000" '
    b'C="0.0000"/><AIPos A1="10.0000" A2="-90.0000" A3="90.0000" A4="0.0000" A5="45.0000" '
    b'A6="-180.0000"/><Delay D="0"/><DiL>5</DiL><EStr>all well</EStr><IPOC>4208163634</IPOC></Rob>'
)
CONFIG = b"""<ROOT>
  <CONFIG><IP_NUMBER>192.0.2.1</IP_NUMBER><PORT>49152</PORT><SENTYPE>ImFree</SENTYPE>
  <ONLYSEND>FALSE</ONLYSEND></CONFIG>
  <!-- made in G\xf6ppingen -->
  <SEND><ELEMENTS>
    <ELEMENT TAG="DEF_RIst" TYPE="DOUBLE" INDX="INTERNAL" />
    <ELEMENT TAG="DEF_AIPos" TYPE="DOUBLE" INDX="INTERNAL" />
    <ELEMENT TAG="DEF_Delay" TYPE="LONG" INDX="INTERNAL" />
    <ELEMENT TAG="DiL" TYPE="LONG" INDX="1" />
  </ELEMENTS></SEND>
  <RECEIVE><ELEMENTS>
    <ELEMENT TAG="DEF_EStr" TYPE="STRING" INDX="INTERNAL" />
    <ELEMENT TAG="DEF_Tech.T2" TYPE="DOUBLE" INDX="INTERNAL" HOLDON="0" />
    <ELEMENT TAG="RKorr.X" TYPE="DOUBLE" INDX="1" HOLDON="1" />
    <ELEMENT TAG="RKorr.Y" TYPE="DOUBLE" INDX="2" HOLDON="1" />
    <ELEMENT TAG="RKorr.Z" TYPE="DOUBLE" INDX="3" HOLDON="1" />
    <ELEMENT TAG="DiO" TYPE="LONG" INDX="8" HOLDON="1" />
  </ELEMENTS></RECEIVE>
</ROOT>"""
NETFT = (
    b'<?xml version="1.0" encoding="UTF-8"?><netft><cfgcpf>1000000</cfgcpf><cfgcpt>1000000</cfgcpt>'
    b"<scfgfu>N</scfgfu><scfgtu>N-m</scfgtu></netft>"
)


def _doubles(number, values):
    return b"".join(bytes([number << 3 | 1]) + struct.pack("<d", v) for v in values)


def _message(number, body):
    assert len(body) < 128
    return bytes([number << 3 | 2, len(body)]) + body


FORCE = (1.5, -2.0, 250.0, 0.25, -0.5, 3.0)
JOINTS = (0.0, 10.0, -20.0, 0.0, 30.0, 90.0)
# seqno 300 = ac 02, tm 4000 = a0 1f, MSGTYPE_DATA = 2
_HEADER = _message(1, b"\x08\xac\x02\x10\xa0\x1f\x18\x02")
_POSE = _message(1, _doubles(1, [1000.0]) + _doubles(2, [0.0]) + _doubles(3, [500.0]))
_TURN = _message(
    2, _doubles(1, [1.0]) + _doubles(2, [0.0]) + _doubles(3, [0.0]) + _doubles(4, [0.0])
)
_BACK = _message(1, _doubles(1, JOINTS)) + _message(2, _POSE + _TURN)
_BACK = _message(2, _BACK)
_STATES = (
    _message(4, b"\x08\x01") + _message(5, b"\x08\x03") + b"\x30\x01" + _message(8, b"\x08\x02")
)
EGM_SIX = _HEADER + _BACK + _STATES + _message(9, _doubles(1, FORCE))
EGM_SEVEN = _HEADER + _BACK + _STATES + _message(9, b"\x08\x01" + _doubles(2, FORCE))
EGM_BARE = _HEADER + _BACK + _STATES
# seqno 5, tm 20, MSGTYPE_CORRECTION = 3
_TARGET = _message(1, b"\x08\x05\x10\x14\x18\x03")
EGM_JOINT_TARGET = _TARGET + _message(2, _message(1, _doubles(1, JOINTS)))
_POINT = _message(1, _doubles(1, [1000.0]) + _doubles(2, [2000.0]) + _doubles(3, [3000.0]))
EGM_POSE_TARGET = _TARGET + _message(2, _message(2, _POINT + _TURN))

RDT = struct.pack(">III6i", 7, 7000, 0, 1_500_000, -2_000_000, 250_000_000, 250_000, -500_000, 0)


def flipped(data):
    """Every message that differs in one bit."""
    for at in range(len(data)):
        for bit in range(8):
            yield data[:at] + bytes([data[at] ^ 1 << bit]) + data[at + 1 :]
