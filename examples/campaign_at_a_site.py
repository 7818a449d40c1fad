"""A small campaign at a site of the paper's field trials, and its table with the paper's figures.

Run it: pip install '.[sim]' && python examples/campaign_at_a_site.py
"""

from rich.console import Console

from wayfarer.config.rover_file import load_rover
from wayfarer.experiments.campaign import Campaign
from wayfarer.experiments.commands import at_site
from wayfarer.experiments.run_campaign import run
from wayfarer.experiments.site_table import layout_of
from wayfarer.experiments.tables import print_table

SITE, ROVER = "dense-obstruction", "minirover"

campaign = at_site(Campaign(("forest-pledge",), trials=4, rover=load_rover(ROVER)), SITE)
finished = run(campaign, jobs=1)  # jobs=8 for eight processes; the results are the same
print_table(Console(width=160), finished.summaries, layout_of(SITE, ROVER))
print(f"{finished.totals.simulated_s:.0f} s simulated in {finished.effort.wall_s:.1f} s")
