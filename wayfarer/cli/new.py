"""``wayfarer new``: writes a driver or an algorithm to begin with, and its test."""

from __future__ import annotations

from enum import StrEnum
from importlib.resources import files
from importlib.util import find_spec
from keyword import iskeyword
from pathlib import Path
from typing import Annotated

import typer

import wayfarer
from wayfarer.cli.options import examples
from wayfarer.errors import BadInput

EXAMPLES = examples("wayfarer new algorithm spiral", "wayfarer new driver needle")


class Kind(StrEnum):
    """What can be begun."""

    algorithm = "algorithm"
    driver = "driver"


# The class in each skeleton, its file's name, and how it is tried.
SKELETONS = {
    Kind.algorithm: ("MyAlgorithm", "my_algorithm", "wayfarer sim --algorithm {name}.py --trials 20"),
    Kind.driver: (
        "MyCompass", "my_compass",
        "wayfarer sim --rover forestrover --depth bus --set parts.compass.driver={name}.py --trials 3",
    ),
}  # fmt: skip


def new(
    kind: Annotated[Kind, typer.Argument(metavar="algorithm|driver", help="What to begin.")],
    name: Annotated[str, typer.Argument(metavar="NAME", help="Of its file, without .py.")],
) -> None:
    """Write NAME.py, which works as it is, and its test, into this folder; nothing is overwritten."""
    if not (name.isascii() and name.isidentifier() and name[0].isalpha()) or iskeyword(name):
        raise BadInput(f"'{name}' cannot be the name of a Python module: take letters, digits and _, such as my_{kind}")
    if find_spec(name) is not None:
        raise BadInput(f"Python has a module {name} already, and one would hide the other: add to its name")

    own_class, own_file, try_it = SKELETONS[kind]
    target = "".join(part[:1].upper() + part[1:] for part in name.split("_"))
    texts = {
        Path(file.format(name)): _skeleton(file.format(own_file)).replace(own_class, target).replace(own_file, name)
        for file in ("{}.py", "test_{}.py")
    }
    if there := [str(path) for path in texts if path.exists()]:
        raise BadInput(f"{there[0]} is there already; take another name, or remove it first")
    for path, text in texts.items():
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    print(f"wrote {' and '.join(map(str, texts))}; next:")
    print(f"  pytest test_{name}.py" + ("" if find_spec("pytest") else "    (pip install pytest)"))
    print(f"  {try_it.format(name=name)}")


def _skeleton(file: str) -> str:
    shipped = files("wayfarer") / "skeletons"  # in a checkout they are examples
    folder = shipped if shipped.is_dir() else Path(wayfarer.__file__).parents[1] / "examples" / "own"
    return (folder / file).read_text(encoding="utf-8")
