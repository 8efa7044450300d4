"""Serial arms: chain, forward and inverse kinematics, Jacobians, statics, presets."""
