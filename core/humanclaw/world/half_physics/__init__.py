"""Half-physics on any engine (paper, section "Locomotion-Decoupled Physical Simulation").

An engine provides a World: rigid bodies, contacts and one time step. The drive along commanded poses, the bounds of
pushes and the reflexes are here, so that every engine passes the same checks.
`HalfPhysics(open_world)` is a Simulator; `humanclaw.testing.SimulatorConformance` holds the checks that it has to pass.
"""
