"""Exported C as packages of ROS 2: ros2_control and MoveIt.

Uses `export/c`. Read first: `ros_package.py`.
"""
