"""A small campaign at a site of the paper's field trials, and its table with the paper's figures.

Run it: pip install '.[sim]' && python examples/campaign_at_a_site.py
"""

from rich.console import Console

from wayfarer.config import load_rover
from wayfarer.simhal.campaign import run
from wayfarer.simhal.command import at_site
from wayfarer.simhal.plan import Campaign
from wayfarer.simhal.report_table import print_table
from wayfarer.simhal.sites.table import layout_of

SITE, ROVER = "dense-obstruction", "minirover"

campaign = at_site(Campaign(("forest-pledge",), trials=4, rover=load_rover(ROVER)), SITE)
finished = run(campaign, jobs=1)  # jobs=8 for eight processes; the results are the same
print_table(Console(width=160), finished.summaries, layout_of(SITE, ROVER))
print(f"{finished.totals.simulated_s:.0f} s simulated in {finished.effort.wall_s:.1f} s")
