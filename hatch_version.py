"""The version of what is built: its git tag. Hatchling asks for it at each build (``[tool.hatch.version]``).

==================================================  ==========================================================
what is built                                       version
==================================================  ==========================================================
the commit with the tag ``v0.2.0``, unchanged       ``0.2.0``
a later commit, or changed files                    ``0.2.0+g1a2b3c4d``, ``0.2.0+dirty``, ``0.2.0+g1a2b3c4d.dirty``
a clone without tags: the changelog's last release  ``0.2.0+g1a2b3c4d``
no repository, or git refuses                       ``0.2.0+dev``
an unpacked source distribution                     what it was built with
what ``git archive`` wrote                          as the commit that it was written of
==================================================  ==========================================================

A package index takes no version with a ``+``, so nothing but a tag can be published.
"""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

ROOT = Path(__file__).parent
ARCHIVED = "$Format:%(describe:tags=true,match=v[0-9]*)$"  # git archive writes the answer here (.gitattributes)
DESCRIBE = ["git", "describe", "--tags", "--match=v[0-9]*", "--always", "--dirty", "--abbrev=8"]


def version(root: Path = ROOT) -> str:
    """Return the version of the project in a folder; it always has one."""
    distributed = root / "PKG-INFO"
    if distributed.is_file():
        return str(re.findall(r"^Version: (.+)$", distributed.read_text(encoding="utf-8"), re.MULTILINE)[0])
    described = _described_by_git(root) if (root / ".git").exists() else ARCHIVED
    return version_of(described, last_release(root))


def version_of(described: str, released: str) -> str:
    """Return the version that belongs to an answer of ``git describe``.

    Args:
        described: such as ``v0.2.0``, ``v0.2.0-3-g1a2b3c4d-dirty``, ``1a2b3c4d`` without tags, or anything else.
        released: the last release, for a repository without tags.
    """
    answer = re.fullmatch(r"(?:v(\d[^-]*)(?:-\d+-g(\w+))?|([0-9a-f]+))(-dirty)?", described)
    if answer is None:
        return f"{released}+dev"
    tagged, later, untagged, dirty = answer.groups()
    commit = later or untagged
    local = ".".join([f"g{commit}"] * bool(commit) + ["dirty"] * bool(dirty))
    return f"{tagged or released}+{local}".removesuffix("+")


def last_release(root: Path) -> str:
    """Return the newest version that has a heading in the changelog."""
    headings = re.findall(r"^## \[(\d[^]]*)\]", (root / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    return headings[0] if headings else "0"


def _described_by_git(root: Path) -> str:
    try:
        return subprocess.run(DESCRIBE, cwd=root, capture_output=True, text=True, check=False).stdout.strip()
    except OSError:  # there is no git
        return ""
