"""Registration: the part's frame in the robot base from probing points, with covariance."""
