"""How the robot moves: kinematics, paths of the arm and of the base, timing.

General layout: ``urdf`` reads joints, ``symbolic`` and ``levenberg_marquardt`` are the mathematics behind
``kinematics``; ``arm_path`` and ``base_path`` (on ``clearance``) find waypoints with plain callables for collision;
``timing`` turns waypoints into trajectories. Random generators are passed in; ``errors`` lists what is raised.
"""
