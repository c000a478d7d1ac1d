"""How colcon installs this package; bug_gym itself comes from pip."""

from setuptools import setup

NAME = "bug_gym_ros"

setup(
    name=NAME,
    version="0.1.0",
    packages=[NAME],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/launch", ["launch/try_out.launch.py"]),
    ],
    install_requires=["setuptools", "bug-gym"],
    license="MIT",
    entry_points={"console_scripts": [f"policy = {NAME}.policy_node:main", f"world = {NAME}.world_node:main"]},
)
