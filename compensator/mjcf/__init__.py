"""Import of tendons from MuJoCo models: routes, tables over joints, joint torques, and a scenario to complete."""
