"""D2T with Dijkstra: the same clusters and triangles, and the shortest way along their edges.

Source: Sellers et al. (2026), section 4: the search whose ways their ants are to shorten. Sensing assumed: the map,
what moves, own place. Memory kept: the way. States: planning, following, waiting, and with `known=False` looking.
Guarantee: reaches the goal in still worlds or says that there is no way at all; with a horizon none. Length: that of
a way from corner to corner of triangles, some 4 to 10 % over the shortest.
"""

from __future__ import annotations

from bug_gym.agents.planning.d2t_planner import D2TPlanner
from bug_gym.agents.planning.triangulated import Optimiser


class D2TDijkstra(D2TPlanner):
    """The same graph, and Dijkstra's shortest way along its edges."""

    def _optimiser(self) -> Optimiser:
        return "vertices"
