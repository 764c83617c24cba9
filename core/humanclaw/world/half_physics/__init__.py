"""Half-physics, whatever engine carries it (paper, section "Locomotion-Decoupled Physical Simulation").

An engine brings a World: rigid bodies, contacts and one time step. All that makes a body follow commanded poses, what
bounds its pushes and what it does of its own accord is here, so that every engine keeps the same checks.
`HalfPhysics(open_world)` is a Simulator; `humanclaw.testing.SimulatorConformance` holds the checks that it has to pass.
"""
