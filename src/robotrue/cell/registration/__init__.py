"""Where the part stands: its frame in the robot base from touches, with what is known about it."""
