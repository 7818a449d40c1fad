"""The control socket: how ``wayfarer status``, ``arm``, ``stop`` and the others reach the daemon.

``protocol.py`` says what can be asked and what is answered, ``paths.py`` where the socket is and that there is one
daemon, ``server.py`` serves it beside the control tick, ``client.py`` asks. Only the daemon's own user and root may.
"""
