"""What several tests of the documentation build on."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
