# SPDX-License-Identifier: Apache-2.0
"""The table that scripts/results and scripts/bench print: figure, goal, measured, spread, met."""
import statistics


class Table:
    """Rows of figures, each of which was measured several times.

    judge: "every" value has to meet the goal (accuracy, over seeds), or the "median" (times, over rounds: a machine is
    never quite undisturbed).
    """

    def __init__(self, spread, judge):
        self.rows, self.spread, self.judge = [], spread, judge

    def add(self, figure, values, unit, goal=None, at_least=False):
        known = [value for value in values if value is not None]
        measured = statistics.median(known) if len(known) == len(values) and known else None
        met = None
        if goal is not None:
            judged = [measured] if self.judge == "median" else known
            met = measured is not None and (min(judged) >= goal if at_least else max(abs(v) for v in judged) <= goal)
        self.rows.append({"figure": figure, "goal": None if goal is None else f"{'>=' if at_least else '<='} {goal:g}",
                          "measured": measured, "lowest": min(known, default=None),
                          "highest": max(known, default=None), "unit": unit, "met": met})

    def markdown(self):
        lines = [f"| figure | goal | measured | {self.spread} | met |", "| --- | --- | --- | --- | --- |"]
        for row in self.rows:
            measured = "missing" if row["measured"] is None else f"{row['measured']:.3g} {row['unit']}".strip()
            spread = "" if row["lowest"] is None else f"{row['lowest']:.3g} to {row['highest']:.3g}"
            met = {None: "", True: "yes", False: "**no**"}[row["met"]]
            lines.append(f"| {row['figure']} | {row['goal'] or ''} | {measured} | {spread} | {met} |")
        return "\n".join(lines)
