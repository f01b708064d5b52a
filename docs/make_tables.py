"""Write the tables of the pages that the package itself can fill: ``python docs/make_tables.py``.

A table lies between ``<!-- table: NAME -->`` and ``<!-- end -->``; everything between the two is
replaced. ``tests/test_docs.py`` fails while a page is out of date.
"""

import re
import tomllib
from importlib import import_module, resources
from pathlib import Path

import settings_tables
from conevo import METHODS, WORLDS
from conevo.runs.config import resolve
from conevo.runs.layers import PRESETS
from conevo.runs.settings import declared, preset_purpose
from conevo.worlds.gacc.plans import TYPES
from conevo.worlds.gacc.world import GaccParams, GaccWorld
from conevo.worlds.pursuit.prey import PreyParams, PreyWorld
from conevo.worlds.pursuit.world import PursuitParams, PursuitWorld
from conevo.worlds.rover import rocks
from conevo.worlds.rover.world import RoverParams

ROOT = Path(__file__).resolve().parent.parent
PAGES = ("README.md", "docs/quickstart.md", "docs/settings.md", "docs/worlds.md", "docs/cite.md")
MARKED = re.compile(r"(<!-- table: ([^>]+?) -->\n).*?(<!-- end -->)", re.DOTALL)


def table(head, rows):
    """Return a Markdown table."""
    lines = [head, ["---"] * len(head), *rows]
    return "".join(f"| {' | '.join(map(str, line))} |\n" for line in lines)


def worlds_by_methods():
    """Return the presets that have sizes for each method in each world."""
    rows = []
    for name, entry in METHODS.items():
        cells = []
        for world in WORLDS.values():
            have = [preset for preset in PRESETS if _has_sizes(preset, world.short_name, name)]
            cells.append("all presets" if len(have) == len(PRESETS) else ", ".join(have) or "none")
        rows.append([f"`{name}`", entry.title, entry.summary, *cells])
    worlds = [f"`{world.name}` ({world.title})" for world in WORLDS.values()]
    return table(["method", "published as", "description", *worlds], rows)


def _has_sizes(preset, world, method):
    """Return whether a preset has sizes for a method, or its family, in a world or in any."""
    tables = tomllib.loads(_preset_text(preset))
    methods = {name for part in (world, "any") for name in tables.get(part, {}).get("method", {})}
    return method in methods or METHODS[method].family in methods


def _preset_text(preset):
    return (resources.files("conevo.runs") / "presets" / f"{preset}.toml").read_text()


def presets(task, has_purpose=True):
    """Return the sizes of each preset for CONE in a task."""
    rows = []
    for preset in PRESETS:
        config = resolve(task, "cone", preset)
        run, method = config.run, config.method_config
        rows.append(
            [
                f"`{preset}`",
                *([preset_purpose(preset)] if has_purpose else []),
                f"{run.generations:,}",
                f"{run.budget_evaluations:,}" if run.budget_evaluations else "none",
                f"{run.epochs} x {config.world_params.iterations:,}",
                method.evaluation,
                method.genotypes,
                run.n_tests,
            ]
        )
    head = (
        "preset | purpose | generations at most | budget of team evaluations | epochs x iterations"
    )
    head += " | evaluation | genotypes per sub-population | test scenarios"
    heads = head.split(" | ")
    return table(heads if has_purpose else [heads[0], *heads[2:]], rows)


def card(module):
    """Return the table on the card of a world, the docstring of its module, in Markdown."""
    lines = import_module(module).__doc__.splitlines()
    first, last = (k for k, line in enumerate(lines) if re.fullmatch(r"=+ +=+", line))
    rows = []
    for line in lines[first + 1 : last]:
        name, text = re.split(r" {2,}", line, maxsplit=1)
        if name:
            rows.append([name, text])
        else:
            rows[-1][1] += f" {text}"
    return table(["", ""], [[name, text.replace("``", "`")] for name, text in rows])


def construction_environments():
    """Return objects, obstacles and complex objects of every environment of gathering."""
    rows = []
    for name in WORLDS["gacc-v2"].environments:
        plan = GaccWorld(name).plan
        counts = [int((plan.object_types == kind).sum()) for kind in range(len(TYPES))]
        built = [
            "".join(TYPES[kind] for kind in parts) + ("" if ordered else " in any order")
            for parts, ordered in zip(plan.parts.tolist(), plan.is_ordered, strict=True)
        ]
        rows.append([f"`{name}`", *counts, plan.n_obstacles, ", ".join(built)])
    return table(["environment", *TYPES, "obstacles", "complex objects"], rows)


def rover_environments():
    """Return canal layout and rocks of every multi-rover environment."""
    rows = []
    for kind in ("simple", "complex", "apart"):
        same = {tuple(rocks.mix(f"{kind}-{e}")) for e in range(1, 11)}
        assert len(same) == 1, kind
        rows.append([f"`{kind}-1` to `{kind}-10`", "1 to 10", *same.pop()])
    for e in range(1, 11):
        name = f"extended-{e}"
        rows.append([f"`{name}`", rocks.layout(name), *rocks.mix(name)])
    return table(["environment", "canal layout", *rocks.TYPES], rows)


def rover_apart():
    """Return the defaults of the environments ``apart`` next to those of the others."""
    others = RoverParams()
    rows = [[f"`{k}`", f"`{value}`", f"`{getattr(others, k)}`"] for k, value in rocks.APART.items()]
    return table(["parameter", "in `apart-1..10`", "in the others"], rows)


def rover_settings():
    """Return the three sensor settings with their defaults."""
    p = RoverParams()
    rows = [
        [name, *(getattr(p, f"{name}_{what}") for what in ("range", "accuracy", "cost"))]
        for name in ("low", "med", "hi")
    ]
    return table(["setting", "range (sides)", "accuracy", "cost (energy)"], rows)


def parameters(params):
    """Return every parameter of a world with unit, default and bounds."""
    rows = []
    for one in declared(params):
        value = str(one.default).lower() if isinstance(one.default, bool) else one.default
        default = f"`{value}`" if value != "" else ""
        meaning = one.meaning.replace("``", "`")
        rows.append([f"`{one.name}`", default, one.unit, one.allowed, meaning])
    return table(["parameter", "default", "unit", "allowed", "meaning"], rows)


def team_types():
    """Return the predators and prey of every environment of pursuit-evasion (table 4.2)."""
    rows = []
    for name in WORLDS["pursuit-v2"].environments:
        world = PursuitWorld(name)
        rows.append([f"`{name}`", world.n_robots, world.n_prey])
    return table(["environment", "predators", "prey"], rows)


def shaping_experiments():
    """Return the contents of the arena of every shaping experiment (section 4.3)."""
    rows = []
    for name in WORLDS["prey-v2"].environments:
        scenarios = PreyWorld(name).scenarios(range(200))
        others = scenarios.n_bodies - PreyWorld(name).n_robots
        spans = [
            f"{some.min()} to {some.max()}" if some.max() else "none"
            for some in (scenarios.n_obstacles, others)
        ]
        rows.append([f"`{name}`", PreyWorld(name).n_robots, *spans])
    return table(["environment", "prey", "obstacles", "heuristic predators"], rows)


def citation():
    """Return CITATION.cff as entries of BibTeX."""
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")

    def field(name):
        return re.search(rf'^[ -]*{name}: "?([^"\n]+?)"?$', text, re.MULTILINE)[1]

    title = re.search(r"^    title: (.+)$", text, re.MULTILINE)[1]
    entries = {
        "phdthesis{nitschke2009": {
            "author": f"{field('family-names')}, {field('given-names')}",
            "title": title,
            "school": re.search(r"institution:\n +name: (.+)", text)[1],
            "year": field("year"),
        },
        "software{conevo": {
            "author": "{conevo contributors}",
            "title": field("title"),
            "version": field("version"),
            "license": field("license"),
        },
    }
    lines = ["```bibtex"]
    for entry, fields in entries.items():
        lines += [f"@{entry},", *(f"  {key} = {{{text}}}," for key, text in fields.items()), "}"]
    return "\n" + "\n".join([*lines, "```"]) + "\n\n"


TABLES = {
    "citation": citation,
    "settings run": lambda: settings_tables.run_settings(table),
    "settings world": lambda: settings_tables.world_settings(table),
    "settings controller": lambda: settings_tables.controller_settings(table),
    "settings method": lambda: settings_tables.method_settings(table),
    "worlds x methods": worlds_by_methods,
    "presets": lambda: presets("rover/complex-1"),
    "presets pursuit": lambda: presets("pursuit/team-3", has_purpose=False),
    "presets gacc": lambda: presets("gacc/complex-1", has_purpose=False),
    "rover card": lambda: card("conevo.worlds.rover.world"),
    "rover environments": rover_environments,
    "rover apart": rover_apart,
    "rover settings": rover_settings,
    "rover parameters": lambda: parameters(RoverParams),
    "pursuit card": lambda: card("conevo.worlds.pursuit.world"),
    "pursuit environments": team_types,
    "pursuit parameters": lambda: parameters(PursuitParams),
    "prey card": lambda: card("conevo.worlds.pursuit.prey"),
    "prey environments": shaping_experiments,
    "prey parameters": lambda: parameters(PreyParams),
    "gacc card": lambda: card("conevo.worlds.gacc.world"),
    "gacc environments": construction_environments,
    "gacc parameters": lambda: parameters(GaccParams),
}


def updated(text):
    """Return a page with all its tables brought up to date."""
    return MARKED.sub(lambda m: f"{m[1]}{TABLES[m[2]]()}{m[3]}", text)


def main():
    """Bring all pages up to date."""
    for page in PAGES:
        path = ROOT / page
        text = path.read_text(encoding="utf-8")
        if (new := updated(text)) != text:
            path.write_text(new, encoding="utf-8")
            print(f"{page}: written")


if __name__ == "__main__":
    main()
