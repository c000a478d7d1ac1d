"""What the page of the tracker says: ghosts in still worlds, movers, and the spread of its filter."""

from __future__ import annotations

from bug_gym.reproductions import tracking as made
from result_pages import Page, Record
from result_pages.words import listed, number, table

NIS_SHARE = 0.95
"""Of squared innovations, below made.BOUND, if the filter is right."""


def cells(one: Record, *names: str) -> list[str]:
    """Numbers of a family; "-" where nothing went into one, or the record is from before it was asked."""
    values = [one.get(name) for name in names]
    return ["-" if value is None else str(value) if isinstance(value, int) else number(value, 3) for value in values]


def tracks(found: Record) -> Page:
    """Ghosts, movers, spread."""
    still, moving = found["still"], found["moving"]
    ghosts = [
        [label, *cells(one, "worlds", "with_ghosts", "ghosts", "scans"), f"{100.0 * one['high']:.2f}"]
        for label, one in still.items()
    ]
    known = [
        [
            label,
            *cells(one, "worlds", "came_into_sight", "known_before", "known_in_time", "known_in_twice", "firsts"),
            *cells(one, "firsts_known", "seen", "misses", "false", "switches", "mota", "motp", "ghosts"),
        ]
        for label, one in moving.items()
    ]
    spread = [
        [
            label,
            *cells(one, "nis", "nis_below_bound", "side_within_one_sigma", "side_within_two_sigma"),
            *cells(one, "within_one_sigma", "within_two_sigma"),
        ]
        for label, one in moving.items()
    ]
    gaussian = (made.ONE_SIGMA_ALONG, made.TWO_SIGMA_ALONG, made.ONE_SIGMA, made.TWO_SIGMA)
    spread.append(["a Gaussian", "2", "0.950", *(number(one, 3) for one in gaussian)])
    haunted = sum(one["with_ghosts"] for one in still.values())
    worlds = sum(one["worlds"] for one in still.values())
    late = [f"{label} ({one['known_in_time']:.3f})" for label, one in moving.items()
            if one["known_in_time"] is not None and one["known_in_time"] < made.ASKED_SHARE]  # fmt: skip
    came, before = (sum(one.get(name, 0) for one in moving.values()) for name in ("came_into_sight", "known_before"))
    firsts = [f"{one['firsts_known']:.3f} in {label}" for label, one in moving.items() if one.get("firsts_known")]
    near = [f"{label} ({one['side_within_two_sigma']:.3f})" for label, one in moving.items()
            if (one.get("side_within_two_sigma") or 1.0) < made.TWO_SIGMA_ALONG]  # fmt: skip
    narrow = [f"{label} ({one['within_two_sigma']:.3f})" for label, one in moving.items()
              if one["within_two_sigma"] is not None and one["within_two_sigma"] < made.TWO_SIGMA]  # fmt: skip
    surprised = [f"{label} ({one['nis_below_bound']:.3f})" for label, one in moving.items()
                 if one["nis_below_bound"] is not None and one["nis_below_bound"] < NIS_SHARE]  # fmt: skip
    return Page(
        [
            table(
                "Still worlds in which something was called moving",
                ["worlds", "number", "with a ghost", "ghosts", "scans", "at most (95 %) [% of worlds]"],
                ghosts,
            ),
            table(
                "Movers",
                ["worlds", "number", "came into sight", "known before", f"known in {made.CONFIRMED_IN} s",
                 f"in {2.0 * made.CONFIRMED_IN} s", f"movers in sight for {made.CONFIRMED_IN} s", "known by then",
                 "times in sight", "misses", "false", "switches", "MOTA", "MOTP [m]", "still things called moving"],
                known,
            ),
            table(
                "The spread that the filter reports",
                ["worlds", "NIS", f"NIS below {made.BOUND:.2f}", "facing side within 1 sigma", "within 2 sigma",
                 "centre within 1 sigma", "within 2 sigma"],
                spread,
            ),
        ],
        f"Something that stands was called moving in {haunted} of {worlds:,} still worlds. "
        + (f"Below 95 % known in time: {', '.join(late)}; a mover seen by few beams, or slow and coming straight at the "
           "robot, takes longer to leave the noise." if late else "Movers are known in time in every family.")
        + (f" But {before:,} of the {came:,} times that one came into sight it had been known just before, "
           "met by fewer beams, farther off or slower. Of movers that have stayed in sight for "
           f"{made.CONFIRMED_IN} s for the first time, each counted once, {listed(firsts)} are known by then."
           if firsts else "")
        + " The network that tells movers was trained in other worlds of these families, and by other ways through the same "
        "two real maps; its bounds were chosen on others again. Settings of clusters and tracks had been chosen on the first "
        "120 worlds here of the depot and the first 80 of `dynamic` and `rush` ([trials](../trials.md)).\n\n"
        "What is off by the radius is the centre: a disc taken for a larger one lies farther away, and the side that faces the "
        "robot where it was. So well as the filter says is that side known, and `Tracks.centre` adds what is not known of a "
        "thing's size and outline (four numbers, by most likely fit to 24 other worlds of each family). Neither is a Gaussian: "
        "more errors than its are tiny.\n\n"
        f"Facing sides lie within 2 sigma less often than {made.TWO_SIGMA_ALONG:.3f} in: {', '.join(near) or 'none'}. "
        f"Centres do, less often than {made.TWO_SIGMA:.3f}, in: {', '.join(narrow) or 'none'}. "
        f"Squared innovations lie below {made.BOUND:.2f} less often than {NIS_SHARE:.2f} in: "
        f"{', '.join(surprised) or 'none'}. Where their mean is below 2 they are smaller than the filter expects.",
        list(made.check(still, moving)),
    )  # fmt: skip
