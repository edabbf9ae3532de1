"""Installation of the ROS 2 package with colcon."""

from setuptools import setup

NAME = "taxel_ros2"

setup(
    name=NAME,
    version="0.2.0",
    packages=[NAME],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/launch", ["launch/skin.launch.py"]),
        (f"share/{NAME}/config", ["config/skin.yaml"]),
    ],
    install_requires=["setuptools", "taxel[ros]"],
    license="MIT",
    description="Lifecycle node of a capacitive tactile skin",
    entry_points={"console_scripts": ["skin_node = taxel_ros2.skin_node:main", "skin_urdf = taxel_ros2.urdf:main"]},
)
