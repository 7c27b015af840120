"""`python -m pedpred.ros2` runs the node."""

from pedpred.ros2.main import main

main()
