"""Robots by name, one file each; only the one asked for is imported."""

from __future__ import annotations

import difflib
import importlib
import re
import unicodedata
from typing import Final

from robotrue.errors import ConfigurationError
from robotrue.robot.model import RobotModel

_MODULES: Final = {
    "KUKA KR160 R1570": "kuka_kr160_r1570",
    "KUKA KR300 R2500": "kuka_kr300_r2500",
    "UR5": "ur5",
    "UR10": "ur10",
    "ABB IRB 6660-205/1.9": "abb_irb6660_205_1_9",
    "ABB IRB 120-3/0.6": "abb_irb120_3_0_6",
    "Staubli TX2-90L": "staubli_tx2_90l",
    "Yaskawa GP225": "yaskawa_gp225",
    "Fanuc R-2000iC/165F": "fanuc_r2000ic_165f",
    "Franka Panda": "franka_panda",
    "KUKA LBR iiwa 14 R820": "kuka_lbr_iiwa_14_r820",
}
_BRANDS: Final = (
    "kukalbr",
    "kuka",
    "lbr",
    "universalrobots",
    "universalrobot",
    "abb",
    "fanuc",
    "staubli",
    "yaskawa",
    "motoman",
    "frankaemika",
    "franka",
)


def preset_names() -> tuple[str, ...]:
    """Returns the full names of all presets."""
    return tuple(_MODULES)


def preset(name: str) -> RobotModel:
    """Returns the nominal robot of a name.

    Upper and lower case, blanks, ``-``, ``_``, ``/`` and the brand do not matter, and the front
    part of a name will do where it is unique: ``"kr160"``, ``"KUKA KR 160 R1570"``,
    ``"irb-6660"``.

    Raises:
        ConfigurationError: No such preset, or several; the message lists them.
    """
    wanted = _bare("".join(_tokens(name)))
    exact = [full for full in _MODULES if wanted == _bare("".join(_tokens(full)))]
    found = exact or [full for full in _MODULES if wanted in _short_forms(full)]
    if len(found) != 1:
        listing = ", ".join(_MODULES)
        if found:
            raise ConfigurationError(
                f"preset {name!r} could be {' or '.join(found)}.", hint="write the full name."
            )
        keys = {_bare("".join(_tokens(full))): full for full in _MODULES}
        keys |= {form: full for full in _MODULES for form in _short_forms(full)}
        near = difflib.get_close_matches(wanted, keys, n=1, cutoff=0.0)
        raise ConfigurationError(
            f"no robot preset {name!r}; there are {listing}.",
            hint=f"{keys[near[0]]!r}, or describe the arm by its dh table or urdf."
            if near
            else None,
        )
    module = importlib.import_module(f"{__name__}.{_MODULES[found[0]]}")
    model = module.robot()
    if not isinstance(model, RobotModel):
        raise ConfigurationError(f"preset module {module.__name__} did not build a RobotModel.")
    return model


def _tokens(name: str) -> list[str]:
    """Runs of letters and runs of digits, lower case, accents dropped."""
    plain = unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode().lower()
    return re.findall(r"[a-z]+|[0-9]+", plain)


def _bare(joined: str) -> str:
    for brand in _BRANDS:
        if joined.startswith(brand) and len(joined) > len(brand):
            return joined[len(brand) :]
    return joined


def _short_forms(full: str) -> set[str]:
    """Front parts of a name that hold a number: kr160, kr160r, kr160r1570."""
    tokens = [t for t in _tokens(full) if t not in _BRANDS]
    fronts = ["".join(tokens[: k + 1]) for k in range(len(tokens))]
    return {front for front in fronts if front[-1].isdigit() or front == fronts[-1]}
