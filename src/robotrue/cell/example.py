"""A cell.toml to start from, with every key and its default."""

from __future__ import annotations

from typing import Final

_EXAMPLE: Final = """\
# A robot cell for robotrue. Every table but [robot] may be left out; the values shown in comments
# are then used.
schema = 1

[robot]
# Exactly one of: preset; urdf; convention with dh.
preset = "KUKA KR160 R1570"
# urdf = "robot.urdf"              # relative to this file
# convention = "dh"                # "dh": Rz Tz Tx Rx.  "mdh" (Craig): Rx Tx Rz Tz
# dh = [
#   {theta_deg = 0, alpha_deg = 90, d_mm = 500, a_mm = 250},
#   # ... one row per joint
# ]
# The following lists have one entry per joint (link) and replace what the preset says.
# limits_deg = [[-185, 185], [-140, -5], [-120, 155], [-350, 350], [-125, 125], [-350, 350]]
# mass_kg = [200, 150, 120, 40, 25, 10]
# centre_of_mass_mm = [[0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0]]
# stiffness_Nm_per_rad = [1.75e6, 1.72e6, 1.95e6, 3.73e6, 2.11e6, 1.74e6]
# gravity_m_per_s2 = [0, 0, -9.80665]
# link_radius_mm = [200, 160, 160, 120, 100, 100]   # tubes around the links, for `robotrue plan`

[tool]                             # flange to tool, what the programs use
xyz_mm = [0, 0, 0]                 # default: the flange
abc_deg = [0, 0, 0]                # KUKA A, B, C: Rz(A) Ry(B) Rx(C)

[payload]                          # what hangs on the flange
mass_kg = 0
centre_of_mass_mm = [0, 0, 0]      # in the flange frame

# [target]                         # the measured reflector, in the flange frame
# xyz_mm = [0, 0, 50]              # default: the tool point
# axis = [0, 0, 1]                 # the way it looks; default: not known, any side is seen
# acceptance_deg = 30              # largest angle between that and the line to the tracker

[tracker]
frame = "base"                     # or "unknown": the calibration estimates where it stands
# xyz_mm = [3000, 0, 500]          # the tracker, in the frame of the measured positions; default:
#                                  # for "unknown" the origin, for "base" not known (3 m away)
# place_mm = [3000, 0, 500]        # where it will stand, roughly, in the robot base: for
#                                  # `robotrue plan` with frame "unknown"; default: not known
# sigma_um = 7.5                   # one standard deviation; default 7.5 um + 2.5 um/m, that is a
# sigma_um_per_m = 2.5             # bound of 15 um + 5 um/m read as two sigma

[repeatability]
mm = 0.06                          # ISO 9283 RP, as the data sheet has it

[base]                             # work frame of programs that set none
xyz_mm = [0, 0, 0]
abc_deg = [0, 0, 0]

# [[obstacle]]                       # for `robotrue plan`, as often as needed; robot base
# name = "fixture"                   # exactly one of the three shapes each
# box_mm = [[800, -300, 0], [1400, 300, 400]]   # two opposite corners
# sphere_mm = [1000, 0, 200, 150]               # centre and radius
# below_mm = [[0, 0, -10], [0, 0, 1]]           # a plane: point, and normal out of the solid side

# [controller]                       # what programs name and the controller holds
# files = ["$config.dat"]            # saved by it: also TOOL.CND, UFRAME.CND, SYSFRAME.VA
# pulses_per_degree = [1365, 1365, 1365, 910, 910, 455]   # Yaskawa jobs in pulses; may be negative
# external_axes_at_rest = false      # those not described below stand still, frames hold there
# fixed_tool = "tool_in_part"        # KUKA #TCP: what a target says; or "part_in_tool"
# harmless_routines = ["Spindle"]    # called, in no given file, changing neither frame nor point
# [[controller.base]]                # USER 3, UF 3, BASE_DATA[3], a work object: in the robot base
# number = 3                         # or name = "w_fixture", or both
# xyz_mm = [800, -100, 450]
# abc_deg = [15, 0, 0]               # or wpr_deg (Fanuc W P R, Yaskawa Rx Ry Rz), or quaternion
# [[controller.tool]]                # TOOL 2, UT 2, TOOL_DATA[2], tooldata: on the flange
# number = 2
# xyz_mm = [0, 0, 215.5]
# [[controller.external]]            # an axis that carries the robot or work frames
# axis = 1                           # E1, eax_a, the first external value of a target
# along = [0, 1, 0]                  # or about = [0, 0, 1] and through_mm = [1500, 0, 400]
# at_mm = 0                          # where it stood when the frames were given; at_deg if it turns
# carries = ["robot"]                # or frames by number or name; "base" is the default one
"""


def write_cell_example() -> str:
    """Returns the text of a commented cell.toml that states every key and default."""
    return _EXAMPLE
