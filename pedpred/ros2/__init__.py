"""A ROS 2 node: people and a map in, forecasts out. `main` and `node` need rclpy, others do not."""
