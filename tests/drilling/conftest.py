"""Cases that several files of this folder build on."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
