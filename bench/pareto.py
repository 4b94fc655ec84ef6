"""Which settings are worth their time: the Pareto front."""

from __future__ import annotations

from collections.abc import Sequence


def front(points: Sequence[tuple[float, float]]) -> list[bool]:
    """For each (time, error) whether no other point is at least as good in both and better in one.

    Points with a NaN are not on the front and dominate nobody.
    """

    def dominated(one: tuple[float, float]) -> bool:
        return any(
            other[0] <= one[0] and other[1] <= one[1] and (other[0] < one[0] or other[1] < one[1]) for other in points
        )

    return [one[0] == one[0] and one[1] == one[1] and not dominated(one) for one in points]
