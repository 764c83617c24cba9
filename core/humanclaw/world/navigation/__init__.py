"""Navigation: occupancy, stairs, shortest ways, and places to stand at a target (paper, section 4.1).

An OccupancyGrid is one floor. A MultiFloorMap holds all floors of a scene with the stairs between them. A DistanceField
gives the distance to the nearest goal from everywhere, Routes the ways from one start to everywhere. A Viewpoint is a
place to stand.
"""
