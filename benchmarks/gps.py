"""Distance of dead reckoning from the true path, before and after the fit to the receiver's fixes as in reports."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

from wayfarer.experiments.campaign import Task
from wayfarer.experiments.checks import make_campaign
from wayfarer.experiments.run import TrialRunner
from wayfarer.reports.data import read_run
from wayfarer.reports.map import track_of

HEADER = ("trial", "path, m", "fixes", "turned, degrees", "stretched", "from the first fix, m", "fitted, m")
ALGORITHM = "forest-pledge"


def rows(trials: int) -> Iterator[tuple[str, ...]]:
    """Run trials at the site ``forest-escape``, and yield the table's lines; the distances are medians."""
    campaign = make_campaign(
        {"algorithms": ALGORITHM, "trials": trials, "rover": "forestrover", "site": "forest-escape"}
    )
    for trial in range(trials):
        with TemporaryDirectory() as folder:
            TrialRunner(campaign, log_dir=Path(folder))(Task(ALGORITHM, trial))
            track = track_of(read_run(Path(folder)))
        assert track.fit is not None, "the site has a receiver"
        found, missed_m = track.fit, track.missed_m(true=True)
        way_m, fixes = track.data.summary.reckoned_m, len(track.fixes)
        yield (
            f"{trial}", f"{way_m:.0f}", f"{fixes}", f"{found.turned_deg:.1f}", f"{found.stretched:.2f}",
            *(f"{each_m:.2f}" for each_m in missed_m),
        )  # fmt: skip
