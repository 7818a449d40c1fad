"""Code of one's own: loads ``FILE.py:NAME`` or ``"module:attribute"``, and says what is wrong with it.

A file is a module with a separate name, known before it is executed (pickle and dataclasses ask for it), and its folder
comes last in ``sys.path``: it may import its neighbours, and hides nobody else's module. Root loads no file that
another user could have written.
"""

from __future__ import annotations

import importlib
import os
import stat
import sys
import threading
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from hashlib import blake2b
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from traceback import extract_tb
from types import ModuleType
from typing import Any, NamedTuple

from wayfarer.errors import BadInput, WayfarerError, kind_and_text, near_names, one_line
from wayfarer.files import read_regular

MOST_BYTES = 10_000_000  # chosen by us: a thousand times a long one
OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH


class OwnFile(NamedTuple):
    """Which file somebody's own code came from: its whole path, and the BLAKE2b checksum of its content."""

    path: str
    blake2b: str


def names_file(name: str) -> bool:
    """Return whether a name stands for a file: a slash or ``.py`` decides."""
    path, _ = split(name)
    return "/" in path or path.endswith(".py")


def split(name: str) -> tuple[str, str]:
    """Return the file or module of a name, and what in it is meant; nothing if the name does not say."""
    path, _, attribute = name.rpartition(":")
    return (path, attribute) if path and "/" not in attribute and not attribute.endswith(".py") else (name, "")


def whole_name(kind: str, name: str, folder: Path | None = None) -> str:
    """Return a name with the whole path of its file; one of something else unchanged.

    Args:
        kind: what is wanted, for errors.
        name: relative to ``folder``, else to the current folder.
        folder: that of the rover file.

    Raises:
        BadInput: there is no such file; the text says where it was looked for, and offers the nearest names.
    """
    if not names_file(name):
        return name
    path, attribute = split(name)
    places, beside_it = [(place / path).parent for place in _folders(folder)], list[str]()
    for place in places:
        with suppress(OSError, RuntimeError, ValueError):  # no name of a file, such as a long one, or links in a circle
            there = place.resolve() / Path(path).name
            if path.endswith(".py") and there.is_file():
                return f"{there}:{attribute}".removesuffix(":")
            beside_it += sorted(file.stem for file in place.glob("*.py"))
    near = near_names(Path(path).stem, beside_it)
    looked = " and ".join(dict.fromkeys(str(place) for place in places))
    if any(_is_folder(place / Path(path).name) for place in places):
        raise BadInput(one_line(f"{kind} '{name}' is a folder; name a file in it, such as {path.rstrip('/')}/mine.py"))
    hint = f"; did you mean {' or '.join(f'{each}.py' for each in near)}?" if near else ""
    hint = hint if any(map(_is_folder, places)) else "; there is no such folder"
    raise BadInput(one_line(f"{kind} '{name}': no such file {Path(path).name}; looked in {looked}{hint}"))


def beside(name: str, folder: Path | None = None) -> str:
    """Return what to write in place of a name if a file of that name is there: an end of an error, else nothing."""
    module, attribute = split(name)
    for place in _folders(folder):
        with suppress(OSError):  # its name is too long
            if module.isidentifier() and (place / f"{module}.py").is_file():
                return f"; a file {module}.py is in {place}: write {module}.py:{attribute}".removesuffix(":")
    return ""


def _folders(folder: Path | None) -> list[Path]:
    """Return where files are looked for: the rover file's folder first."""
    return list(dict.fromkeys([*([] if folder is None else [folder.resolve()]), Path.cwd()]))


def _is_folder(path: Path) -> bool:
    with suppress(OSError, RuntimeError, ValueError):
        return path.is_dir()
    return False


# -- loading -----------------------------------------------------------------------------------------------------------

_LOADED: dict[str, tuple[ModuleType, str]] = {}  # by whole path: the module, and the checksum of what was executed
_LOCK = threading.RLock()  # a Dask worker runs trials in several threads


def load(kind: str, name: str) -> ModuleType:
    """Return the module of ``FILE.py:NAME`` or ``"module:attribute"``; each is executed once.

    Raises:
        BadInput: it is not there, root must not run it, or it failed while it ran; the text says which of these.
    """
    return _loaded(kind, name)[0] if names_file(name) else _imported(kind, name, split(name)[0])


def _loaded(kind: str, name: str) -> tuple[ModuleType, str]:
    path, _ = split(whole_name(kind, name))
    with _LOCK:
        if path not in _LOADED:
            source = _read(kind, name, path)
            checksum = blake2b(source, digest_size=16).hexdigest()
            _LOADED[path] = _executed(kind, name, path, source, checksum), checksum
        return _LOADED[path]


def _read(kind: str, name: str, path: str) -> bytes:
    try:
        if os.geteuid() == 0 and (order := _that_closes(path)):
            raise BadInput(
                f"{kind} '{name}': another user can change {path}, and root would run it; {order}, or run this as that "
                "user"
            )
        return read_regular(Path(path), MOST_BYTES)
    except OSError as error:
        raise BadInput(f"{kind} '{name}': {path} cannot be read: {error.strerror}") from None


def _that_closes(path: str) -> str:
    """Return the command that takes the right to change a file from all but root; nothing if only root has it."""
    real, named = Path(path).resolve(), Path(path)
    for place in dict.fromkeys((real, *real.parents, *named.parents)):
        about = place.stat()
        if about.st_uid != 0:
            return f"sudo chown root {place}"
        # In a folder such as /tmp nobody can replace a folder of root.
        if about.st_mode & OTHERS_WRITE and not (about.st_mode & stat.S_ISVTX and place not in {real, real.parent}):
            return f"sudo chmod go-w {place}"
    return ""


def _executed(kind: str, name: str, path: str, source: bytes, checksum: str) -> ModuleType:
    place = blake2b(os.fsencode(path), digest_size=4).hexdigest()
    known_as = f"wayfarer_own_{Path(path).stem}_{place}_{checksum[:8]}"
    spec = spec_from_file_location(known_as, path)
    assert spec is not None
    module = sys.modules[known_as] = module_from_spec(spec)
    if (folder := str(Path(path).parent)) not in sys.path:
        sys.path.append(folder)
    try:
        # Not by its loader, which would take another file's bytecode for this one's, and write some beside it.
        exec(compile(source, path, "exec", dont_inherit=True), module.__dict__)
    except (Exception, SystemExit) as error:
        del sys.modules[known_as]
        raise _failed(kind, name, error, path) from error
    return module


def _imported(kind: str, name: str, module_name: str) -> ModuleType:
    try:
        return importlib.import_module(module_name)
    except (Exception, SystemExit) as error:  # somebody's module may raise anything while it is imported
        files = [each.filename for each in extract_tb(error.__traceback__)[1:] if "importlib" not in each.filename]
        if isinstance(error, SyntaxError) and not files:
            files = [str(error.filename or module_name)]
        missing = isinstance(error, ModuleNotFoundError) and f"{module_name}.".startswith(f"{error.name}.")
        if missing or not files:  # without a file that took part, the name itself cannot be one
            reason = one_line(error) or type(error).__name__
            hint = beside(name) or "; is it installed?"
            raise BadInput(f"{kind} '{name}': cannot import {module_name} ({reason}){hint}") from error
        raise _failed(kind, name, error, files[0]) from error


def _failed(kind: str, name: str, error: BaseException, path: str) -> BadInput:
    return BadInput(f"{kind} '{name}' failed while it was loaded: {_in_file(error, path)}")


def _in_file(error: BaseException, path: str) -> str:
    """Return an error with the last line of a file that took part in it."""
    frames = extract_tb(error.__traceback__)
    line = next((each.lineno for each in reversed(frames) if each.filename == path), None)
    what, end = kind_and_text(error), ""
    if isinstance(error, SyntaxError) and error.filename == path:
        line, what = error.lineno, f"{type(error).__name__}: {error.msg}"
    elif frames[-1].filename != path and "importlib" not in frames[-1].filename:
        end = f" (raised in {Path(frames[-1].filename).name}:{frames[-1].lineno})"
    if isinstance(error, ModuleNotFoundError) and error.name:
        missing = error.name.partition(".")[0]
        end = f"; correct the name, put {missing}.py beside it, or install it for {sys.executable}"
    return f"{Path(path).name}{f':{line}' if line else ''}: {what}{end}"


def own_mistake(error: BaseException) -> str | None:
    """Return an error with the last line of somebody's own file that took part in it; None if none did."""
    path = next((each.filename for each in reversed(extract_tb(error.__traceback__)) if each.filename in _LOADED), None)
    return None if path is None else _in_file(error, path)


class OwnMistake(BadInput):
    """Somebody's own code failed while something was made of it; ``what`` is what happened, without the remedy."""

    def __init__(self, what: str) -> None:
        super().__init__(f"{what}; correct that and run it again")
        self.what = what


@contextmanager
def blaming(what: str) -> Iterator[None]:
    """Raise ``OwnMistake``, which begins with ``what``, if a mistake in a file of one's own raises in this block."""
    try:
        yield
    except WayfarerError:
        raise
    except Exception as error:
        if mistake := own_mistake(error):
            raise OwnMistake(f"{what}: {mistake}") from error
        raise


# -- which files were used ---------------------------------------------------------------------------------------------


def used(whole_names: Mapping[str, str]) -> dict[str, OwnFile]:
    """Return the files among some names, by these; ``whole_names`` has the whole name of each.

    Raises:
        BadInput: as ``load``.
    """
    found = dict[str, OwnFile]()
    for name, whole in whole_names.items():
        if names_file(whole):
            found[name] = OwnFile(split(whole)[0], _loaded("file", whole)[1])
    return found


def as_used(name: str, files: Mapping[str, OwnFile]) -> str:
    """Return the whole name of what a file's name stood for when ``files`` were used; another name unchanged."""
    return f"{files[name].path}:{split(name)[1]}".removesuffix(":") if names_file(name) and name in files else name


def changed(name: str, files: Mapping[str, OwnFile]) -> str | None:
    """Return the file of a name that was loaded, if it is another one than in ``files``; else None."""
    if name not in files or files[name].path not in _LOADED or _LOADED[files[name].path][1] == files[name].blake2b:
        return None
    return Path(files[name].path).name


def check_same(files: Iterable[OwnFile]) -> None:
    """Load files, which must be what they were when a campaign began.

    Raises:
        BadInput: one is not there, has changed, or failed while it ran.
    """
    for file in files:
        if _loaded("file", file.path)[1] != file.blake2b:
            forget_changed()  # this worker may have loaded it for an earlier campaign
        if _loaded("file", file.path)[1] != file.blake2b:
            raise BadInput(f"{file.path} is not the file that the campaign began with; run the campaign again")


def forget_changed() -> None:
    """Let files that have changed be loaded again: somebody edits one and tries again, in a notebook."""
    with _LOCK:
        for path, (_, checksum) in list(_LOADED.items()):
            try:
                same = blake2b(Path(path).read_bytes(), digest_size=16).hexdigest() == checksum
            except OSError:
                same = False
            if not same:
                del _LOADED[path]


# -- what is in them ---------------------------------------------------------------------------------------------------


def attribute(kind: str, name: str, module: ModuleType) -> Any:
    """Return what a name means in its module; dots lead into it.

    Raises:
        BadInput: nothing of that name; the text offers the nearest ones.
    """
    path, wanted = split(name)
    found: Any = module
    for part in wanted.split("."):
        try:
            found = getattr(found, part)
        except AttributeError:
            near = near_names(wanted, [each for each in vars(module) if not each.startswith("_")])
            what = Path(path).name if names_file(name) else f"module {path}"
            hint = f": did you mean {' or '.join(near)}?" if near else ""
            raise BadInput(f"{kind} '{name}': {what} has no '{wanted}'{hint}") from None
    return found
