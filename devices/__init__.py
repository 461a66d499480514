"""Virtual world, rig and compass module: physics and firmware behind CAN frames."""
