"""wayfarer's fail-safe as a ROS 2 node between a planner and the base."""
