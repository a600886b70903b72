"""What people use instead, a script a tool, at most 60 lines, each as the tool's manual writes it.

None of them knows of the package: points, bounds and functions of numbers go in, trajectories come out.
"""
