"""Building blocks of the simulators: Warp functions of floats, vectors, arrays and structs.

No input or output, no global state, nothing that knows a world or a method.
"""
