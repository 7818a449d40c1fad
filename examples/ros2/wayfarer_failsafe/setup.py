"""Installs the package where ``colcon build`` wants it."""

from setuptools import setup

NAME = "wayfarer_failsafe"

setup(
    name=NAME,
    version="0.1.0",
    packages=[NAME],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/launch", ["launch/failsafe.launch.py"]),
        (f"share/{NAME}/config", ["config/failsafe.yaml"]),
    ],
    install_requires=["setuptools"],  # and wayfarer, installed beforehand
    zip_safe=True,
    license="MIT",
    entry_points={"console_scripts": [f"failsafe = {NAME}.node:main"]},
)
