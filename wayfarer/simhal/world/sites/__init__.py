"""Emulated sites of the paper's field trials (section IV-C): ``wayfarer sim --site``.

The paper shows them in photographs and gives no measures: all lengths here are chosen by us, by the look of
such places. ``docs/explanation/scenarios.md`` says what follows from that.
"""

from __future__ import annotations

from collections.abc import Mapping

from wayfarer.simhal.world.sites.dense_obstruction import DENSE_OBSTRUCTION
from wayfarer.simhal.world.sites.extended_maze import EXTENDED_MAZE
from wayfarer.simhal.world.sites.field_site import FieldSite
from wayfarer.simhal.world.sites.forest_escape import FOREST_ESCAPE

SITES: Mapping[str, FieldSite] = {site.name: site for site in (EXTENDED_MAZE, DENSE_OBSTRUCTION, FOREST_ESCAPE)}
