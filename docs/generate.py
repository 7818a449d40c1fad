"""Write the pages that the code knows best: ``python -m docs.generate``.

Python from the public names, the command line from its help, rover files from the JSON Schema of their settings, those
of a campaign from its class, the table of conditions and the safety case from that of the code. What a setting means
stands in the string below its field. The schema is in the package, beside the shipped rovers: editors read it there.
All are committed, because people read them in the checkout too; ``tests/docs/test_generated.py`` fails if one is old.
"""

from __future__ import annotations

import inspect
import io
import json
import os
from collections.abc import Iterator
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any
from unittest.mock import patch

import typer
from pydantic import TypeAdapter

import wayfarer
from docs import safety_case
from wayfarer import cli
from wayfarer.config.registry import driver_names, find_driver
from wayfarer.config.rover_file import RoverConfig
from wayfarer.config.rover_path import SCHEMA
from wayfarer.detector.witnesses import WITNESSES
from wayfarer.experiments.keys import OWN, TERRAIN, WORLD, ForestKeys, descriptions
from wayfarer.experiments.settings import FORMS, NAMES, CampaignSettings, option_of, plain_kind, sentences
from wayfarer.fieldlog.wording import sentence
from wayfarer.safety.conditions import TABLE, Condition
from wayfarer.simhal.world.physics import Physics, Terrain
from wayfarer.vocabulary import WORDS

FOLDER = Path(__file__).parent / "reference"
STOPS = Path(__file__).parent / "explanation" / "what-stops-the-wheels.md"
CASE = STOPS.with_name("safety-case.md")
WITNESSED = STOPS.with_name("witnesses.md")
BOUNDS = {"minimum": "from", "exclusiveMinimum": "above", "maximum": "to", "exclusiveMaximum": "below"}
WRITTEN_BY = "<!-- Written by `python -m docs.generate`: change the code instead. -->\n"

PYTHON = """# Python

`import wayfarer` takes a few milliseconds: each name below is imported when it is first used. Campaigns and trials
need the extra `sim`. For algorithms and drivers of your own, `wayfarer.escape`, `wayfarer.hal`,
`wayfarer.drivers.buses`, `wayfarer.errors` and `wayfarer.testing` are public as well. All else may change from one
version to the next.
"""
# The pages of the public names, by their titles: what one calls, then what it returns.
TOPICS = {
    "Campaigns and trials": ["run_campaign", "run_sweep", "run_trial", "open_results", "compare", "Results", "Trial"],
    "Recorded runs": ["open_run", "replay", "Run", "Plot"],
    "Escape and fail-safe": [
        "make_handler", "FailSafe", "StuckDetector", "load_rover", "Observation", "Anomaly", "EscapeSettings",
        "Vehicle", "WayfarerError",
    ],
}  # fmt: skip
COMMAND_LINE = """# Command line

Every command; its link leads to what its `--help` prints. A mistake gives one line and the exit code 2; something
that this computer may have later, such as the device file of an adapter, a host's name, an address or a port, gives 1.
A command that has done its work gives 0.
"""
SIMULATION = "Simulation"  # the commands that help shows first, under no heading of their own
ROVER_FILE = """# Rover file

A rover file is TOML. It names a rover's parts, and what differs from the defaults below; only `name` and the keys of
`[vehicle]` without a default are required. An unknown key, or a value out of its range, is one line that names
file, key and what is allowed. The files that come with wayfarer are in `wayfarer/rovers`.

[rover.schema.json](../../wayfarer/rovers/rover.schema.json) is the JSON Schema of all this. If its path is in the
first line, as in the shipped files and in those that `wayfarer init` writes, editors that know TOML schemas (Tombi,
Even Better TOML) complete keys, show what they mean and mark mistakes:

```toml
#:schema ./rover.schema.json
```
"""
CAMPAIGN = """# Settings of a campaign

All that decides the results of a campaign. `wayfarer sim` and `wayfarer sweep` have an option for each,
`wayfarer.run_campaign`, `run_sweep`, `run_trial` and the environment an argument, and `campaign.json` keeps them with
the results.
"""
KEYS = """## Keys

What `--set KEY=VALUE` sets for all trials, `--set KEY=LOW:HIGH` draws for each trial, and `wayfarer sweep KEY=VALUES`
varies. In Python `set={"senses": "field", "sim.slope_deg": (0, 15)}`. Every number can be drawn: uniformly between the
bounds, and a whole number if the key counts something. Each key has a separate random stream, so that drawing another
key as well changes nothing for it. What was drawn is a column of `trials.csv`. A key of `sim.` counts before `senses`.

Beside these keys there is every key of [the rover file](rover-file.md) by its dotted name, such as
`escape.turn_angle_deg`; `wayfarer list --keys` prints them all.
"""


def pages() -> dict[Path, str]:
    """Return the text of each generated file."""
    schema = rover_schema()
    return {
        FOLDER / "python.md": "\n".join([WRITTEN_BY, PYTHON, *map(_topic_table, TOPICS)]),
        **{FOLDER / _place("python", topic): _topic_page(topic) for topic in TOPICS},
        FOLDER / "command-line.md": "\n".join(
            [WRITTEN_BY, COMMAND_LINE, *map(_panel_table, panels()), _command_section(())]
        ),
        **{FOLDER / _place("command-line", panel): _panel_page(panel) for panel in panels()},
        FOLDER / "campaign-settings.md": "\n".join([WRITTEN_BY, CAMPAIGN, _settings_table(), KEYS, _keys_table()]),
        FOLDER / "rover-file.md": "\n".join([WRITTEN_BY, ROVER_FILE, *_rover_sections(schema)]),
        SCHEMA: json.dumps(schema, indent=1, ensure_ascii=False) + "\n",
        CASE: WRITTEN_BY + safety_case.page(),
        WITNESSED: _with_part(WITNESSED.read_text(encoding="utf-8"), "witnesses", _witness_table()),
        STOPS: _with_part(STOPS.read_text(encoding="utf-8"), "conditions", _condition_table()),
    }


def _place(page: str, title: str) -> str:
    return f"{page}-{title.lower().replace(' ', '-')}.md"


def _with_part(page: str, name: str, text: str) -> str:
    """Return a page with another text between its marks ``<!-- name -->`` and ``<!-- /name -->``."""
    before, begin, rest = page.partition(f"<!-- {name} -->\n")
    _, end, after = rest.partition(f"<!-- /{name} -->\n")
    assert begin and end, f"the page has no marks of {name}"
    return before + begin + text + end + after


# -- Python ------------------------------------------------------------------------------------------------------------


def _topic_table(topic: str) -> str:
    rows = (f"| `{name}` | {_first_line(getattr(wayfarer, name))} |\n" for name in TOPICS[topic])
    return f"## [{topic}]({_place('python', topic)})\n\n| name | what it is |\n|---|---|\n" + "".join(rows)


def _topic_page(topic: str) -> str:
    return "\n".join([WRITTEN_BY, f"# Python: {topic}\n", *(f"::: wayfarer.{name}\n" for name in TOPICS[topic])])


def _first_line(named: object) -> str:
    return (inspect.getdoc(named) or "").partition("\n")[0].replace("``", "`")


# -- conditions --------------------------------------------------------------------------------------------------------


def _condition_table() -> str:
    head = "| condition | level | kind | what is wrong | what the rover does | until |\n|---|---|---|---|---|---|\n"
    return head + "".join(f"| {' | '.join(_condition_cells(each))} |\n" for each in Condition)


def _condition_cells(condition: Condition) -> Iterator[str]:
    words = WORDS[condition]
    yield from (f"`{condition.value}`", safety_case.levels(condition), TABLE[condition].kind.value)
    yield from map(sentence, (words.what, words.does, words.ends_when))


def _witness_table() -> str:
    head = "| `anomaly_source` | part | stood | moved | nothing | cannot see |\n|---|---|---|---|---|---|\n"
    rows = ((f"`{name}`", each.part or "compass", *map(sentence, each[1:])) for name, each in WITNESSES.items())
    return head + "".join(f"| {' | '.join(row)} |\n" for row in rows)


# -- command line ------------------------------------------------------------------------------------------------------


def commands(group: Any = None, path: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    """Yield every command and group by its words, the whole program first."""
    command = group or _program()
    yield path
    for name, each in getattr(command, "commands", {}).items():
        if not each.hidden:
            yield from commands(each, (*path, name))


def panels() -> dict[str, list[str]]:
    """Return the commands under each heading of ``wayfarer --help``."""
    found: dict[str, list[str]] = {SIMULATION: []}
    for name, each in _program().commands.items():
        panel = each.rich_help_panel
        found.setdefault(panel if isinstance(panel, str) else SIMULATION, []).append(name)
    return found


def _panel_table(panel: str) -> str:
    place = _place("command-line", panel)
    rows = (
        f"| [`wayfarer {name}`]({place}#wayfarer-{name}) | {_program().commands[name].get_short_help_str(200)} |\n"
        for name in panels()[panel]
    )
    return f"## {panel}\n\n| command | what it does |\n|---|---|\n" + "".join(rows)


def _panel_page(panel: str) -> str:
    shown = (_command_section(words) for words in commands() if words and words[0] in panels()[panel])
    return "\n".join([WRITTEN_BY, f"# Commands: {panel}\n", *shown])


def _program() -> Any:
    return typer.main.get_command(cli.app)


def _command_section(words: tuple[str, ...]) -> str:
    shown = io.StringIO()
    with redirect_stdout(shown), patch.dict(os.environ, {"COLUMNS": "80", "NO_COLOR": "1"}):
        cli.run([*words, "--help"])
    text = "\n".join(line.rstrip() for line in shown.getvalue().splitlines()).strip("\n")
    return f"## {' '.join(('wayfarer', *words))}\n\n```text\n{text}\n```\n"


# -- settings of a campaign --------------------------------------------------------------------------------------------


def _settings_table() -> str:
    about, properties = sentences(CampaignSettings), _properties(plain_kind())
    rows = ["| setting | option | default | allowed | what it is |", "|---|---|---|---|---|"]
    for name in NAMES:
        form = FORMS.get(name)
        default = form.default if form else properties[name].get("default")
        shown = "" if default in ("", None) else f"`{json.dumps(default) if not form else default}`"
        allowed = f"`{form.metavar}`".replace("|", "\\|") if form else _allowed(properties[name])
        rows.append(f"| `{name}` | `{option_of(name)}` | {shown} | {allowed} | {_plain(about[name], 'description')} |")
    return "\n".join(rows) + "\n"


def _keys_table() -> str:
    own = {name: schema for name, schema in _properties(plain_kind()).items() if name in OWN}
    world = {
        WORLD + key: schema for kind in (ForestKeys, Physics, Terrain) for key, schema in _properties(kind).items()
    }
    rows = ["| key | default | allowed | what it is |", "|---|---|---|---|"]
    for key, text in descriptions().items():
        schema = own.get(key) or world.get(key)
        default, allowed = (f"`{json.dumps(schema['default'])}`", _allowed(schema)) if schema else ("", "")
        where = "MuJoCo: " if key.removeprefix(WORLD) in TERRAIN else ""
        rows.append(f"| `{key}` | {default} | {allowed} | {where}{_plain(text, 'description')} |")
    return "\n".join(rows) + "\n"


def _properties(kind: Any) -> dict[str, Any]:
    """Return the JSON Schema of each field of a settings class."""
    schema = TypeAdapter(kind).json_schema()
    return {
        name: {**schema.get("$defs", {}).get(_reference(each), {}), **each}
        for name, each in schema["properties"].items()
    }


# -- rover files -------------------------------------------------------------------------------------------------------


def rover_schema() -> dict[str, Any]:
    """Return the JSON Schema of rover files, with the settings of the drivers that come with wayfarer.

    A part with another driver, ``"module:attribute"``, may have any settings.
    """
    schema = _described(RoverConfig.model_json_schema(ref_template="#/$defs/{model}"), RoverConfig)
    for field in RoverConfig.model_fields.values():
        if isinstance(table := field.annotation, type) and table.__name__ in schema["$defs"]:
            _described(schema["$defs"][table.__name__], table)
    by_part: dict[str, list[dict[str, Any]]] = {}
    for name in driver_names():
        driver = find_driver(name)
        if driver.__module__.startswith("wayfarer."):
            settings = _described(TypeAdapter(driver.Settings).json_schema(), driver.Settings)
            own = {
                "title": name,
                "description": settings["description"],
                "type": "object",
                "properties": {"driver": {"const": name}, **settings.get("properties", {})},
                "required": ["driver", *settings.get("required", [])],
                "additionalProperties": False,
            }
            by_part.setdefault(driver.part, []).append(own)
    parts = schema["properties"]["parts"]
    parts |= {"additionalProperties": False, "properties": {part: _one_of(by_part[part]) for part in sorted(by_part)}}
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **_plain(schema)}


def _one_of(drivers: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the schema of a part, which has one of these drivers, or one of another package."""
    other = {"properties": {"driver": {"type": "string", "pattern": ":"}}, "required": ["driver"], "title": "other"}
    return {"anyOf": [*drivers, other]}


def _described(schema: dict[str, Any], table: type) -> dict[str, Any]:
    """Add to the schema of a table what its docstring says, without examples, and what those of its fields say."""
    schema["description"] = inspect.cleandoc(table.__doc__ or "").partition("\n\n>>>")[0].partition("\n\nRaises:")[0]
    for key, text in sentences(table).items():
        schema["properties"][key]["description"] = text
    return schema


def _plain(schema: Any, key: str = "") -> Any:
    """Write whole bounds as whole numbers, and code in texts as Markdown has it; leave out fractional steps.

    ``Annotated`` gives 1 or 1.0, whichever was imported first. Some editors find that 0.3 is not a multiple of 0.1.
    """
    if isinstance(schema, list):
        return [_plain(each) for each in schema]
    if isinstance(schema, dict):
        return {each: _plain(value, each) for each, value in schema.items() if (each, value) != ("multipleOf", 0.1)}
    if key == "description":
        return schema.replace("``", "`")
    return int(schema) if key in BOUNDS and schema == int(schema) else schema


def _rover_sections(schema: dict[str, Any]) -> Iterator[str]:
    """Yield a section for each table of a rover file: what its docstring says, and its keys."""
    properties = dict(schema["properties"])
    parts = properties.pop("parts")["properties"]
    tables = {key: schema["$defs"][ref] for key, value in properties.items() if (ref := _reference(value))}
    plain = {key: value for key, value in properties.items() if key not in tables}
    yield _section("At the top", {**schema, "properties": plain})
    for key, table in tables.items():
        yield _section(f"`[{key}]`", table)
    for part, choices in parts.items():
        for choice in choices["anyOf"][:-1]:
            yield _section(f'`[parts.{part}]`, `driver = "{choice["title"]}"`', choice)


def _section(title: str, table: dict[str, Any]) -> str:
    rows = [_row(key, value, table) for key, value in table["properties"].items() if key != "driver"]
    keys = "\n".join(["| key | default | allowed | what it is |", "|---|---|---|---|", *rows])
    return f"## {title}\n\n{table['description']}\n\n{keys}\n"


def _row(key: str, value: dict[str, Any], table: dict[str, Any]) -> str:
    if key in table.get("required", []):
        default = "required"
    elif value.get("default") is None:
        default = "none"
    else:
        default = f"`{json.dumps(value['default'], ensure_ascii=False)}`"
    return f"| `{key}` | {default} | {_allowed(value)} | {value.get('description', '')} |"


def _reference(schema: dict[str, Any]) -> str:
    """Return the name of the definition that a schema refers to, empty if it refers to none."""
    return str(schema.get("$ref", "")).rpartition("/")[2]


def _allowed(schema: dict[str, Any]) -> str:
    """Say in words what a schema allows, values as code in Markdown."""
    choices = [each for each in schema.get("anyOf", [schema]) if each.get("type") != "null"]
    return " or ".join(_allowed_one(each) for each in choices)


def _allowed_one(schema: dict[str, Any]) -> str:
    if "enum" in schema or "const" in schema:
        values = schema.get("enum") or [schema["const"]]
        return ", ".join(f"`{json.dumps(each)}`" for each in values)
    if schema["type"] == "array":
        return f"a list: {_allowed(schema.get('items') or schema.get('prefixItems', [{}])[0])}"
    if schema["type"] == "boolean":
        return "`true` or `false`"
    if schema["type"] == "string":
        return f"text, at most {schema['maxLength']} characters" if "maxLength" in schema else "text"
    bounds = [f"{words} {schema[bound]:g}" for bound, words in BOUNDS.items() if bound in schema]
    return " ".join([{"number": "number", "integer": "whole number"}[schema["type"]], *bounds])


def write() -> None:
    """Write every generated file."""
    for path, text in pages().items():
        path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    write()
