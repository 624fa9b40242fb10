"""Build of the ROS 2 package; its content is in setup.cfg."""

from setuptools import setup

setup()
