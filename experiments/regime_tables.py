"""The regime map in tables: values of every cell, castes, and the rule's predictions."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from conevo.report.statistics import Estimate, compare
from pages import table
from regime_cells import (
    CLONES,
    INDIVIDUAL,
    REGIONS,
    Cell,
    Judged,
    apart,
    judge,
    of_region,
    trends_of,
    used,
)

__all__ = ["PAGE_PARTS", "judged", "regime_words"]

KEYS = ["ranges", "accuracies", "segregation"]


def key(cell: Cell) -> list[str]:
    """Return the first columns of a cell's row."""
    return [cell.ranges, cell.accuracies, f"{cell.regime.segregation:g}"]


def regime_words(cell: Cell) -> str:
    """Return a cell in words."""
    return f"{cell.ranges} ranges, {cell.accuracies} accuracies, {cell.regime.segregation:g}"


def number(value: float | None, form: str = ".2f") -> str:
    """Return a number, or a dash for None; 0 has no sign."""
    if value is None or math.isnan(value):
        return "–"
    text = f"{value:{form}}"
    return text.replace("-", "−") if float(text) else text.lstrip("+-")


def interval(low: float | None, high: float | None, form: str) -> str:
    """Return an interval, or a dash for None."""
    return "–" if low is None else f"{number(low, form)} to {number(high, form)}"


def percent(share: float | None) -> str:
    """Return a share in percent, with its sign."""
    return "–" if share is None else f"{number(100 * share, '+.1f')} %"


def values(cells: Sequence[Cell]) -> str:
    """Return the value of both methods in each cell, and their difference."""
    head = [*KEYS, "n of both", "HomES (sd)", "CONE-ES (sd)", "difference", "95 % interval"]
    head += ["of the clones'", "interval of it", "p, Holm", "decided"]
    lines = []
    for cell in cells:
        of = cell.value
        bold = "**" if cell.is_clear else ""
        line = [*key(cell), f"{of.n_b}, {of.n_a}"]
        for mean, sd in ((of.mean_b, of.sd_b), (of.mean_a, of.sd_a)):
            line.append(f"{number(mean, '.0f')} ({number(sd, '.0f')})")
        line.append(f"{bold}{number(of.difference, '+.0f')}{bold}")
        line.append(interval(of.low, of.high, "+.0f"))
        line.append(percent(cell.share(of.difference)))
        low, high = cell.share(of.low), cell.share(of.high)
        line.append("–" if low is None else f"{percent(low)} to {percent(high)}")
        line += [number(cell.p, ".3f"), cell.verdict]
        lines.append(line)
    clear = [cell.value.difference or 0 for cell in cells if cell.is_clear]
    above, n = sum(one > 0 for one in clear), sum(cell.value.low is not None for cell in cells)
    return (
        table(head, lines)
        + f"\n{len(cells)} cells, {n} with an interval; it excludes 0 in {len(clear)}: CONE-ES is "
        f"above HomES in {above}, below in {len(clear) - above}. If nothing differed anywhere, "
        f"about {n / 20:.1f} would.\n"
    )


def trends(cells: Sequence[Cell]) -> str:
    """Return the trends over cells of the same ranges and accuracies."""
    head = ["ranges", "accuracies", "cells", "mean difference", "95 % interval"]
    head += ["from mixed to apart", "95 % interval"]
    lines = []
    for one in trends_of(cells):
        line = [one.cells[0].ranges, one.cells[0].accuracies, len(one.cells)]
        for of in (one.mean, one.slope):
            line += ["–", "–"] if of is None else [estimated(of), interval(of.low, of.high, "+.0f")]
        lines.append(line)
    return table(head, lines)


def estimated(of: Estimate) -> str:
    """Return a difference, bold where its interval excludes 0."""
    is_clear = of.low is not None and of.high is not None and of.low * of.high > 0
    text = number(of.value, "+.0f")
    return f"**{text}**" if is_clear else text


def deviations(cells: Sequence[Cell]) -> str:
    """Return CONE-ES's own numbers on deviations in the last generation, mean over runs."""
    head = [*KEYS, "team over clones of its mean", "in runs", "signal", "share of pairs"]
    lines = []
    for cell in cells:
        worth = cell.each(INDIVIDUAL, "individual_worth")
        ratios = [(1 + one) / (1 - one) for one in worth]
        if ratios:
            line = [*key(cell), number(float(np.median(ratios)))]
            line.append(f"{number(min(ratios))} to {number(max(ratios))}")
            for name in ("individual_signal", "individual_share"):
                line.append(number(cell.mean(INDIVIDUAL, name)))
            lines.append(line)
    return table(head, lines)


def castes(cells: Sequence[Cell]) -> str:
    """Return the measures that S does not cover, next to S: settings, regions and places."""
    head = [*KEYS, "favourite's share: HomES", "CONE-ES", "difference (95 %)"]
    head += ["between regions: HomES", "CONE-ES", "in place: HomES", "CONE-ES", "S: HomES"]
    head += ["CONE-ES"]
    lines = []
    for cell in cells:
        line = key(cell)
        both = [cell.each(method, "favourite share") for method in (CLONES, INDIVIDUAL)]
        more = compare(both[1], both[0])
        line += [number(float(np.mean(one)) if one else None) for one in both]
        around = interval(more.low, more.high, "+.2f")
        line.append(f"{number(more.difference, '+.2f')} ({around})")
        for what in (apart, "in place", "S"):
            line += [number(cell.mean(method, what)) for method in (CLONES, INDIVIDUAL)]
        lines.append(line)
    return table(head, lines)


def settings(cells: Sequence[Cell]) -> str:
    """Return the settings used by the robots of each region: low / med / hi in percent."""
    head = [*KEYS, "method", *(f"region {region}" for region in REGIONS)]
    lines = []
    for cell in cells:
        for method, title in ((CLONES, "HomES"), (INDIVIDUAL, "CONE-ES")):
            runs = [row for row in cell.runs[method] if used("A", "low") in row]
            if runs:
                shares = [
                    np.nanmean([of_region(row, region) for row in runs], axis=0)
                    for region in REGIONS
                ]
                texts = [" / ".join(f"{100 * part:.0f}" for part in one) for one in shares]
                lines.append([*key(cell), title, *texts])
    return table(head, lines)


# --- the rule -------------------------------------------------------------------------------------


def judged(cells: Sequence[Cell]) -> list[Judged]:
    """Return the rule, with the threshold found and with 1, and the predictors it must beat."""
    return [
        judge(cells, "the rule", lambda cell: cell.incentive),
        judge(cells, "the rule, threshold 1", lambda cell: cell.incentive, at=1.0),
        judge(cells, "segregation alone", lambda cell: cell.regime.segregation, near=0.5),
        judge(cells, "a detection's iterations alone", detection_iterations, near=10.0),
        judge(cells, "the same sign everywhere", lambda cell: 1.0),
    ]


def detection_iterations(cell: Cell) -> float:
    """Return the mean number of iterations that two rovers with setting med need for a rock."""
    return 1.0 / cell.regime.accuracies[1] ** 2


def rule(cells: Sequence[Cell]) -> str:
    """Return the number of cells with the predicted sign, for finding and for testing."""
    head = [
        "predicted by",
        "threshold",
        "right, of those for finding",
        "right, of those for testing",
    ]
    head += ["for testing, interval excludes 0: right", "wrong"]
    lines = [
        [
            one.name,
            limit_words(one.threshold),
            "{} of {}".format(*one.found),
            "{} of {}".format(*one.tested),
            listed(one.right),
            listed(one.wrong),
        ]
        for one in judged(cells)
    ]
    return table(head, lines) + f"\n{likeness(cells)}\n"


def limit_words(threshold: float) -> str:
    """Return a threshold as text, in words if it is below or above everything."""
    return {math.inf: "above all", -math.inf: "below all"}.get(threshold, number(threshold))


def listed(cells: Sequence[Cell]) -> str:
    """Return the number of cells, and the cells in words."""
    return f"{len(cells)}: " + "; ".join(map(regime_words, cells)) if cells else "none"


def likeness(cells: Sequence[Cell]) -> str:
    """Return the rank correlation of the rule's ratio and the difference's share."""
    from scipy.stats import spearmanr

    shares = [(cell.incentive, cell.share(cell.value.difference)) for cell in cells]
    known = [(ratio, share) for ratio, share in shares if share is not None]
    if len(known) < 3:
        return "Too few cells for a rank correlation."
    rank = float(spearmanr(*zip(*known, strict=True)).statistic)
    return (
        "Spearman's rank correlation of the rule's ratio and the difference as a share of the "
        f"clones' value, over {len(known)} cells: {number(rank, '+.2f')}."
    )


def predicted(cells: Sequence[Cell]) -> str:
    """Return the rule's prediction and the measured result for each cell."""
    limit = judged(cells)[0].threshold
    head = [*KEYS, "for", "castes / switchers by the rule", "predicted", "seen", "as predicted"]
    lines = []
    for cell in cells:
        of = cell.value.difference
        says = None if math.isnan(limit) else cell.incentive > limit
        seen = None if of is None else of > 0
        line = [*key(cell), "finding" if cell.is_for_finding else "testing"]
        line += [f"{cell.incentive:.2f}", better(says), better(seen)]
        line[-1] += " (clear)" if cell.is_clear else ""
        is_known = says is not None and seen is not None
        lines.append([*line, ("yes" if says == seen else "no") if is_known else "–"])
    return table(head, lines)


def better(is_individual: bool | None) -> str:
    """Return the better method, or a dash if that is not known."""
    return {True: "CONE-ES", False: "HomES", None: "–"}[is_individual]


PAGE_PARTS: dict[str, Callable[[Sequence[Cell]], str]] = {
    "values": values,
    "trends": trends,
    "rule": rule,
    "predicted": predicted,
    "castes": castes,
    "deviations": deviations,
    "settings": settings,
}
