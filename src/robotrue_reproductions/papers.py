"""The sources that can be repeated, by the name ``robotrue reproduce`` knows them by."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from robotrue.errors import ConfigurationError
from robotrue_reproductions.deng2022.deng_tables import DENG2022
from robotrue_reproductions.drill_patent.patent_tables import DRILL_PATENT
from robotrue_reproductions.feng2018.feng_tables import FENG2018
from robotrue_reproductions.jin2022.jin_tables import JIN2022
from robotrue_reproductions.reproduction import Paper

PAPERS: Final[Mapping[str, Paper]] = {
    "deng2022": DENG2022,
    "feng2018": FENG2018,
    "jin2022": JIN2022,
    "drill-patent": DRILL_PATENT,
}


def find_paper(name: str) -> Paper:
    """Returns the source of a name.

    Raises:
        ConfigurationError: There is none.
    """
    if name not in PAPERS:
        raise ConfigurationError(f"no reproduction of {name!r}; there are {list(PAPERS)}.")
    return PAPERS[name]
