"""Register-accurate simulated chips, under the real drivers at bus depth.

They follow the datasheets, not the drivers, so that other people's libraries can speak to them too.
"""
