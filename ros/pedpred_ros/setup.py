"""The ROS package: what launches the node of the Python package pedpred."""

from glob import glob

from setuptools import setup

PACKAGE = "pedpred_ros"

setup(
    name=PACKAGE,
    version="0.1.0",
    packages=[PACKAGE],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml", "README.md"]),
        *((f"share/{PACKAGE}/{folder}", glob(f"{folder}/*")) for folder in ("launch", "config", "rviz")),
    ],
    install_requires=["setuptools", "pedpred"],
    zip_safe=True,
    maintainer="pedpred authors",
    maintainer_email="pedpred@example.org",
    description="Where every person around a robot will be in the next three seconds: a node for Nav2",
    license="MIT",
    entry_points={"console_scripts": ["pedpred = pedpred_ros.node:main"]},
)
