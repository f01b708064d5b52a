"""Tables of all settings, with the value of each under every preset: for ``make_tables.py``."""

from collections import Counter
from functools import cache

from conevo import CONTROLLERS, METHODS, WORLDS
from conevo.runs.config import resolve
from conevo.runs.layers import PRESETS
from conevo.runs.settings import TYPES, RunSettings, declared, settings_of

HEAD = ["setting", "meaning", "allowed", "default", *PRESETS]


def shown(value):
    """Return a value as in a configuration file."""
    if value is None:
        return "left out"
    if value == "":
        return "empty"
    return f"`{str(value).lower() if isinstance(value, bool) else value}`"


def across(values):
    """Return the value of most worlds, and those of the others in brackets."""
    (common, _), *_ = Counter(values.values()).most_common(1)
    others = [f"{world} {shown(one)}" for world, one in values.items() if one != common]
    return shown(common) + (f" ({', '.join(others)})" if others else "")


def allowed(one):
    """Return type, bounds and unit of a setting."""
    kind = TYPES.get(type(one.default), "")
    words = one.allowed if kind in (one.allowed, "text", "") else f"{kind}, {one.allowed}"
    return f"{words} ({one.unit})" if one.unit else words


@cache
def settled(task, method, preset):
    """Return (section, setting, value) for everything that affects a run's results."""
    return settings_of(resolve(task, method, preset))


def values_of(method, preset, section):
    """Return {setting: {world: value}} of a section, in each world's first environment."""
    found = {}
    for world in WORLDS.values():
        task = f"{world.short_name}/{world.environments[0]}"
        for name, setting, value in settled(task, method, preset):
            if name == section:
                found.setdefault(setting.name, {})[world.short_name] = value
    return found


def rows(settings, method, section):
    """Return a row for each setting of a section."""
    by_preset = [values_of(method, preset, section) for preset in PRESETS]
    return [
        [
            f"`{section}.{one.name}`",
            one.meaning.replace("``", "`"),
            allowed(one),
            shown(one.default),
            *(across(values[one.name]) for values in by_preset),
        ]
        for one in settings
    ]


def run_settings(table):
    """Return the settings of a run."""
    return table(HEAD, rows(declared(RunSettings), "cone", "run"))


def world_settings(table):
    """Return the settings of worlds that a preset changes, in each world's first environment."""
    by_preset = [values_of("cone", preset, "world") for preset in PRESETS]
    lines = []
    for world in WORLDS.values():
        for one in declared(world.params_class):
            values = [found[one.name][world.short_name] for found in by_preset]
            if values != [one.default] * len(PRESETS):
                name = f"`world.{one.name}`"
                lines.append([f"`{world.name}`", name, shown(one.default), *map(shown, values)])
    return table(["world", "setting", "default", *PRESETS], lines)


def controller_settings(table):
    """Return the settings of every controller; presets change none of them."""
    head = HEAD[:4]
    text = ""
    for name, entry in CONTROLLERS.items():
        settings = declared(entry.settings_class)
        lines = [
            [f"`controller.{one.name}`", one.meaning, allowed(one), shown(one.default)]
            for one in settings
        ]
        text += f"\n### {entry.title}, `{name}`\n\n{table(head, lines)}"
    return text + "\n"


def method_settings(table):
    """Return the settings of every method; methods whose settings are the same share a table."""
    shared = {}
    for name, entry in METHODS.items():
        lines = rows(declared(entry.config_class), name, "method")
        shared.setdefault(tuple(map(tuple, lines)), []).append(entry)
    text = ""
    for lines, entries in shared.items():
        title = ", ".join(f"{entry.title} (`{entry.name}`)" for entry in entries)
        text += f"\n### {title}\n\n{table(HEAD, lines)}"
    return text + "\n"
