"""What the site says that is made when it is built: a page a policy, a scenario, a module, and the leaderboard.

docs/make_site.py gathers them with the pages that are written by hand.
"""

from __future__ import annotations

from collections.abc import Mapping

Pages = Mapping[str, str]
"""Text by path below the folder of the site's sources."""
