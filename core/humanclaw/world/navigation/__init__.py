"""Navigation: occupancy, stairs, shortest ways, and places to stand at a target (paper, section 4.1).

An OccupancyGrid is one floor. A MultiFloorMap holds all floors of a scene with the stairs between them. A DistanceField
gives the distance between some places and everywhere, and the ways there. A Viewpoint is a place to stand.
"""
