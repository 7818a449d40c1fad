"""Options of the viewers of a running rover: the live page and a ground station."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from wayfarer.extras import require
from wayfarer.remote.live import HOST, PORT

if TYPE_CHECKING:
    from wayfarer.config.rover_file import RoverConfig
    from wayfarer.remote.live import DemoControls
    from wayfarer.remote.live.server import LivePage
    from wayfarer.remote.mavlink.ground_station import GroundStation

LOOKING_ON = "Viewers"


Live = Annotated[bool, typer.Option("--live", help="Serve the live page.", rich_help_panel=LOOKING_ON)]
LiveHost = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS",
        help=f"Address to serve at; 0.0.0.0 for telephones on the same network. (default: {HOST}, this computer only)",
        rich_help_panel=LOOKING_ON,
    ),
]
LivePort = Annotated[
    int | None,
    typer.Option(
        min=0,
        max=65535,
        metavar="N",
        help=f"Port of the page; 0 chooses a free one. (default: {PORT})",
        rich_help_panel=LOOKING_ON,
    ),
]
Mavlink = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS",
        help="Link to a ground station: udpout:HOST:PORT, udpin:HOST:PORT or serial:DEVICE:BAUD.",
        rich_help_panel=LOOKING_ON,
    ),
]

# For ``options.check_together``.
NEEDS = (("live_host", "live"), ("live_port", "live"))


def ground_station(address: str, config: RoverConfig) -> GroundStation:
    """Return the link to a ground station.

    Raises:
        BadInput: no such address; the text says why.
        WayfarerError: the host is not known now, or a package is missing.
    """
    require("--mavlink")
    from wayfarer.commissioning.checks.system import device_files
    from wayfarer.remote.mavlink.ground_station import GroundStation
    from wayfarer.remote.mavlink.link import check_not_a_part, parse_address

    where = parse_address(address)
    check_not_a_part(where, device_files(config))
    print(f"ground station: {where}; it can hold and disarm the rover, and start nothing", flush=True)
    return GroundStation(where, config)


def live_page(host: str | None, port: int | None, demo: DemoControls | None = None) -> LivePage:
    """Return the live page at an address (None: the usual one), with a new token; with the controls of a ``demo``.

    Raises:
        BadInput: the port can never be had.
        WayfarerError: it cannot be had now, or a package is missing.
    """
    require("the live page")
    from secrets import token_urlsafe

    from wayfarer.remote.live.server import LivePage

    return LivePage(HOST if host is None else host, PORT if port is None else port, token_urlsafe(16), demo=demo)
