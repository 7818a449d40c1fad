"""Register-accurate chips, fed by the one world: what stands behind the real drivers at bus depth.

They follow the datasheets, not the drivers, so that other people's libraries can speak to them too.
"""
