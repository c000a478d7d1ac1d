"""Pages of the Bug family: a printed table, bounds and guarantees, BARN, beams, noise and drift."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from bug_gym.config import load
from bug_gym.intervals import exact_mcnemar, wilson_interval
from bug_gym.reproductions import barn, bug_bounds, bug_no_way, dynabarn, odometry_drift, operative_critical_points
from bug_gym.reproductions.com1_rev3 import ROOMY, difference
from bug_gym.reproductions.com1_rev3 import share as share_of
from bug_gym.reproductions.ring_verdicts import shown
from bug_gym.reproductions.still_things import POLICIES, marked
from bug_gym.reproductions.team_worlds import FIG_6
from result_pages import Page, Record
from result_pages.words import code, listed, number, percent, picture, share, table


def oni_wang_table_1(found: Record) -> Page:
    """Lengths beside the printed and the ideal ones."""
    cells = found["cells"]
    kinds = {"printed": "printed", "ideal, square": "sharp", "ideal, rounded": "rounded", "ours": "length"}
    rows = []
    for policy, routes in cells.items():
        for label, key in kinds.items():
            lengths = [one[key] for one in routes.values()]
            texts = ["F" if length is None else f"{length:.2f}" for length in lengths]
            if key == "length":
                texts = [
                    text + ("" if one["agrees"] else " !") for text, one in zip(texts, routes.values(), strict=True)
                ]
            total = f"{sum(length for length in lengths if length is not None):.2f}"
            rows.append([f"`{policy}`", label, *texts, total])
    routes = next(iter(cells.values()))
    everything = [one for routes in cells.values() for one in routes.values()]
    agree = sum(one["agrees"] for one in everything)
    return Page(
        [table("Distance travelled [m]", ["policy", "", *routes, "total"], rows)],
        "F: cycles for ever. The total leaves those routes out. Bug1 goes back to its leave point the way it came, as "
        "printed. An `!` marks a cell of ours that is farther from the rounded ideal than 1.5 % or three steps.\n\n"
        f"{agree} of {len(everything)} cells agree.",
        [("every length is within 1.5 % or three steps of the ideal one, and F stands where F is printed",
          agree == len(everything))],
    )  # fmt: skip


def com1_rev3(found: Record) -> Page:
    """Worked facts, formulas and claims of the paper's team, and the room that it makes."""
    worlds = {name: one for name, one in found["claim"].items() if name != "holds"}
    crowds = {robots: one for robots, one in found["room"].items() if robots != "holds"}
    quarter = found["formulas"]["(20)"]
    sizes = sum(kind["n"] for kind in found["formulas"]["kinds"])
    halves = [one["by_half"] == one["both"] for one in worlds.values()]
    pays = {name: one for name, one in found["pays"].items() if name != "holds"}
    rarer = {name: one for name, one in pays.items() if one["arrived"][0] < one["arrived"][1]}
    counts = listed(
        f"`{name}` ({one['arrived'][0]} instead of {one['arrived'][1]} of {one['n']} worlds)" for name, one in rarer.items()
    ) if rarer else ""  # fmt: skip
    apart = [name for name, one in rarer.items() if clearly_rarer(one["arrived"], one["n"])]
    sure = f"the intervals lie apart in {code(apart)}" if apart else "so few worlds do not tell that from chance"
    beside = f"less often than it in {counts}; {sure}" if rarer else "as often as it everywhere"
    return Page(
        [
            com1_rev3_facts(found["facts"]["routes"]),
            com1_rev3_formulas(found["formulas"]["kinds"]),
            com1_rev3_claims(worlds),
            com1_rev3_room(crowds),
            com1_rev3_maps({name: one for name, one in found["table_2"].items() if name != "holds"}),
            com1_rev3_stops({name: one for name, one in found["fig_6"].items() if name != "holds"}),
            com1_rev3_pays(pays),
        ],
        f"{crowds['2']['n']} worlds (`pays` {next(iter(pays.values()))['n']} a line) and {sizes} sizes of obstacles.\n\n"
        "s*: way of the winner when it is known to win, on the contour with rounded corners. A run is measured against the "
        "formula of the rounded contour; the pair that meets lacks at most twice the gap at which its robots meet. The "
        f"paper's (20), a quarter of the circumference on a disc, is more than the difference on {quarter['below']} of "
        f'{quarter["n"]} discs, by up to {quarter["most"]:.2f} m. "Always less by half the obstacle\'s length" is '
        f"{'so in all of these worlds' if all(halves) else 'not so: see the third table'}. A detour is flagged where a "
        "robot waited for more than 10 s; Com1 leaves its solo way in no other world. Effectiveness is the share of routes on "
        "which the goal is reached, and efficiency what the way of all routes is shorter than Bug2's; a route that fails (F) "
        "leaves no efficiency. The paper has 19.6 % and 1.5 % for Rev3 on its two maps, which are not printed.\n\n"
        "The best member is the one that would arrive first alone, which nobody knows beforehand. "
        f"The team arrives {beside}.",
        [
            ("winner, s*, total, sum and place of the stop are within 1.5 % or three steps", found["facts"]["holds"]),
            ("totals on one obstacle are those of the formulas", found["formulas"]["holds"]),
            (
                "in random worlds of rectangles no contact, no standstill, and Com1's curve that of its solo way",
                found["room"]["holds"],
            ),
            ("exactly one arrives, and was the nearer one at the stop (Fig. 6)", found["fig_6"]["holds"]),
            ("Rev3 drives about as far as Rev2 wherever that arrives (Table 2)", found["table_2"]["holds"]),
        ],
    )


def clearly_rarer(arrived: Sequence[int], n: int) -> bool:
    """Whether the interval of the first share of n lies below that of the second."""
    mine, other = (wilson_interval(count, n) for count in arrived)
    return mine.high < other.low


def com1_rev3_facts(routes: Record) -> str:
    """The routes over the map of Fig. 1."""
    rows = [
        [route, ("Com1", "Rev3")[one["off"]["winner"]]]
        + [f"{one['ideal'][key]:.2f} / {one['off'][key]:.2f}" for key in ("named", "total", "both")]
        + [f"{one['on']['named']:.2f}", f"{one['on']['both']:.2f}"]
        for route, one in routes.items()
    ]
    header = ["route", "winner", "s*", "winner's total", "sum", "HOLD: s*", "HOLD: sum"]
    return table("The map of Fig. 1, both left, without bodies: ideal / ours [m]", header, rows)


def com1_rev3_formulas(kinds: Sequence[Record]) -> str:
    """Runs beside the formulas for one obstacle."""
    rows = [
        [one["kind"], str(one["n"])]
        + [f"{min(one[name]):+.2f} to {max(one[name]):+.2f}" for name in ("com1_rev3", "bug1_pair")]
        for one in kinds
    ]
    header = ["obstacle", "sizes", "com1_rev3", "bug1_pair"]
    return table("One obstacle: run minus formula [m]", header, rows)


def com1_rev3_claims(worlds: Record) -> str:
    """What the team saves over the pair that goes both ways."""
    rows = [
        [
            name,
            f"{one['both']} of {one['n']}",
            share_of(one["less"], one["both"]),
            share_of(one["by_half"], one["both"]),
        ]
        + [difference(one["saved"])]
        for name, one in worlds.items()
    ]
    header = ["worlds", "both arrive", "less [%] (95 %)", "less by half the obstacle [%] (95 %)", "saved [m] (95 %)"]
    return table("Both ways together, com1_rev3 against bug1_pair", header, rows)


def com1_rev3_room(crowds: Record) -> str:
    """How robots of a team keep clear of one another."""
    rows = [
        [robots, *(str(one[key]) for key in ("n", "contacts", "standstills", "detours", "off_curve"))]
        + [f"{one['gap']:.2f}", percent(one["held_share"])]
        for robots, one in crowds.items()
    ]
    return table("Random worlds of one to five rectangles", ROOMY, rows)


def com1_rev3_maps(routes: Record) -> str:
    """Four algorithms between three places of two maps, in the manner of Table 2."""
    totals = {
        name: None if None in one["lengths"] else sum(length for length in one["lengths"])
        for name, one in routes.items()
    }
    rows = []
    for name, one in routes.items():
        label, policy = name.split()
        total, base = totals[name], totals[f"{label} bug2"]
        shorter = None if total is None or base is None else 100.0 * (1.0 - total / base)
        lengths = ["F" if length is None else number(length, 1) for length in one["lengths"]]
        rows.append(
            [label, code([policy]), *lengths, number(total, 1), percent(one["effectiveness"]), number(shorter, 1)]
        )
    header = ["map", "policy", "AB", "AC", "BA", "BC", "CA", "CB", "all [m]", "effectiveness [%]"]
    header += ["efficiency against Bug2 [%]"]
    return table("Two maps of our own in the manner of Table 2 [m]", header, rows)


def com1_rev3_stops(figures: Record) -> str:
    """Who stops from the starts of Fig. 6 on two maps, and where."""
    rows = []
    for name, one in figures.items():
        figure, label = name.split()
        _, _, _, stopped, place = FIG_6[figure]
        ours, theirs = (
            "{} at ({:.1f}, {:.1f})".format(*who) for who in ((one["stopped"], *one["stops"]), (stopped, *place))
        )
        rows.append([figure, theirs, label, ours, "yes" if one["holds"] else "no"])
    header = ["Fig. 6", "the paper: who stops", "map", "ours: who stops", "one arrives, the nearer one"]
    return table("Starts and goals of Fig. 6 on these maps", header, rows)


def com1_rev3_pays(pays: Record) -> str:
    """Whether two are sooner there than the better one alone."""
    rows = [
        [name, str(one["n"]), *(share_of(count, one["n"]) for count in one["arrived"])]
        + [difference(one[key]) for key in ("time", "way")]
        for name, one in pays.items()
    ]
    header = [
        "world",
        "n",
        "team arrives [%] (95 %)",
        "best member [%] (95 %)",
        "time [s] (95 %)",
        "way of all [m] (95 %)",
    ]
    return table("First arrival of the team beside its better member alone", header, rows)


def bounds(found: Record) -> Page:
    """Guarantees and length bounds."""
    policies = found["policies"]
    header = list(next(iter(policies.values())))
    complete = [one for name, one in policies.items() if name in bug_bounds.COMPLETE]
    arrived = {name: float(one["success [%]"].split()[0]) for name, one in policies.items()}
    return Page(
        [
            table(
                f"{found['seeds']} random worlds at a clearance of {found['clearance']:g} m",
                ["policy", *header],
                [[f"`{name}`", *one.values()] for name, one in policies.items()],
            )
        ],
        f"{sum(value == 100.0 for value in arrived.values())} of {len(policies)} algorithms arrive in all "
        f"{found['seeds']} worlds, with {sum(int(one['collisions']) for one in policies.values())} collisions and "
        f"{len(found['faults'])} broken claims. Bug1 comes to {policies['bug1']['largest share of bound']} of its bound, "
        f"Bug2 to {policies['bug2']['largest share of bound']}.",
        [
            ("the complete algorithms arrive always", all(one["success [%]"].startswith("100.0 ") for one in complete)),
            *(
                (f"`{name}` arrives in at least {percent(asked)} % of the worlds", arrived[name] >= 100 * asked)
                for name, asked in bug_bounds.NEARLY.items()
            ),
            ("nobody touches anything", all(one["collisions"] == "0" for one in policies.values())),
            ("no path is longer than its bound or shorter than the shortest, and distances at hit and leave points fall",
             not found["faults"]),
        ],
    )  # fmt: skip


def no_way(found: Record) -> Page:
    """Verdicts against the configuration space."""
    policies = found["policies"]
    header = list(next(iter(policies.values())))
    rows = [
        [f"`{name}`", "yes" if name in bug_no_way.PROVEN else "no", *map(str, one.values())]
        for name, one in policies.items()
    ]
    right = [
        name
        for name, one in policies.items()
        if one["reached"] == one["with a way"] and one["unreachable"] == one["without"]
    ]
    ended = all(
        sum(one[end] for end in ("reached", "unreachable", "looping", "stuck")) == one["with a way"] + one["without"]
        for one in policies.values()
    )
    ways = next(iter(policies.values()))
    without = [name for name in bug_no_way.WITHOUT_CLEARANCE if name in policies]
    own = (
        f" {code(without)} know no clearance and keep what their field or their grid has them keep." if without else ""
    )
    return Page(
        [
            table(
                f"{found['seeds']} random worlds at a clearance of {found['clearance']:g} m",
                ["policy", "complete", *header],
                rows,
            )
        ],
        f"{ways['with a way']} of the worlds have a way and {ways['without']} have none. "
        f"{len(right)} algorithms are right in all of them: {code(right)}. The others come to an end everywhere and "
        f"make {len(found['wrong'])} wrong claims." + own,
        [
            ("the complete algorithms are right both ways", {*bug_no_way.PROVEN} & {*policies} <= {*right}),
            ("the incomplete ones come to an end, and call no goal unreachable that is not",
             ended and not found["wrong"]),
        ],
    )  # fmt: skip


def cylinder_claims(found: Record) -> Page:
    """Verdicts among the thin cylinders of a cellular automaton, against the configuration space."""
    policies, wrong = found["policies"], found["wrong"]
    header = list(next(iter(policies.values())))
    rows = [
        [f"`{name}`", robot, "yes" if name in bug_no_way.PROVEN else "no", *map(str, one.values())]
        for (name, _, robot), one in ((key.partition(" "), one) for key, one in policies.items())
    ]
    claims = sum(one["wrong claims"] for one in policies.values())
    runs = sum(one["with a way"] + one["without"] for one in policies.values())
    ends = [
        f"`{one['policy']}` ({one['kind']}, seed {one['seed']}: {one['verdict'] or one['outcome']})" for one in wrong
    ]
    columns = ("reached", "unreachable", "looping", "stuck")
    apart = runs - len(wrong) - sum(one[column] for one in policies.values() for column in columns)
    differ = (
        f" In {apart} runs robots of a team gave up for different reasons; these stand in no column." if apart else ""
    )
    clearances = listed(f"{value:g} m ({robot})" for robot, value in found["clearances"].items())
    driven = {key.split()[0]: one["with a way"] + one["without"] for key, one in policies.items()}
    fewer = [f"`{name}`" for name, worlds in driven.items() if worlds < found["seeds"]]
    first = f" {listed(fewer)} drove through the first {min(driven.values()):,} worlds alone." if fewer else ""
    return Page(
        [
            table(
                f"{found['seeds']} worlds, a quarter of them shut, at clearances of {clearances}",
                ["policy", "robot", "complete", *header],
                rows,
            )
        ],
        f"{runs:,} runs, {claims} wrong claims.{first}{differ} Wrong is also a timeout, a collision, and of a complete "
        "algorithm any end that is not as the configuration space says"
        + (f": {listed(ends)}." + FOUND_LAST if ends else "; there is none." + MENDED),
        [
            ("nobody calls a goal unreachable that a way leads to", claims == 0),
            ("each run ends, and those of complete algorithms as the configuration space says", not wrong),
        ],
    )


MENDED = (
    " What failed in these very worlds before was looked at and mended ([trials](../trials.md)): so the count says that "
    "nothing is known to fail here, not how often something would in others."
)
"""Of pages whose worlds are those that code was mended by."""
FOUND_LAST = (
    " What failed in these very worlds before was looked at and mended ([trials](../trials.md)); what is named here came when "
    "more worlds were driven through, and has not been: of this policy the count says how often it fails in others, too."
)
"""The same, of those in which something fails."""


def counts_by_kind(of_policies: Iterable[Record]) -> dict[tuple[str, str], list[int]]:
    """The counts of several policies together, by the title and the name of a kind."""
    together: dict[tuple[str, str], list[int]] = {}
    for kinds in of_policies:
        for title, some in kinds.items():
            for name, counted in some.items():
                so_far = together.get((title, name), [0] * len(counted))
                together[title, name] = [one + other for one, other in zip(so_far, counted.values(), strict=True)]
    return together


def still_things(found: Record) -> Page:
    """Contacts with what stands still, by policy and by kind of world and robot."""
    policies, kinds, touched = found["policies"], found["kinds"], found["touched"]
    header = list(next(iter(policies.values())))
    driven = sum(one["driven"] for one in policies.values())
    contacts = [f"`{one['policy']}` ({one['world']}, seed {one['seed']})" for one in touched]
    told = f": {listed(contacts[:12])}{', and others' if len(contacts) > 12 else ''}." if contacts else "."
    fewest = min(one["robot"]["lidar.beams"] for one in touched) if touched else 0
    thin = sum(one["world"] == "cellular_automaton" and one["robot"]["lidar.beams"] == fewest for one in touched)
    where = f" {thin} of them with cylinders thinner than the body, which {fewest} beams miss." if touched else ""
    left_out = [name for name in POLICIES if name not in policies]
    by_kind = [
        table(
            f"{'All policies' if len(kinds) == len(policies) else code(kinds)} by kind of world and robot",
            ["", "", *header],
            [[*kind, *map(str, counted)] for kind, counted in counts_by_kind(kinds.values()).items()],
        )
    ]
    return Page(
        [
            table(
                f"{found['seeds']} worlds, each with a robot of its own",
                ["policy", *header],
                [[f"`{marked(name)}`", *map(str, one.values())] for name, one in policies.items()],
            ),
            *(by_kind if kinds else []),
        ],
        f"{driven:,} episodes, {len(touched)} contacts{told}{where} An episode ends after a minute, which is short for a maze: "
        "whether a policy arrives is asked elsewhere. Robots that a scripted policy is shown too little to drive, such as "
        "holonomic ones with a blind side, are refused in one line when it is made."
        + (f" Not driven this time: {listed(f'`{name}`' for name in left_out)}." if left_out else "")
        + MENDED,
        [("nobody touches what stands still", not touched)],
    )


def barn_worlds(found: Record) -> Page:
    """The BARN benchmark for all robots."""
    results = found["results"]
    robots: dict[str, dict[str, Record]] = {}
    for key, one in results.items():
        robot, policy = key.split(" ", 1)
        robots.setdefault(robot, {})[policy] = one
    titles = {"score_2024": "score", "score_2022": "score of 2022"}
    # A record from before there were two metrics took OT from our own shortest path: its score is not shown.
    metrics = [metric for metric in titles if all(metric in one for one in results.values())]
    rows = [
        [
            f"`{policy}`", robot, str(one["worlds"]), share(one), percent(one["in_time"]), str(one["collisions"]),
            *(number(one[metric], 4) for metric in metrics), number(one["time"], 1),
            ", ".join(f"{world}: {end}" for world, end in one["missed"].items()) or "-",
        ]
        for robot, policies in robots.items()
        for policy, one in policies.items()
    ]  # fmt: skip
    header = [
        *("policy", "robot", "worlds", "reached [%] (95 %)", f"in {barn.SCORED:g} s [%]", "collisions"),
        *(titles[metric] for metric in metrics),
        *("time of successes [s]", "missed"),
    ]
    claimed = {
        robot: {policy: one for policy, one in mine.items() if policy in barn.CLAIMED} for robot, mine in robots.items()
    }
    fewest = {
        robot: min(round(one["success"] * one["worlds"]) for one in mine.values()) for robot, mine in claimed.items()
    }
    worlds = next(iter(results.values()))["worlds"]
    claims = [
        (f"as the {robot} robot every bug of these reaches at least {percent(barn.SUCCESS_ASKED[robot])} % of the worlds",
         all(one["success"] >= barn.SUCCESS_ASKED[robot] for one in mine.values()))
        for robot, mine in claimed.items()
        if robot in barn.SUCCESS_ASKED
    ]  # fmt: skip
    faithful = ""
    if "faithful" in fewest:
        fair = {policy: one for policy, one in robots["faithful"].items() if not policy.endswith("(privileged)")}
        best = max(fair, key=lambda policy: float(fair[policy]["score_2024"]))
        faithful = (
            "The faithful robot has the benchmark's rectangle, its limits of speed, turn rate and acceleration, its scanner "
            "of 270 degrees with noise and its latency of 0.1 s, but no limit of angular acceleration and no slip; every bug "
            f"of these reaches at least {fewest['faithful']}. Of those that do not read the map `{best}` scores most with it, "
            f"{fair[best]['score_2024']:.4f} with {percent(fair[best]['success'])} % reached. Its commands act late: who "
            "decides by what it will see then, and who by what it sees, was chosen on these worlds "
            "([trials](../trials.md#commands-that-act-late)). "
        )
    still = all(one["collisions"] == 0 for one in claimed["holonomic"].values())
    strangers = {
        robot: f"The {robot} robot is not driven by {code(mine)}, which were made for another one. "
        for robot, mine in found.get("refused", {}).items()
        if mine
    }
    return Page(
        [table("Worlds of the BARN benchmark", header, rows)],
        f"Of {worlds} worlds every bug of {code(barn.CLAIMED)} reaches at least {fewest['holonomic']} as a holonomic robot, "
        f"and at least {fewest['jackal']} as the benchmark's, a disc of {barn.ROBOTS['jackal']['radius']} m that drives at up "
        f"to {barn.ROBOTS['jackal']['max_speed']:g} m/s. {faithful}{''.join(strangers.values())}"
        f"A run of over {barn.SCORED:g} s is a failure in the benchmark and "
        f"scores nothing here; it goes on to its end. For context: {barn.DWA}",
        [*claims, ("none of these bugs collides as the holonomic robot", still)],
    )


def dynabarn_worlds(found: Record) -> Page:
    """The DynaBARN benchmark for the faithful robot."""
    results = found["results"]
    header = [
        *(
            "policy",
            "runs",
            "reached [%] (95 %)",
            "collisions",
            "of them jumped on",
            "timeouts",
            "as coded",
            "as meant",
        ),
        "time of successes [s]",
    ]
    rows = [
        [
            f"`{policy}`", str(one["n"]), share(one), *(str(one[key]) for key in ("collisions", "jumped_on", "timeouts")),
            *(number(one[key], 4) for key in ("as_coded", "as_meant")), number(one["time"], 1),
        ]
        for policy, one in results.items()
    ]  # fmt: skip
    best, second = sorted(results, key=lambda policy: -float(results[policy]["success"]))[:2]
    missed = {name: {run.split(": ")[0] for run in results[name]["missed"]} for name in (best, second)}
    p = exact_mcnemar(len(missed[second] - missed[best]), len(missed[best] - missed[second]))
    shares = [f"in {percent(results[one]['success'])} % of its runs" for one in (best, second)]
    scores = [f"{results[one]['as_meant']:.4f}" for one in (best, second)]
    if results[best]["success"] == results[second]["success"]:
        most = (
            f"`{best}` and `{second}` reach the goal most often, each {shares[0]}, with scores of "
            f"{' and '.join(scores)} as meant"
        )
    else:
        most = (
            f"`{best}` reaches the goal most often, {shares[0]}, with a score of {scores[0]} as meant; next comes "
            f"`{second}`, {shares[1]}"
        )
    return Page(
        [table("Worlds of DynaBARN", header, rows)],
        f"{most} (p = {p:.2g}, McNemar). There are {dynabarn.PHASES} runs in each world, which intervals and p take for "
        "independent. As coded a success is 0.125, whatever its time. Jumped on: by a mover that had jumped from the end of "
        "its spline to its beginning less than a second before, a success spoilt by being overlapped among them. The robot is "
        "the faithful one of `barn`: no limit of angular acceleration, no slip. Who is privileged is told the map, where "
        "nothing stands but the walls around it.",
        [],
    )


def sweep_tables(found: Record, titles: Sequence[str]) -> list[str]:
    """Success and path ratio of each sweep, against its value."""
    tables = []
    for title, sweep in zip(titles, found["sweeps"], strict=True):
        header = ["policy", *(f"{value:g}" for value in sweep["values"])]
        worlds = next(iter(sweep["policies"].values()))[0]["n"]
        where = f"{worlds} runs each, in {code(sweep['scenarios'])}"
        success = [[f"`{name}`", *map(share, row)] for name, row in sweep["policies"].items()]
        ratio = [[f"`{name}`", *(number(one["path_ratio"]) for one in row)] for name, row in sweep["policies"].items()]
        tables.append(table(f"{title}: success [%] (95 %) against {sweep['label']}; {where}", header, success))
        tables.append(table(f"{title}: path over shortest path of the successes", header, ratio))
    return tables


def contact_tables(found: Record, titles: Sequence[str]) -> list[str]:
    """Runs of each sweep that end in a contact, against its value."""
    return [
        table(
            f"{title}: runs that end in a contact [%]",
            ["policy", *(f"{value:g}" for value in sweep["values"])],
            [[f"`{name}`", *(percent(one["collision"]) for one in row)] for name, row in sweep["policies"].items()],
        )
        for title, sweep in zip(titles, found["sweeps"], strict=True)
    ]


def value_at(sweep: Record, value: float, what: str) -> dict[str, float]:
    """What was found of each policy at a value of a sweep."""
    index = sweep["values"].index(value)
    return {name: row[index][what] for name, row in sweep["policies"].items()}


def success_at(sweep: Record, value: float) -> dict[str, float]:
    """Success of each policy at a value of a sweep."""
    return value_at(sweep, value, "success")


def ring_verdicts(found: Record) -> Page:
    """How incomplete bugs end before the ring."""
    results = found["results"]
    everything = [one for noises in results.values() for one in noises.values()]
    limit = load("ring").time.limit
    late = {
        name.split(",")[0] for name, noises in results.items() if any(one["latest"] > limit for one in noises.values())
    }
    rows = [
        [f"`{who.split(', ')[0]}`", who.split(", ")[1], *map(shown, noises.values())] for who, noises in results.items()
    ]
    noises = next(iter(results.values()))
    header = ["policy", "robot", *(f"{noise} m" for noise in noises)]
    later = f"Later than that {'are' if len(late) > 1 else 'is'} {code(sorted(late))}." if late else "Nobody is later."
    return Page(
        [table(f"looping / stuck / unreachable / no verdict, latest end [s]; {found['seeds']} seeds a noise", header, rows)],
        "Beams to 10 m. Without noise every seed is the same episode, driven once. Nobody here promises to tell that there "
        'is no way; some come all round the ring and say "unreachable", which is true. The scenario itself gives '
        f"{limit:g} s. {later} `minimum_risk` is patient for 300 s after it has come nearer, by default.",
        [("every run ends with a verdict and without a contact",
          all(one["none"] == 0 and one["collisions"] == 0 for one in everything))],
    )  # fmt: skip


def lidar_density(found: Record) -> Page:
    """Beams and range noise."""
    titles, (beams, noise) = ["LIDAR density", "Range noise"], found["sweeps"]
    touching = [value for value in beams["values"] if max(value_at(beams, value, "collision").values()) > 0.0]
    contacts = max(one["collision"] for row in noise["policies"].values() for one in row)
    ended = f"at most {percent(contacts)} % of a policy's runs" if contacts > 0.0 else "no run"
    fewest, plenty, slight, most = beams["values"][0], 16, 0.02, noise["values"][-1]
    few, enough = success_at(beams, fewest), success_at(beams, plenty)
    before, last = success_at(noise, slight), success_at(noise, most)
    best = max(last, key=lambda name: last[name])
    return Page(
        [
            picture("lidar-density", "Success against the number of beams and against range noise"),
            *sweep_tables(found, titles),
            *contact_tables(found, titles),
        ],
        f"With {fewest} beams the policies arrive in {percent(min(few.values()))} to {percent(max(few.values()))} % of runs, "
        f"with {plenty} in at least {percent(min(enough.values()))} %. Range noise of {slight:g} m leaves all at "
        f"{percent(min(before.values()))} % or more; at {most:g} m `{best}` is left with "
        f"{percent(last[best])} %, the others with {percent(min(last.values()))} to "
        f"{percent(max(value for name, value in last.items() if name != best))} %. The clearance is the default one, "
        "which knows nothing of the noise; but nobody takes a step that may lead into something, so who does not arrive is "
        f"late or gives up: noise ends {ended} in a contact. With up to {max(touching, default=0):g} beams some policies touch "
        "what lies between two.",
    )


def drift(found: Record) -> Page:
    """Which bugs survive drift."""
    beacon, computed = found["sweeps"]
    survives = odometry_drift.SURVIVES
    most = beacon["values"][-1]
    surviving = [name for name, value in success_at(beacon, most).items() if value >= survives]
    dips = []
    for name in surviving:
        row = beacon["policies"][name]
        lowest = min(row, key=lambda one: one["success"])
        if lowest["success"] < survives:
            value = beacon["values"][row.index(lowest)]
            dips.append(f"`{name}` falls to {percent(lowest['success'])} % at {value:g}")
    lines = []
    for value in computed["values"][1:]:
        order = sorted(success_at(computed, value).items(), key=lambda item: -item[1])
        (first, best), (last, worst) = order[0], order[-1]
        lines.append(f"at {value:g} m/sqrt(m) {percent(worst)} % (`{last}`) to {percent(best)} % (`{first}`)")
    lasting = [f"`{name}`" for name, value in success_at(computed, most).items() if value >= survives]
    return Page(
        [
            picture("odometry-drift", "Success against odometry drift"),
            *sweep_tables(found, [one.title for one in odometry_drift.SWEEPS]),
        ],
        f"With a beacon at the goal {len(surviving)} of {len(beacon['policies'])} policies survive odometry noise of {most:g} "
        f"m/sqrt(m), which is to say that at least {percent(survives)} % arrive"
        + (f", though {listed(dips)}" if dips else "")
        + f". Where the goal itself is computed from odometry "
        f"{listed(lasting) or 'none'} {'does' if len(lasting) == 1 else 'do'}. There "
        f"arrive {listed(lines)}."
        + (
            " `minimum_risk` does not stand where it takes the goal to be: it finds itself trapped there and goes about near "
            "by until it comes upon the goal, which is a search and no better knowledge of where it is."
            if "`minimum_risk`" in lasting
            else ""
        ),
    )


def critical_points(found: Record) -> Page:
    """Scenes, claims of the paper, and what each repair is worth."""
    ours = operative_critical_points.OURS
    scenes, repairs, sparse = found["scenes"], found["repairs"], found["sparse"]
    mine = [one for one in scenes if one["policy"] == ours]
    every, below = repairs["all repairs"], "worlds with a passage below 2 r"
    printed = repairs["sub_goal=printed"]
    cells = [
        [
            *(one["label"], f"`{one['policy']}`", one["outcome"], number(one["length"]), number(one["time"], 1)),
            *(number(one["clearance"]), *(_own(one) if one["policy"] == ours else ["-"] * 6)),
        ]
        for one in scenes
    ]
    header = ["scene", "policy", "outcome", "length [m]", "time [s]", "least clearance [m]", "critical points"]
    header += ["rotation [rad]", "T_M [s]", "T_R [s]", "DOT [s]", "avoided / seen"]
    return Page(
        [
            table("Scenes in the manner of the figures, their numbers in brackets", header, cells),
            table("What the paper claims", ["claim", "found"], found["claims"]),
            table(
                "What each repair is worth",
                ["setting", *every],
                [[f"`{label}`", *(f"{value:g}" for value in row.values())] for label, row in repairs.items()],
            ),
            table(
                "Few still obstacles, over the worlds in which all arrive",
                ["policy", *next(iter(sparse.values()))],
                [[f"`{policy}`", *(f"{value:g}" for value in row.values())] for policy, row in sparse.items()],
            ),
        ],
        "The paper prints no numbers. Repaired: the sign and the sine of its sub-goals, legs that are looked at again, the "
        "gap that SAFE_POINT measures, the obstacle's time to the meeting point, and what tells still from moving. With "
        f"sub-goals as printed {printed['collisions']} of {printed['worlds']} still worlds end in a collision, with all "
        f"repairs {every['collisions']} of {every['worlds']}. Discs stand so close here that often no way is wide enough: "
        f"{every['arrived']} arrive, {every['gave up']} give up. Overtaking and several movers are our own scenes.",
        [
            ("it arrives in all scenes, holonomic and differential", all(one["outcome"] == "success" for one in mine)),
            ("it touches nothing in still worlds", every["collisions"] == 0),
            ("it takes no gap below the width of its circle", every[below] == 0),
            ("it arrives or says that it knows no further", every["arrived"] + every["gave up"] == every["worlds"]),
        ],
    )  # fmt: skip


def _own(one: Record) -> list[str]:
    """What only OperativeCriticalPointBug counts of a scene."""
    times = (number(one[name], 1) for name in ("moving", "rotating", "detecting"))
    return [str(one["iterations"]), number(one["rotation"], 2), *times, f"{one['avoided']} / {one['seen']}"]
