"""``python -m planar_push``."""

import sys

from planar_push.main import main

sys.exit(main())
