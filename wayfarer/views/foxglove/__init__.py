"""A run in Foxglove: as an MCAP file, or live over a WebSocket. One table of channels serves both."""
