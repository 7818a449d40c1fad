"""What ran, as texts for the metadata of a file: who wrote it, what rover, what version drove it. Pure."""

from __future__ import annotations

from wayfarer import __version__
from wayfarer.fieldlog.typed import Header


def run_metadata(header: Header) -> dict[str, str]:
    """Return the metadata of a run by key; what the log does not say is left out."""
    values = {
        "exported_by": f"wayfarer {__version__}",
        "wayfarer_version": header.version,
        "rover": header.rover,
        "rover_file_hash": header.config_hash,
        "algorithm": header.algorithm,
        "log_schema": header.schema,
        "simulated": None if header.simulated is None else str(header.simulated).lower(),
        "seed": header.seed,
        "trial": header.trial,
    }
    return {key: str(value) for key, value in values.items() if value is not None}
